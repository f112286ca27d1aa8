"""Table 2 of Son (2018), with a function for each line of the table."""

from collections.abc import Callable, Iterator

import jax.numpy as jnp
import numpy as np
from jax import Array

import mrjax
from mrjax import Parameters, Recipe
from mrjax.core.units import MM_PER_DAY
from mrjax.laws import drag, particle, time_scales
from mrjax.paper.case import FINAL_RATIO_WITHIN, Case
from mrjax.paper.dry_beds import INFERRED_FRICTION
from mrjax.paper.row import Row, row
from mrjax.paper.runs import PAPER_STEPS

PRINTED_VELOCITIES = ("491.2", "9.2", "4.0")
"""Initial settling velocities, mm/day."""
MEASURED = "measured by Fang et al. (2005), not a result of the model: see the calibration"


def rows(case: Case) -> Iterator[Row]:
    """Returns the rows of the column of a case, from top to bottom."""
    return (line(case) for line in LINES)


def _surfactant(case: Case) -> Row:
    needed = "a coating of f_r = 1.10 at 800 kg/m^3 would take 2.78 %"
    return row(
        case.name,
        "surfactant weight composition",
        case.choose("0.0", "0.0", "1.6"),
        100 * case.recipe.composition.coating,
        "%",
        case.choose("input", "input", f"input; {needed}"),
    )


def _shape_factor(case: Case) -> Row:
    printed = case.choose("1.00", "1.10", "1.10")
    return row(case.name, "shape correction factor", printed, case.recipe.f_s, "1", "input")


def _wall_factor(case: Case) -> Row:
    uncapped = float(drag.son2018_uncapped(_counted_fraction(case.recipe)))
    return row(
        case.name,
        "wall correction factor",
        case.choose("1.00", "48.49", "48.99"),
        case.recipe.f_w,
        "1",
        case.choose(
            "input",
            f"Eq. 14 at the volume fraction of 314 particles gives {uncapped:.2f}, capped at "
            "48.985; the printed value is Eq. 14 without its +1, at lambda rounded to 0.7592: "
            f"{389.1530 * 0.7592**7.5593:.3f}",
            f"the cap, from the coated volume fraction ({uncapped:.1f} uncapped)",
        ),
    )


def _radius_factor(case: Case) -> Row:
    printed, f_r = case.choose("1.00", "1.00", "1.10"), case.recipe.radius_factor
    return row(case.name, "radius magnification factor", printed, f_r, "1", "input")


def _viscosity_factor(case: Case) -> Row:
    printed, f_v = case.choose("1.00", "1.00", "1.68"), case.recipe.drag.f_v
    return row(case.name, "viscosity magnification factor", printed, f_v, "1", "input")


def _time_step(case: Case) -> Row:
    contact = float(time_scales.rayleigh_time(case.parameters))
    rise = float(time_scales.rise_time(case.parameters))
    bound = min(contact, rise)
    step = PAPER_STEPS[case.name]
    return row(
        case.name,
        "computation time step",
        case.choose("100.0", "0.1", "1.0"),
        1e9 * float(time_scales.time_step(case.parameters)),
        "ns",
        f"Eq. 29 with h_t = {time_scales.REFINEMENT:g}; t_c = {1e9 * contact:.4g} ns, t_r = "
        f"{1e9 * rise:.4g} ns; "
        + case.choose(
            f"the printed step is {step / bound:.0f} t_c: contact was ignored",
            f"the printed step means h_t = {bound / step:.1f}",
            f"the printed step means h_t = {bound / step:.1f}, with a modulus of 3120 MPa; Table 1 "
            "prints GPa, which gives a t_c below the step",
        ),
    )


def _measured_velocity(case: Case) -> Row:
    return row(
        case.name,
        "initial settling velocity, measured",
        case.choose("8.0", "8.0", "3.6"),
        None,
        "mm/day",
        MEASURED,
        "not reproducible",
    )


def _velocity(case: Case) -> Row:
    return row(
        case.name,
        "initial settling velocity",
        case.choose(*PRINTED_VELOCITIES),
        case.velocity,
        "mm/day",
        case.choose(
            "",
            "with f_w at its cap; the printed f_w gives the printed velocity, see below",
            "Eqs. 19-24 give 4.8955; the closest variant, the apparent density with the uncoated "
            f"radius, gives {uncoated_radius_velocity(case.parameters):.3f}",
        ),
        case.choose("corrected", "corrected", "not reproducible"),
    )


def _reynolds_number(case: Case) -> Row:
    printed_velocity = float(case.choose(*PRINTED_VELOCITIES))
    reynolds = float(mrjax.reynolds_number(printed_velocity / MM_PER_DAY, case.parameters))
    reason = (
        f"the printed velocity gives {reynolds:.3g}; that over 1.68, the viscosity factor "
        f"of case 3, is {reynolds / 1.68:.3g}, the printed value"
    )
    return row(
        case.name,
        "Reynolds number",
        case.choose("2.16e-6", "2.41e-8", "6.82e-9"),
        float(mrjax.reynolds_number(case.velocity / MM_PER_DAY, case.parameters)),
        "1",
        case.choose("", reason, f"{reason}, nearly"),
    )


def _measured_ratio(case: Case) -> Row:
    return row(
        case.name,
        "final sedimentation ratio, measured",
        f"{case.measured_ratio:.1f}",
        None,
        "%",
        MEASURED,
        "not reproducible",
    )


def _final_ratio(case: Case) -> Row:
    return row(
        case.name,
        "final sedimentation ratio",
        case.choose("69.3", "69.3", "86.4"),
        case.final_ratio,
        "%",
        _bed_reason(case.runs.final_ratios(case.name)),
        "not reproducible",
        within=FINAL_RATIO_WITHIN,
        standard_error=case.final_ratio_error,
    )


LINES: tuple[Callable[[Case], Row], ...] = (
    _surfactant,
    _shape_factor,
    _wall_factor,
    _radius_factor,
    _viscosity_factor,
    _time_step,
    _measured_velocity,
    _velocity,
    _reynolds_number,
    _measured_ratio,
    _final_ratio,
)


def uncoated_radius_velocity(parameters: Parameters) -> float:
    """Settling velocity with the net weight of the uncoated volume and the coated drag; mm/day.

    This is the simplest error that gives the printed 4.0 of case 3: the apparent density is used
    with the uncoated radius.
    """
    density = particle.apparent_density(parameters) - parameters.fluid_density
    weight = density * particle.core_volume(parameters) * parameters.gravity
    stokes = drag.coefficient(parameters) / parameters.f_r
    return MM_PER_DAY * float(weight / stokes)


def _bed_reason(ratios: Array) -> str:
    """Returns the reason for final ratios in %: their statistics, and how the beds were made."""
    if len(ratios) > 1:
        error = float(mrjax.standard_error(ratios))
        statistics = (
            f"{float(jnp.mean(ratios)):.2f} +- {error:.2f}, mean and standard error of "
            f"{len(ratios)} random starts, {float(ratios.min()):.1f} to {float(ratios.max()):.1f}"
        )
    else:
        statistics = f"{float(ratios[0]):.2f}, of one random start"
    return (
        f"{statistics}; dropped without drag as in section 3.1, walls on all sides, top of the "
        f"highest particle; the friction coefficient, {INFERRED_FRICTION:g}, is inferred, none is "
        "given; "
        f"reproduced means within {FINAL_RATIO_WITHIN:g} points, as starts differ by up to 3"
    )


def _counted_fraction(recipe: Recipe) -> float:
    """Returns the coated volume fraction of the whole number of particles in the box."""
    ratio = recipe.particle_count * recipe.coated_volume_fraction / recipe.volume_fraction
    return ratio * 4 / 3 * np.pi * (recipe.diameters[0] / 2) ** 3 / recipe.box.volume
