"""The number of steps of a settling column, which follows the speed of its fastest front."""

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
STEPS_PER_CELL = 2
"""Steps for each cell of a yielding bed: the errors by steps and by cells are then alike."""
FEWEST_IMPLICIT = 10
"""Least number of steps with a yielding bed."""


def fewest_steps(case: Case, cells: int) -> float | None:
    """Returns the least number of steps in which no front crosses more than half a cell.

    It is None for traced values. With a yielding bed, steps are implicit, and fronts may cross many
    cells.

    Raises:
      InputError: the particles do not settle at every volume fraction, or above a yielding bed some
        fall faster than in a thinner suspension.
    """
    evaluated = evaluated_or_none(lambda case: (*_speeds(case), case), drop_tracers(case))
    if evaluated is not None:
        column_checks.refuse_not_settling(evaluated[0])
    if case.compression is not None:
        if evaluated is not None:
            column_checks.refuse_faster_if_denser(evaluated[0])
        return FEWEST_IMPLICIT
    if evaluated is None:
        return None
    if case.rotor is not None:
        column_checks.refuse_faster_if_denser(evaluated[0], "in a rotor")
    _, speed, last, numbers = evaluated
    return float(speed) * float(last) / float(np.ravel(numbers.height)[-1]) * cells / REACH


def chosen_steps(case: Case, cells: int, fewest: float | None) -> int:
    """Returns the least number of steps with a margin, rounded up to four binary digits.

    With a yielding bed it follows from the number of cells.

    Raises:
      InputError: the least number is None, or larger than `MOST_STEPS`.
    """
    if case.compression is not None:
        return max(FEWEST_IMPLICIT, STEPS_PER_CELL * cells)
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
    return (
        flux,
        fastest_front(case, flux),
        until_rest(case, flux)[-1],
    )
