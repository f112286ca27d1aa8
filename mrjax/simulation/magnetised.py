"""Directions of the remanent moments of particles, which turn with them in a run."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from mrjax.core import checks, randomness
from mrjax.core.state import State
from mrjax.dem.forces.dipoles import DIRECTION, refuse_directions

STREAM = 1
"""Number that is folded into the key of a seed, apart from that of random positions."""


def magnetised(state: State, directions: ArrayLike | None = None, *, seed: int = 0) -> State:
    """Returns a state whose particles have directions of remanent moments.

    Args:
      state: state of the particles.
      directions: unit vectors, (N, 3); random, uniform on the sphere, if left out.
      seed: seed of random directions; `disperse` takes its own.

    Raises:
      InputError: the directions have another shape, or their length is not 1.

    Example:
      >>> state = mrjax.magnetised(mrjax.place([[0.0, 0.0, 0.0]]), [[0.0, 0.0, 1.0]])
      >>> state.memory["remanence_direction"]
      Array([[0., 0., 1.]], dtype=float64)
    """
    checks.require_class(State, state=state)
    dtype = state.position.dtype
    if directions is None:
        with randomness.ordered():
            key = jax.random.fold_in(randomness.key(seed), STREAM)
            vectors = np.asarray(jax.random.normal(key, (state.particles, 3), float))
        directions = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    rows = jnp.asarray(directions, dtype)
    refuse_directions(rows, state.particles)
    return replace(state, memory=state.memory | {DIRECTION: rows})
