"""Quantities that follow from a lab sheet without running it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.continuum import tilt
from mrjax.continuum.compression import Compression
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.core.units import MM_PER_DAY
from mrjax.laws import closed_forms, dimensionless, drag, time_scales, yield_stress
from mrjax.laws.closures import brzinski_durian
from mrjax.laws.closures.richardson_zaki import RICHARDSON_ZAKI_EXPONENT
from mrjax.recipe import attraction_notes, brownian_notes, carrier, contacts, magnetism_notes
from mrjax.recipe.recipe import Recipe
from mrjax.simulation import estimates
from mrjax.simulation.overlap import OVERLAP
from mrjax.simulation.softening import softened

if TYPE_CHECKING:
    from mrjax.dem.forces import Noise


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
    """Fractions, particles, densities, drag, velocities, time scales, and the cost of a run.

    Quantities of particles in contact are left out if the recipe lacks their input; `notes` says
    so.

    Args:
      recipe: the lab sheet.
      overlap: overlap to which contacts would be softened for a run to rest, in contact radii.

    Raises:
      InputError: no run can be made of the sheet.
    """
    quantities = [*_of_suspension(recipe), *_of_fall(recipe)]
    if contacts.missing(recipe) is None:
        quantities += [*_of_contacts(recipe), *_of_a_run_to_rest(recipe, overlap)]
    return [Quantity(key, name, float(value), unit) for key, name, value, unit in quantities]


def notes(
    recipe: Recipe,
    tube_diameter: float | None = None,
    tube_height: float | None = None,
    compression: Compression | None = None,
) -> list[str]:
    """Remarks on assumptions, and on what matters in a suspension.

    They are assumed and inconsistent values, quantities that `derived` leaves out, the branch of
    hindered settling, what moves in a fluid with a yield stress, whether particles stick or attract
    each other magnetically, Brownian motion, the layers of a tube, and whether its suspension
    stands without settling.

    Args:
      recipe: the lab sheet.
      tube_diameter: inner diameter of the tube, m; None if it is not known.
      tube_height: height of the suspension in the tube, m; None if it is not known.
      compression: effective solid stress of the bed; None if it is not known.
    """
    lacking = contacts.missing(recipe)
    omissions = [f"times and steps of contacts are left out: {lacking}"] if lacking else []
    moving = carrier.notes(recipe.parameters(), recipe.coated_volume_fraction, tube_diameter)
    sheet = recipe.attraction
    stated = () if sheet is None else (sheet.hamaker, sheet.stated.get("layer_thickness"))
    parameters = recipe.parameters()
    forces = [
        *attraction_notes.notes(parameters, *stated),
        *magnetism_notes.notes(parameters, recipe.temperature, recipe.particle_count),
        *brownian_notes.notes(recipe),
    ]
    assumed = [*recipe.notes, *recipe.contact_notes, *omissions]
    tube = [*_layers(recipe, tube_height), *_standing(recipe, tube_height, compression)]
    return [*assumed, *forces, *tube, branch_note(recipe), *moving]


def _layers(recipe: Recipe, tube_height: float | None) -> list[str]:
    """A note on the layers of a tube beside those of a simulated box; none without a tube."""
    if tube_height is None or not recipe.gravity:
        return []
    diameter = recipe.radius_factor * float(np.mean(recipe.diameters))
    tube, box = tube_height / diameter, recipe.box.height / diameter
    return [
        f"the suspension of {1e3 * tube_height:.3g} mm in its tube is {tube:.2g} diameters high, "
        f"and that of the simulated box {box:.2g}: a chain of particles breaks under its weight if "
        "they are more than the granular Bond number, so that a loose bed that stands in the box "
        "may yield in the tube (compression of a column)"
    ]


def _standing(
    recipe: Recipe, tube_height: float | None, compression: Compression | None
) -> list[str]:
    """A note on the load of a network, Delta rho g phi H, over its strength sigma(phi)."""
    if tube_height is None or compression is None or not recipe.gravity:
        return []
    fraction = recipe.coated_volume_fraction
    excess = abs(recipe.apparent_density - recipe.fluid.density)
    load = excess * recipe.gravity * fraction * tube_height
    strength = float(evaluate_with_numpy(compression.solid_stress, fraction))
    begins = (
        f"the suspension of {1e3 * tube_height:.3g} mm weighs {load:.3g} Pa on its floor, and at a "
        f"volume fraction of {fraction:.3g} "
    )
    if not strength > 0.0:
        gel = float(compression.gel_fraction)
        return [f"{begins}there is no network: it settles until {gel:.3g} at least"]
    ratio = load / strength
    verdict = "it stands without settling" if ratio <= 1.0 else "it settles until denser"
    return [
        f"{begins}its network bears {strength:.3g} Pa: load over strength is {ratio:.3g}, {verdict}"
    ]


def branch_note(recipe: Recipe) -> str:
    """The branch of hindered settling at the Peclet number of a recipe, in words."""
    number = recipe.peclet_number
    branch = brzinski_durian.branch(number)
    side = "below" if branch == "low" else "above"
    note = (
        f"at a Peclet number of {number:.2g}, {side} {brzinski_durian.CROSSOVER:.0e}, hindered "
        f"settling is on the {branch} branch of Brzinski & Durian (2018), with an exponent of "
        f"{brzinski_durian.BRANCHES[branch]:g}"
    )
    closure = recipe.closure
    if closure is None or closure.func is not drag.richardson_zaki:
        return note
    exponent = closure.keywords.get("exponent", RICHARDSON_ZAKI_EXPONENT)
    others = [name for name, value in brzinski_durian.BRANCHES.items() if value == exponent]
    place = f"the {others[0]} branch" if others else "neither branch"
    return f"{note}; {exponent:g}, that of its richardson-zaki, is on {place}"


Row = tuple[str, str, ArrayLike, str]
"""Key, name, value and unit of a quantity."""


def _of_suspension(recipe: Recipe) -> list[Row]:
    """Fractions, sizes, density and the factors on drag."""
    diameters = 1e6 * recipe.radius_factor * recipe.diameters
    return [
        ("particles", "particles in the box", recipe.particle_count, "1"),
        ("volume_fraction", "volume fraction of particles", recipe.volume_fraction, "1"),
        (
            "coated_volume_fraction",
            "volume fraction of coated particles",
            recipe.coated_volume_fraction,
            "1",
        ),
        ("smallest_diameter", "smallest coated diameter", diameters[0], "um"),
        ("largest_diameter", "largest coated diameter", diameters[-1], "um"),
        ("density", "density of coated particles", recipe.apparent_density, "kg/m^3"),
        ("f_w", "f_w, crowding", recipe.f_w, "1"),
        ("f_s", "f_s, shape", recipe.f_s, "1"),
        ("f_v", "f_v, viscosity", recipe.drag.f_v, "1"),
        ("f_r", "f_r, coating", recipe.radius_factor, "1"),
    ]


def _of_fall(recipe: Recipe) -> list[Row]:
    """Settling velocity, dimensionless numbers and relaxation time."""
    parameters = recipe.parameters()
    velocity, relaxation = evaluate_with_numpy(_falling, parameters)
    numbers = dimensionless.numbers(parameters, velocity, recipe.temperature)
    return [
        (
            "settling_velocity",
            "settling velocity (Eq. 27)",
            MM_PER_DAY * np.mean(velocity),
            "mm/day",
        ),
        *(
            (f"{number.name.lower()}_number", f"{number.name} number", number.value, "1")
            for number in numbers
        ),
        ("relaxation_time", "relaxation time", relaxation, "s"),
        *_of_yield(parameters),
    ]


def _of_yield(parameters: Parameters) -> list[Row]:
    """Yield number and threshold of the particle that moves first; none without a yield stress.

    Without gravity nothing moves, and there are none, either.
    """
    if parameters.yield_stress is None or not float(parameters.gravity):
        return []
    number = np.min(evaluate_with_numpy(yield_stress.yield_number, parameters))
    critical = np.max(evaluate_with_numpy(yield_stress.critical_yield_stress, parameters))
    return [
        ("yield_number", "yield number (a sphere moves below 0.143)", number, "1"),
        ("critical_yield_stress", "yield stress that holds a particle", critical, "Pa"),
    ]


def _of_contacts(recipe: Recipe) -> list[Row]:
    """Rayleigh time of a contact, and the step that resolves contacts and the rise of velocity."""
    parameters = recipe.parameters()
    rayleigh = evaluate_with_numpy(time_scales.rayleigh_time, parameters)
    step = evaluate_with_numpy(time_scales.time_step, parameters)
    return [
        ("rayleigh_time", "Rayleigh time of a contact (Eq. 26)", rayleigh, "s"),
        ("time_step", "step that resolves both (Eq. 29)", step, "s"),
    ]


def _of_a_run_to_rest(recipe: Recipe, overlap: float) -> list[Row]:
    """Softening, step, duration and cost of a run to rest.

    Raises:
      InputError: nothing comes to rest, or no step is stable.
    """
    parameters, count = recipe.parameters(), recipe.particle_count
    soft = softened(parameters, recipe.box, count, overlap)
    way = estimates.Way(recipe.box.height, recipe.box.height)
    fall, falling = estimates.duration(soft, recipe.box, count, way)
    step = estimates.step(
        soft, recipe.box, count, falling, recipe.hindrance, noises=_noises(recipe)
    )
    factor = float(soft.elastic_modulus) / float(parameters.elastic_modulus)
    rest, steps = estimates.TIMES_FREE_FALL * fall, estimates.TIMES_FREE_FALL * fall / step
    return [
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


def _noises(recipe: Recipe) -> "tuple[Noise, ...]":
    """Random forces of a sheet; they are imported only where there are any."""
    if not recipe.brownian_motion:
        return ()
    from mrjax.dem.forces import Brownian

    return (Brownian(),)


def warnings(
    recipe: Recipe, tube_diameter: float | None = None, tube_height: float | None = None
) -> list[str]:
    """Warnings, one line for each assumption of the model that does not hold.

    Args:
      recipe: the lab sheet.
      tube_diameter: inner diameter of the tube, m; None if it is not known.
      tube_height: height of the suspension in the tube, m; None if it is not known.
    """
    parameters = recipe.parameters()
    velocity, _ = evaluate_with_numpy(_falling, parameters)
    lines = dimensionless.warnings(dimensionless.numbers(parameters, velocity, recipe.temperature))
    narrow = None
    if tube_diameter is not None and tube_height is not None:
        narrow = tilt.warning(tube_height, tilt.gap_of_round_tube(tube_diameter))
    return [*lines, narrow] if narrow else lines


def _falling(parameters: Parameters) -> tuple[Array, Array]:
    """Terminal velocity of each particle, m/s, () or (N,), and the longest relaxation time, s."""
    return (
        closed_forms.terminal_velocity(parameters),
        jnp.max(time_scales.relaxation_time(parameters)),
    )
