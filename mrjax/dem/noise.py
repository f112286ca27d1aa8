"""Sum of the random forces of a step."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.core.parameters import Parameters
from mrjax.core.randomness import RandomStream
from mrjax.dem.forces import Noise

NUMBERS = 6
"""Random numbers of a particle for one force and one step: for force and torque."""


class RandomWrench(NamedTuple):
    """Random force and torque on every particle, (3, N) each."""

    force: Array
    torque: Array | None  # None if no random force has one


def random_wrench(
    forces: Sequence[Noise],
    parameters: Parameters,
    random: RandomStream,
    done: ArrayLike,
    dtype: DTypeLike,
) -> RandomWrench:
    """Sums random forces and torques, in reduced units with the step as unit of time.

    Args:
      forces: random forces, at least one.
      parameters: parameters, with the drag of this moment.
      random: random numbers of the particles.
      done: number of steps since those of `random` were counted.
      dtype: dtype of the motion.
    """
    wrenches = [
        force(parameters, random.normal(place, done, NUMBERS, dtype), 1.0)
        for place, force in enumerate(forces)
    ]
    pushes = [jnp.asarray(wrench.force) for wrench in wrenches]
    torques = [jnp.asarray(wrench.torque) for wrench in wrenches if wrench.torque is not None]
    return RandomWrench(
        sum(pushes[1:], pushes[0]), sum(torques[1:], torques[0]) if torques else None
    )
