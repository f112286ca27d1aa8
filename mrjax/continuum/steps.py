"""The number of steps of a settling column, from the speed of its fastest front."""

import math

import jax
import numpy as np
from jax import Array

from mrjax.continuum import column_checks, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.scheme import REACH, fastest_front, until_rest
from mrjax.core.errors import InputError
from mrjax.core.tracing import drop_tracers, evaluated_or_none

COURANT_SHARE = 0.95
"""Part of `REACH` that the fastest front crosses in a step of the chosen number."""
MOST_STEPS = 10**8


def fewest_steps(case: Case, cells: int) -> float | None:
    """Returns the least number of steps in which no front crosses more than half a cell.

    It is None for traced values.

    Raises:
      InputError: the particles do not settle at every volume fraction.
    """
    evaluated = evaluated_or_none(lambda case: (*_speeds(case), case), drop_tracers(case))
    if evaluated is None:
        return None
    flux, speed, last, numbers = evaluated
    column_checks.refuse_not_settling(flux)
    return float(speed) * float(last) / float(np.ravel(numbers.height)[-1]) * cells / REACH


def chosen_steps(fewest: float | None) -> int:
    """Returns the least number of steps with a margin, rounded up to four binary digits.

    Raises:
      InputError: the least number is None, or larger than `MOST_STEPS`.
    """
    if fewest is None:
        raise InputError(
            "an argument is traced by jit or vmap, so column cannot choose its steps; give "
            "steps=mrjax.column_steps(...), computed outside from plain numbers"
        )
    steps = max(1.0, fewest / COURANT_SHARE)
    if steps > MOST_STEPS:
        raise InputError(
            f"times up to the last take {steps:.3g} steps, more than {MOST_STEPS}; give an earlier "
            "last time, fewer cells, or a volume_fraction further from bed_fraction"
        )
    digit = 2 ** max(0, math.frexp(steps)[1] - 4)
    return math.ceil(steps / digit) * digit


@jax.jit
def _speeds(case: Case) -> tuple[kynch.Table, Array, Array]:
    """Returns the flux, m/s, the speed of the fastest front, m/s, and the last time, s."""
    case, _ = case.sinking()
    flux = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    return flux, fastest_front(case, flux), until_rest(case, flux)[-1]
