"""Softer contacts on purpose, so that a bed can be followed with longer steps.

A 4 um iron particle at rest overlaps its neighbour by 1e-7 of its radius, and at that stiffness the
settling of a 50 um box would take 1e12 steps. Where inertia plays no part the stiffness does not
either, as long as overlaps stay small: `softened` divides the moduli of particles and walls by one
factor, chosen from the greatest overlap that is allowed. What contacts dissipate is then lost
beside the drag, and is left out of the program.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mrjax import checks, drag, particle, timestep
from mrjax.box import Box
from mrjax.concrete import known
from mrjax.errors import InputError
from mrjax.parameters import Parameters

FORCE_CHAINS = 4.5
"""Greatest contact force at the floor of a random bed over the mean load of a particle there."""
MOST_OVERLAP = 0.1
"""In contact radii: beyond it the height of a bed would show it."""

IDLE = 1e-3
"""Share of a contact's dashpot in the drag below which it is left out."""


def softened(parameters: Parameters, box: Box, particles: int, overlap: float) -> Parameters:
    """The parameters with moduli lowered until a settled bed overlaps by about `overlap`.

    Never stiffer than they were. Dissipation and restitution are left out where, at that overlap,
    their dashpots are less than a thousandth of the drag: a particle in oil does not bounce. Not
    derived through: the factor is a number.

    Args:
      parameters: of the run; their moduli, weight and radius must be concrete.
      box: the container; walls at its sides carry nothing here.
      particles: N.
      overlap: greatest overlap of a contact at rest, as a fraction of the largest contact radius.

    Raises:
      InputError: an overlap that is not between 0 and 0.1, or parameters that are traced.
    """
    overlap = checks.positive(overlap, "overlap", "contact radii")
    if overlap > MOST_OVERLAP:
        raise InputError(
            f"overlap = {overlap:g} contact radii: give at most {MOST_OVERLAP}, better 0.02"
        )
    factor = _factor(parameters, box, particles, overlap)
    if np.isnan(factor):
        raise InputError("the parameters are traced by jit or vmap; soften them outside")
    soft = parameters.replace(
        elastic_modulus=parameters.elastic_modulus * factor,
        wall_elastic_modulus=parameters.wall_elastic_modulus * factor,
    )
    with jax.ensure_compile_time_eval():
        numbers = known(soft)
        dashpots = timestep.dashpots(numbers, overlap * jnp.max(particle.outer_radius(numbers)))
        idle = bool(jnp.all(dashpots < IDLE * drag.coefficient(numbers)))
    if not idle:
        return soft
    return soft.replace(restitution=1.0, dissipation=0.0, tangential_dissipation=0.0)


def _factor(parameters: Parameters, box: Box, particles: int, overlap: float) -> float:
    with jax.ensure_compile_time_eval():
        numbers = known(parameters)
        largest = float(jnp.max(particle.outer_radius(numbers)))
        expected = resting_overlap(numbers, box, particles)
    # Hertz: the overlap under a load goes with E^(-2/3).
    return float(np.minimum(1.0, (expected / (overlap * largest)) ** 1.5))  # keeps NaN


def resting_overlap(numbers: Parameters, box: Box, particles: int) -> float:
    """Deepest overlap to be expected in a bed of N particles at rest, m; NaN where traced."""
    radius = np.broadcast_to(particle.outer_radius(numbers), particles)
    weight = np.broadcast_to(particle.net_weight(numbers), particles)
    # All that lies on an area as wide as the largest particle.
    above = weight.sum() * (2.0 * radius.max()) ** 2 / (box.size[0] * box.size[1])
    load = FORCE_CHAINS * max(above, weight.max())
    return float(timestep.expected_overlap(numbers, load, 0.0))
