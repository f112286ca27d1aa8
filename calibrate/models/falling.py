"""The initial velocity of a suspension from a short run of all of its particles."""

from collections.abc import Callable
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jax import Array

import mrjax
from calibrate.experiment.suspension import Suspension
from mrjax import InputError, Recipe, State
from mrjax.core import checks
from mrjax.core.tracing import value_or_none
from mrjax.laws import particle, time_scales

RELAXATIONS = 40
"""Length of a run in relaxation times, and its number of steps. The initial velocities decay to
e^-40, or to 1e-5 if the fit ends at a drag 3 times smaller. The fall is exact at any step."""

MARGIN = 10.0
"""Factor on the expected velocity in the check that no particles meet within a run."""

FEWEST_RELAXATIONS = 10.0
"""Least length of a run in relaxation times: the initial velocities decay to 5e-5."""

WITHOUT_CONTACTS = {
    "friction": 0.0,
    "rolling_friction": 0.0,
    "restitution": 1.0,
    "dissipation": 0.0,
    "tangential_dissipation": 0.0,
}
"""Contact properties of particles that meet nothing."""

Fall = Callable[[Suspension], Array]
"""Function from a suspension to its initial velocity, () in m/s."""


def fall(name: str, recipe: Recipe, near: Suspension, state: State) -> Fall:
    """Prepares the fall of particles from a state.

    Args:
      name: name of the sample, for messages.
      recipe: recipe with the box.
      near: the suspension that the run is prepared for.
      state: all particles, dispersed in the box.
    """
    parameters = near.parameters
    relaxation = float(time_scales.relaxation_time(parameters).max())
    duration = RELAXATIONS * relaxation
    travel = MARGIN * float(mrjax.terminal_velocity(parameters).max()) * duration
    radius = np.asarray(particle.outer_radius(parameters))
    reach = state.contact_diameter or 2.0 * float(radius.max())
    apart = not checks.may_touch(np.asarray(state.position), radius, recipe.box, 2 * travel, reach)

    def velocity(suspension: Suspension) -> Array:
        parameters = suspension.parameters
        slowest = value_or_none(jnp.max(time_scales.relaxation_time(parameters)))
        if slowest is not None and FEWEST_RELAXATIONS * slowest > duration:
            raise InputError(
                f"sample {name!r}: particles relax {slowest / relaxation:.3g} times more slowly "
                "than where this model was prepared; prepare it near these values"
            )
        if apart:  # contact laws would change nothing, and take long to compile
            parameters = parameters.replace(**WITHOUT_CONTACTS)
        run = mrjax.simulate(
            state,
            parameters,
            recipe.box,
            duration=duration,
            time_step=relaxation,
            hindrance=suspension.hindrance,
        )
        return mrjax.settling_velocity(run)

    return velocity


def falls(name: str, recipe: Recipe, near: Suspension, seed: int, fractions: tuple) -> list[Fall]:
    """Prepares falls of the recipe's particles, dispersed in its box at several volume fractions.

    Args:
      name, recipe, near: as for `fall`.
      seed: seed of the suspensions.
      fractions: volume fractions of the uncoated particles, (K,).

    Raises:
      InputError: particles that cannot be dispersed at one of them.
    """
    return [_fall_at(name, recipe, near, seed, fraction) for fraction in fractions]


def _fall_at(name: str, recipe: Recipe, near: Suspension, seed: int, fraction: float) -> Fall:
    try:
        diluted_recipe = recipe.replace(composition={"volume_fraction": fraction})
        state = mrjax.disperse(diluted_recipe, seed)
    except InputError as error:
        at = f"at the volume fraction {fraction:.4g} of one of its velocities"
        raise InputError(f"sample {name!r}: {at}: {error}") from None
    radius = diluted_recipe.parameters().radius

    def diluted(suspension: Suspension) -> Suspension:
        """The suspension at the fraction; with its own radii if these differ."""
        at = suspension.at(fraction)
        if not jnp.ndim(radius):
            return at
        return replace(at, parameters=at.parameters.replace(radius=radius))

    velocity = fall(name, diluted_recipe, diluted(near), state)
    return lambda suspension: velocity(diluted(suspension))
