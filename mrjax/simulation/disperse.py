"""A random suspension without overlap, at densities where random insertion fails.

Points thrown at random are pushed apart as soft spheres, a little larger than the particles, by
FIRE (Bitzek et al. 2006) until no two particles touch. Random insertion alone jams at a volume
fraction of 0.38, less between walls.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import DTypeLike

from mrjax.core import checks, randomness
from mrjax.core._jax_md import minimize
from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.promotion import relaxed_promotion
from mrjax.core.state import State, place
from mrjax.dem import neighbours
from mrjax.dem.forces.contact import acts
from mrjax.dem.neighbours import ListPlan, Neighbours
from mrjax.laws import particle
from mrjax.recipe import contacts
from mrjax.recipe.recipe import Recipe
from mrjax.simulation.magnetised import magnetised

CLEARANCE = 0.005
"""Relative excess of the soft spheres' radii over the particles'."""
STEPS_BETWEEN_REBUILDS = 25
MOST_REBUILDS = 400
SKIN = 1.0
"""Skin of the neighbour list, in radii. Moves are clipped, so that none leaves it in a burst."""


def disperse(recipe: Recipe, seed: int = 0, *, dtype: DTypeLike = float) -> State:
    """The suspension of a recipe, well mixed and at rest; N follows from the composition.

    Remanent moments, if the recipe has a remanence, have random directions (`mrjax.magnetised`).

    On one machine, a seed gives the same suspension with every random generator of JAX.

    Args:
      recipe: the lab sheet.
      seed: seed of the random positions, and of the kicks of Brownian motion.
      dtype: dtype of the state, and so of a run that starts from it; `float` is JAX's default.

    Raises:
      InputError: the recipe lacks input for particles in contact, or the particles cannot be placed
        in the box without overlap.

    Example:
      >>> state = mrjax.disperse(mrjax.Recipe.load("case2"), seed=0)
      >>> state.position.shape
      (314, 3)
    """
    checks.require_class(Recipe, recipe=recipe)
    contacts.refuse_missing(recipe)
    parameters = recipe.parameters()
    particles = recipe.particle_count
    radius = np.broadcast_to(np.asarray(particle.outer_radius(parameters)), (particles,))
    unit = float(radius.max())
    position = spread(randomness.key(seed), recipe.box.scaled(1 / unit), radius / unit)
    if position is None:
        size = " x ".join(f"{1e6 * length:.3g}" for length in recipe.box.size)
        raise InputError(
            f"{particles} particles of {2e6 * unit:.3g} um cannot be dispersed without overlap in "
            f"a box of {size} um (volume fraction {recipe.coated_volume_fraction:.3f}); use a "
            "larger box or fewer particles"
        )
    state = place(position * unit, contact_diameter=2 * unit, seed=seed, dtype=dtype)
    return magnetised(state, seed=seed) if acts(parameters.remanence) else state


def spread(key: Array, box: Box, radius: np.ndarray) -> np.ndarray | None:
    """Centres of spheres that do not touch, (N, 3); None if spheres touch after the last burst."""
    margin = np.where(box.periodic, 0.0, radius[:, None])
    with randomness.ordered():
        share = np.asarray(jax.random.uniform(key, (radius.size, 3), radius.dtype))
    position = margin + share * (np.asarray(box.size, radius.dtype) - 2.0 * margin)
    plan = neighbours.plan_list(box, radius.size, 2.0, particle.typical_diameter(radius), SKIN)
    for _ in range(MOST_REBUILDS):
        while True:
            relaxed, gap, overflow = _relax(position, radius, box, plan)
            if not int(overflow):
                break
            plan = plan.grown(int(overflow), radius.size)
        position = np.asarray(relaxed)
        if float(gap) > 0.1 * CLEARANCE:
            return position
    return None


@partial(jax.jit, static_argnames=("box", "plan"))
def _relax(position: Array, radius: Array, box: Box, plan: ListPlan) -> tuple[Array, Array, Array]:
    """Positions after a burst of FIRE with one neighbour list, smallest gap, and overflow."""
    listed = neighbours.build(plan, box, position)
    soft_radius = radius * (1.0 + CLEARANCE)
    displacement, _ = box.space()

    def energy(position: Array, listed: Neighbours, **_) -> Array:
        vector = displacement(
            jnp.broadcast_to(position, (*listed.partner.shape, 3)), position[listed.partner]
        )
        square = jnp.sum(vector**2, axis=-1)
        distinct = listed.present & (square > 0.0)
        distance = jnp.sqrt(jnp.where(distinct, square, 1.0))
        overlap = soft_radius[None, :] + soft_radius[listed.partner] - distance
        pairs = 0.25 * jnp.sum(jnp.where(distinct, jnp.maximum(overlap, 0.0), 0.0) ** 2)
        return pairs + sum(
            0.5 * jnp.sum(jnp.maximum(_wall_overlap(position, soft_radius, box, axis), 0.0) ** 2)
            for axis in box.walled_axes
        )

    longest = SKIN / (2.0 * STEPS_BETWEEN_REBUILDS * math.sqrt(3.0))

    def shift(position: Array, change: Array, **_) -> Array:
        return position + jnp.clip(change, -longest, longest)

    with relaxed_promotion():
        start, advance = minimize.fire_descent(energy, shift)
        state = start(position, listed=listed)
        state = lax.fori_loop(
            0, STEPS_BETWEEN_REBUILDS, lambda _, state: advance(state, listed=listed), state
        )
    relaxed = box.wrap(state.position)
    # The gap is taken from a new list: particles may have left the skin of the old one.
    relisted = neighbours.build(plan, box, relaxed)
    gap = neighbours.smallest_gap(relisted, radius)
    for axis in box.walled_axes:
        gap = jnp.minimum(gap, -jnp.max(_wall_overlap(relaxed, radius, box, axis)))
    return relaxed, gap, listed.overflow | relisted.overflow


def _wall_overlap(position: Array, radius: Array, box: Box, axis: int) -> Array:
    """Overlap with the nearer wall of an axis, (N,)."""
    return radius - jnp.minimum(position[:, axis], box.size[axis] - position[:, axis])
