"""Quantities that follow from a lab sheet without running it."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.core.units import MM_PER_DAY
from mrjax.laws import closed_forms, dimensionless, particle, time_scales
from mrjax.recipe.recipe import Recipe
from mrjax.simulation import estimates
from mrjax.simulation.overlap import OVERLAP
from mrjax.simulation.softening import softened


@dataclass(frozen=True)
class Quantity:
    """A quantity that follows from a sheet."""

    key: str
    """An identifier."""
    name: str
    """The name in words."""
    value: float
    unit: str


def derived(recipe: Recipe, overlap: float = OVERLAP) -> list[Quantity]:
    """Fractions, particles, densities, drag, velocities, time scales, and what a run would take.

    Args:
      recipe: the lab sheet.
      overlap: to which contacts would be softened for a run to rest, in contact radii.

    Raises:
      InputError: a sheet of which a run cannot be made.
    """
    parameters, count = recipe.parameters(), recipe.particle_count
    particles = evaluate_with_numpy(_of_particles, parameters)
    soft = softened(parameters, recipe.box, count, overlap)
    way = estimates.Way(recipe.box.height, recipe.box.height)
    fall, falling = estimates.duration(soft, recipe.box, count, way)
    step = estimates.step(soft, recipe.box, count, falling, recipe.hindrance)
    factor = float(soft.elastic_modulus) / float(parameters.elastic_modulus)
    numbers = dimensionless.numbers(parameters, particles["velocity"])
    rest, steps = estimates.TIMES_FREE_FALL * fall, estimates.TIMES_FREE_FALL * fall / step
    quantities = [
        ("particles", "particles in the box", count, "1"),
        ("volume_fraction", "volume fraction of particles", recipe.volume_fraction, "1"),
        (
            "coated_volume_fraction",
            "volume fraction of coated particles",
            recipe.coated_volume_fraction,
            "1",
        ),
        ("smallest_diameter", "smallest coated diameter", 2e6 * particles["smallest"], "um"),
        ("largest_diameter", "largest coated diameter", 2e6 * particles["largest"], "um"),
        ("density", "density of coated particles", recipe.apparent_density, "kg/m^3"),
        ("f_w", "f_w, crowding", recipe.f_w, "1"),
        ("f_s", "f_s, shape", recipe.f_s, "1"),
        ("f_v", "f_v, viscosity", recipe.drag.f_v, "1"),
        ("f_r", "f_r, coating", recipe.radius_factor, "1"),
        (
            "settling_velocity",
            "settling velocity (Eq. 27)",
            MM_PER_DAY * np.mean(particles["velocity"]),
            "mm/day",
        ),
        *(
            (f"{number.name.lower()}_number", f"{number.name} number", number.value, "1")
            for number in numbers
        ),
        ("relaxation_time", "relaxation time", particles["relaxation"], "s"),
        ("rayleigh_time", "Rayleigh time of a contact (Eq. 26)", particles["rayleigh"], "s"),
        ("time_step", "step that resolves both (Eq. 29)", particles["step"], "s"),
        ("softening", f"factor on moduli for an overlap of {overlap:g} radii", factor, "1"),
        ("time_step_to_rest", "step of a run to rest", step, "s"),
        ("duration_to_rest", "duration of a run to rest, about", rest, "s"),
        ("steps_to_rest", "steps of a run to rest, about", steps, "1"),
        (
            "wall_time_to_rest",
            "its time at a million particle-steps a second",
            1e-6 * count * steps,
            "s",
        ),
    ]
    return [Quantity(key, name, float(value), unit) for key, name, value, unit in quantities]


def warnings(recipe: Recipe) -> list[str]:
    """Warnings, one line for each assumption of the model that the suspension does not meet."""
    parameters = recipe.parameters()
    velocity = evaluate_with_numpy(_of_particles, parameters)["velocity"]
    return dimensionless.warnings(dimensionless.numbers(parameters, velocity))


def _of_particles(parameters: Parameters) -> dict[str, Array]:
    """Extremes over all particles, and the velocity of each, () or (N,); SI, without a box."""
    outer = particle.outer_radius(parameters)
    return {
        "smallest": jnp.min(outer),
        "largest": jnp.max(outer),
        "velocity": closed_forms.terminal_velocity(parameters),
        "relaxation": jnp.max(time_scales.relaxation_time(parameters)),
        "rayleigh": time_scales.rayleigh_time(parameters),
        "step": time_scales.time_step(parameters),
    }
