"""Checks of the arguments of a polydisperse column.

Concrete arguments are refused with a message; for traced arguments a flag is computed, which marks
the result as invalid.
"""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.continuum import column_checks
from mrjax.continuum.case import Case
from mrjax.continuum.column_checks import Bound
from mrjax.continuum.sizes.masliyah import Classes
from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import drop_tracers, evaluated_or_none

ROUNDING = 16.0
"""Increase of a hindered velocity that counts as rounding, in units of the last digit."""


def refuse(case: Case, threshold: ArrayLike) -> None:
    """Refuses arguments that do not describe a polydisperse column; traced values pass unchecked.

    Raises:
      InputError: there is such an argument; the message names the first.
    """
    checks.require_class(Parameters, parameters=case.parameters)
    _refuse_fractions(case.volume_fraction)
    classes = np.shape(case.volume_fraction)[0]
    checks.refuse_bad_parameters(case.parameters, classes, None, contacts=False)
    if case.parameters.yield_growth is not None:
        raise InputError(
            f"yield_growth = {shown(case.parameters.yield_growth)}: classes of several sizes stop "
            "at different times in a carrier that ages; leave out yield_growth, or give one size"
        )
    total = jnp.sum(jnp.asarray(case.volume_fraction, float))
    for bound in (
        Bound("height", case.height, None, "m"),
        Bound("bed_fraction", case.bed_fraction, 1.0, "1"),
        Bound("the sum of volume_fraction", total, case.bed_fraction, "1"),
        Bound("threshold", threshold, 1.0, "1"),
    ):
        column_checks.refuse_number(bound)
    column_checks.refuse_tilt(case.tilt)
    column_checks.refuse_times(case.times)


def refuse_not_settling(case: Case, law: Classes, node: Array) -> None:
    """Refuses classes of which some sink and some rise, and closures that do not hinder.

    Args:
      case: the arguments.
      law: the classes, of particles that sink.
      node: volume fractions from 0 to that of the bed, (N,).

    Raises:
      InputError: there are such classes, or there is such a closure.
    """
    evaluated = evaluated_or_none(
        lambda law, node: (law.lone_velocity, _inverse(law, node)), *drop_tracers((law, node))
    )
    if evaluated is None:
        return
    lone, inverse = evaluated
    if not (np.isfinite(lone) & (lone >= 0.0)).all():
        number = int(np.argmin(np.where(np.isfinite(lone), lone, -np.inf)))
        raise InputError(
            f"class {number} settles at {lone[number]:.3g} m/s and others the other way; give "
            "classes that all sink or all rise, in a viscous fluid"
        )
    if not (np.isfinite(inverse) & (inverse >= 0.0)).all() or not _hinders(inverse):
        raise InputError(
            "f_w is not positive, or falls with the volume fraction; give a hindrance that grows "
            f"up to bed_fraction = {float(np.asarray(drop_tracers(case.bed_fraction))):.3g}"
        )


def possible(case: Case, threshold: Array, law: Classes, node: Array) -> Array:
    """True, (), if the arguments would not be refused; traceable."""
    fractions, densest, times = jnp.asarray(case.volume_fraction), case.bed_fraction, case.times
    total, lone, inverse = jnp.sum(fractions), law.lone_velocity, _inverse(law, node)
    within = (total > 0.0) & (total < densest) & (densest < 1.0) & jnp.all(fractions >= 0.0)
    within = within & (case.height > 0.0) & (threshold > 0.0) & (threshold < 1.0)
    ascending = jnp.all(jnp.diff(times) > 0.0) & (times[0] >= 0.0) & (times[-1] > 0.0)
    settles = jnp.all(jnp.isfinite(lone) & (lone >= 0.0))
    hinders = jnp.all(jnp.isfinite(inverse) & (inverse >= 0.0)) & _hinders(inverse)
    return within & ascending & settles & hinders & column_checks.tilt_possible(case.tilt)


def _inverse(law: Classes, node: Array) -> Array:
    """1 / f_w at volume fractions, (N,)."""
    return law.factor(node, node[-1]) * (1.0 - node) ** 2


def _hinders(inverse: Array) -> Array:
    """True, (), if 1/f_w does not grow with the volume fraction."""
    return jnp.all(jnp.diff(inverse) <= ROUNDING * jnp.finfo(inverse.dtype).eps * inverse[0])


def _refuse_fractions(value: ArrayLike) -> None:
    """Refuses volume fractions that are no row of numbers from 0; traced ones by their shape.

    Raises:
      InputError: there is such a value.
    """
    try:
        numbers = checks.numeric(value)
    except ValueError:
        numbers = np.zeros(())
    shape = np.shape(value) if numbers is None else numbers.shape
    if len(shape) != 1 or shape[0] == 0:
        raise InputError(
            f"volume_fraction = {shown(value)}: give one number for each class, shape (K,)"
        )
    if numbers is not None and not (np.isfinite(numbers) & (numbers >= 0.0)).all():
        raise InputError(f"volume_fraction = {shown(value)}: every one must be at least 0")
