"""Checks of the arguments of a column.

Concrete arguments are refused with a message; for traced arguments a flag is computed, which marks
the result as invalid. The bounds of all numbers are in `bounds`.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.continuum import kynch
from mrjax.continuum.case import Case
from mrjax.continuum.tilt import LARGEST_ANGLE, Tilt
from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.laws.closed_forms import terminal_velocity


class Bound(NamedTuple):
    """A number that must be above zero and below a limit."""

    name: str
    value: ArrayLike
    limit: ArrayLike | None
    unit: str


def bounds(case: Case) -> tuple[Bound, ...]:
    """Returns the bounds of height and volume fractions."""
    return (
        Bound("height", case.height, None, "m"),
        Bound("bed_fraction", case.bed_fraction, 1.0, "1"),
        Bound("volume_fraction", case.volume_fraction, case.bed_fraction, "1"),
    )


def compression_bounds(case: Case) -> tuple[Bound, ...]:
    """Returns the bounds of the stress of a compressible bed; none for a rigid bed."""
    stress = case.compression
    if stress is None:
        return ()
    return (
        Bound("gel_fraction", stress.gel_fraction, case.bed_fraction, "1"),
        Bound("stress", stress.stress, None, "Pa"),
        Bound("exponent", stress.exponent, None, "1"),
    )


def refuse(case: Case) -> None:
    """Refuses arguments that do not describe a column; traced values pass unchecked.

    Raises:
      InputError: there is such an argument; the message names the first.
    """
    checks.require_class(Parameters, parameters=case.parameters)
    velocity = jnp.shape(terminal_velocity(case.parameters))
    if velocity != ():
        raise InputError(
            f"parameters are those of {velocity} particles; all particles of a column are equal: "
            "give one number for each parameter, such as the radius of the mean settling velocity, "
            "or call polydisperse_column"
        )
    checks.refuse_bad_parameters(case.parameters, 1, None, contacts=False)
    if case.compression is not None and case.parameters.yield_growth is not None:
        raise InputError(
            f"yield_growth = {shown(case.parameters.yield_growth)}: the stress of a compressible "
            "bed does not age with its carrier; leave out yield_growth or compression"
        )
    for bound in (*bounds(case), *compression_bounds(case)):
        refuse_number(bound)
    refuse_tilt(case.tilt)
    refuse_times(case.times)


def possible(case: Case, flux: kynch.Table) -> Array:
    """True, (), if `refuse` would accept the arguments and the particles settle; traceable."""
    times = case.times
    ascending = jnp.all(jnp.diff(times) > 0.0) & (times[0] >= 0.0) & (times[-1] > 0.0)
    within = jnp.asarray(True)
    for bound in (*bounds(case), *compression_bounds(case)):
        within = within & (bound.value > 0.0)
        if bound.limit is not None:
            within = within & (bound.value < bound.limit)
    return ascending & within & settles(flux) & tilt_possible(case.tilt)


def refuse_tilt(tilt: Tilt | None) -> None:
    """Refuses a tilt that is none; a traced one passes unchecked.

    Raises:
      InputError: the angle or the gap is out of its bounds, or no number.
    """
    if tilt is None:
        return
    checks.require_class(Tilt, tilt=tilt)
    refuse_number(Bound("tilt.gap", tilt.gap, None, "m"))
    try:
        number = checks.numeric(tilt.angle)
    except ValueError:
        number = np.zeros(2)  # refused below, because it is not one number
    if number is None:
        return
    if number.ndim or not 0.0 <= number < LARGEST_ANGLE:
        raise InputError(
            f"tilt.angle = {shown(tilt.angle)}: give one number, from 0 to below "
            f"{LARGEST_ANGLE:g}, in degrees from the vertical"
        )


def tilt_possible(tilt: Tilt | None) -> Array:
    """True, (), if `refuse_tilt` would accept a tilt; traceable."""
    if tilt is None:
        return jnp.asarray(True)
    angle = jnp.asarray(tilt.angle)
    return (angle >= 0.0) & (angle < LARGEST_ANGLE) & (jnp.asarray(tilt.gap) > 0.0)


def settles(flux: kynch.Table) -> Array:
    """True, (), if particles settle or rest at every volume fraction of a table."""
    return jnp.all(jnp.isfinite(flux.flux) & (flux.flux >= 0.0))


def slower_if_denser(flux: kynch.Table) -> Array:
    """True, (), if no suspension denser than the initial one falls faster than a thinner one."""
    fraction, flux_there = flux.fraction[kynch.INTERVALS :], flux.flux[kynch.INTERVALS :]
    velocity = flux_there / fraction
    rounding = 16.0 * jnp.finfo(velocity.dtype).eps * velocity[0]
    return jnp.all(jnp.diff(velocity) <= rounding)


def refuse_faster_if_denser(flux: kynch.Table, where: str = "with a compression") -> None:
    """Refuses a flux in which some denser suspension falls faster.

    Args:
      flux: f, in m/s.
      where: the kind of column that needs this, for the message.

    Raises:
      InputError: there is such a suspension.
    """
    if not slower_if_denser(flux):
        raise InputError(
            f"some suspension falls faster than a thinner one; {where}, give a hindrance "
            f"that grows with the volume fraction, from {float(flux.initial):.3g} to bed_fraction "
            f"= {float(flux.densest):.3g}"
        )


def refuse_not_settling(flux: kynch.Table) -> None:
    """Refuses a flux, in m/s, that is negative or infinite at a volume fraction.

    Raises:
      InputError: there is such a volume fraction; the message names the first.
    """
    for fraction, value in zip(np.asarray(flux.fraction), np.asarray(flux.flux), strict=True):
        if not 0.0 <= value < np.inf:
            raise InputError(
                f"at a volume fraction of {fraction:.3g} the particles would settle at "
                f"{value / fraction:.3g} m/s; give a hindrance that holds up to bed_fraction = "
                f"{float(flux.fraction[-1]):.3g}, in a viscous fluid"
            )


def refuse_unsolved(mudline: Array, case: Case) -> None:
    """Refuses a result of a yielding bed whose equations were not solved; traced values pass.

    Raises:
      InputError: the mudline is NaN.
    """
    heights = value_or_none(mudline)
    if heights is not None and not np.isfinite(heights).all():
        raise InputError(
            f"compression = {case.compression}: the equations of the bed were not solved, as may "
            "happen where its stress is too small to hold it below bed_fraction; give a larger "
            "stress, or leave compression out for a rigid bed"
        )


def refuse_number(bound: Bound) -> None:
    """Refuses a number out of its bounds; a traced one passes unchecked.

    Raises:
      InputError: the value is out of its bounds, or is not one number.
    """
    name, value, _, unit = bound
    try:
        number = checks.numeric(value)
    except ValueError:
        number = np.zeros(2)  # refused below, because it is not one number
    if number is None and np.shape(value) == ():
        return
    if number is None or number.ndim:
        raise InputError(f"{name} = {shown(value)}: give one number, in {unit}")
    limit = _known_limit(bound.limit)
    if not number > 0.0 or not np.isfinite(number) or number >= limit:
        below = ""
        if math.isfinite(limit):
            below = f" and below {limit:.6g}" + (", bed_fraction" if limit < 1.0 else "")
        raise InputError(f"{name} = {float(number):.6g} must be above 0{below}, in {unit}")
    checks.positive(float(number), name, unit)


def _known_limit(limit: ArrayLike | None) -> float:
    """Returns the limit as a number; 1, the limit of every fraction, if it is traced."""
    if limit is None:
        return math.inf
    number = checks.numeric(limit)
    return 1.0 if number is None else float(number)


def refuse_times(times: Array | np.ndarray) -> None:
    """Refuses times that are no row of increasing numbers from 0; traced times pass unchecked.

    Raises:
      InputError: there is such a time; the message names the first.
    """
    if times.ndim != 1 or times.size == 0:
        raise InputError(f"times have shape {times.shape}; give one row of them in s, shape (T,)")
    numbers = value_or_none(times)
    if numbers is None:
        return
    for number, time in enumerate(numbers):
        if not 0.0 <= time < np.inf:
            raise InputError(f"times[{number}] = {time:.6g} must be at least 0 and finite, in s")
        if time != 0.0:
            checks.positive(time, f"times[{number}]", "s")
        if number > 0 and not time > numbers[number - 1]:
            raise InputError(
                f"times[{number}] = {time:.6g} s is not after {numbers[number - 1]:.6g} s; give "
                "increasing times"
            )
    if numbers[-1] == 0.0:
        raise InputError("times = [0]: nothing has settled at 0; give a later last time, in s")
