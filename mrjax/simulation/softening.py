"""Softens contacts, so that a bed can be followed with longer steps.

A 4 um iron particle at rest overlaps its neighbour by 1e-7 of its radius, and at that stiffness the
settling of a 50 um box would take 1e12 steps. Without inertia the stiffness does not matter, as
long as overlaps stay small. `softened` divides the moduli of particles and walls by one factor,
chosen from the greatest overlap that is allowed. The load is that of the bed with the pull-off
force and the pull of magnetic chains. In Brownian motion the overlap is that of an impact, too, at
three thermal speeds of each particle. Attraction keeps its pull-off force and gets a range that the
longer steps resolve. The dissipation of contacts is then negligible beside the drag, and is left
out of the program.
"""

from functools import partial

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.tracing import drop_tracers, evaluated_or_none
from mrjax.laws import attraction, brownian, drag, magnetism, particle, time_scales
from mrjax.simulation.overlap import MOST_OVERLAP

FORCE_CHAINS = 4.5
"""Greatest contact force at the floor of a random bed over the mean load of a particle there."""

RANGE = 0.03
"""Range of the attraction of softened contacts, in radii, if the parameters have none."""

IDLE = 1e-3
"""Ratio of a contact's dashpot to the drag below which the dashpot is left out."""


def softened(parameters: Parameters, box: Box, particles: int, overlap: float) -> Parameters:
    """The parameters with moduli lowered until a settled bed overlaps by about `overlap`.

    The moduli are never raised. Particles lighter than the fluid make their bed under the lid.
    Dissipation and restitution are left out if, at that overlap, their dashpots are less than a
    thousandth of the drag: a particle in oil does not bounce. The factor is a number, through which
    no derivative goes. Attraction without an `attraction_range` gets one of `RANGE`.

    Args:
      parameters: parameters of the run; their moduli, weight and radius must be concrete.
      box: the container; its side walls are taken to carry no load.
      particles: N.
      overlap: greatest overlap of a contact at rest, as a fraction of the largest contact radius.

    Raises:
      InputError: the overlap is not between 0 and 0.1, nothing presses the particles onto each
        other, neither a net weight nor attraction nor magnetism, or the parameters are traced.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> stiff = recipe.parameters()
      >>> soft = mrjax.softened(stiff, recipe.box, recipe.particle_count, overlap=0.025)
      >>> print(f"{soft.elastic_modulus / stiff.elastic_modulus:.2g}")
      3.2e-08
    """
    checks.require_class(Parameters, parameters=parameters)
    checks.require_class(Box, box=box)
    particles = checks.whole(particles, "particles")
    checks.refuse_out_of_range(parameters)
    overlap = checks.positive(overlap, "overlap", "contact radii")
    if overlap > MOST_OVERLAP:
        raise InputError(
            f"overlap = {overlap:g} contact radii: give at most {MOST_OVERLAP}, better 0.02"
        )
    law = partial(_factor, box=box, particles=particles, overlap=overlap)
    value = evaluated_or_none(partial(evaluate_with_numpy, law), drop_tracers(parameters))
    if value is None:
        raise InputError("the parameters are traced by jit or vmap; soften them outside")
    factor = float(value)
    if not factor > 0.0:
        raise InputError(
            "nothing presses the particles into a bed: gravity or the net weight is zero; soften "
            "those that sink or rise"
        )
    soft = parameters.replace(
        elastic_modulus=parameters.elastic_modulus * factor,
        wall_elastic_modulus=parameters.wall_elastic_modulus * factor,
    )
    if parameters.hamaker is not None and parameters.attraction_range is None:
        soft = soft.replace(attraction_range=jnp.asarray(RANGE, jnp.result_type(soft.radius)))
    idle = evaluated_or_none(
        partial(evaluate_with_numpy, partial(_idle, overlap=overlap)), drop_tracers(soft)
    )
    if idle is None or not idle:
        return soft
    return soft.replace(restitution=1.0, dissipation=0.0, tangential_dissipation=0.0)


def _factor(numbers: Parameters, box: Box, particles: int, overlap: float) -> Array:
    """Factor on the moduli, at most 1, ()."""
    largest = jnp.max(particle.outer_radius(numbers))
    attracts = numbers.hamaker is not None
    pull = jnp.maximum(*attraction.largest_pull_off(numbers)) if attracts else 0.0
    pull = pull + magnetism.largest_pull(numbers)
    expected = resting_overlap(numbers, box, particles, pull)
    # Hertz: the overlap is proportional to E^(-2/3) under a load, and to E^(-2/5) in an impact.
    factor = (expected / (overlap * largest)) ** 1.5
    if numbers.temperature is not None:
        speed = 2.0 * brownian.IMPACT * jnp.max(brownian.thermal_speed(numbers))
        impact = time_scales.expected_overlap(numbers, 0.0, speed)
        factor = jnp.maximum(factor, (impact / (overlap * largest)) ** 2.5)
    return jnp.minimum(1.0, factor)


def _idle(numbers: Parameters, overlap: float) -> Array:
    """True if all dashpots are negligible beside the drag at this overlap, in contact radii; ()."""
    dashpots = time_scales.dashpots(numbers, overlap * jnp.max(particle.outer_radius(numbers)))
    return jnp.all(dashpots < IDLE * drag.coefficient(numbers))


def resting_overlap(numbers: Parameters, box: Box, particles: int, pull: ArrayLike = 0.0) -> Array:
    """Deepest overlap expected in a bed of N particles at rest, m, ().

    Particles that sink press on the floor, particles that rise on the lid.

    Args:
      numbers: parameters without tracers.
      box: the container.
      particles: N.
      pull: attraction of two surfaces in contact, N.
    """
    radius = per_particle(particle.outer_radius(numbers), particles)
    weight = per_particle(particle.net_weight(numbers), particles)
    pressing = jnp.maximum(jnp.sum(jnp.maximum(weight, 0.0)), jnp.sum(jnp.maximum(-weight, 0.0)))
    # Weight of all particles above an area as wide as the largest particle.
    above = pressing * (2.0 * jnp.max(radius)) ** 2 / (box.size[0] * box.size[1])
    load = FORCE_CHAINS * jnp.maximum(above, jnp.max(jnp.abs(weight)))
    # Hertz's force bears the load and the attraction.
    return time_scales.expected_overlap(numbers, load + pull, 0.0)
