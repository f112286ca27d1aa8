"""Readings of a curve as numbers in one unit: mudlines or sedimentation ratios."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from calibrate.experiment.readings import cells, vocabulary
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.columns import Column, Layout
from calibrate.experiment.readings.points import Point
from calibrate.experiment.readings.sheet import CurveSheet
from calibrate.experiment.readings.table import refuse_some_errors
from calibrate.experiment.units import (
    HEIGHT_UNITS,
    RATIO_UNITS,
    READINGS,
    VOLUME_UNITS,
)
from mrjax import InputError
from mrjax.core.errors import shown


class Tube(NamedTuple):
    """Dimensions of a tube, which convert readings."""

    height: float | None
    """Height of the suspension, m; None if unknown."""
    diameter: float | None
    """Inner diameter, m; None if unknown."""


class Values(NamedTuple):
    """Readings of a curve, (T,) each."""

    observable: str
    """`mudline` or `sedimentation_ratio`."""
    values: list[float]
    """Readings in the unit, from the floor of the tube."""
    errors: list[float]
    """Standard deviations in the unit; NaN for a reading without one."""
    unit: str
    si: float
    """The unit in metres of height, or as a ratio."""


def values(
    points: Sequence[Point], layout: Layout, sheet: CurveSheet, tube: Tube, mark: str
) -> Values:
    """The readings of a table as heights or ratios.

    Args:
      points: readings as they are written.
      layout: the columns.
      sheet: settings of the file.
      tube: its dimensions.
      mark: decimal mark.

    Raises:
      InputError: no unit, two units, a unit of something else, a cell that is no number, an error
        that is not above zero, or a tube whose height or diameter is needed.
    """
    role = layout.readings[0].role
    unit = _unit(points, layout, sheet)
    full_height, si = _whole_and_si(role, unit, tube, points[0].reading)
    numbers = [_number(point.reading, unit, mark) for point in points]
    for point, number in zip(points, numbers, strict=True):
        if number < 0.0 and role != "supernatant":
            raise InputError(f"{point.reading.at}: {role} = {number:g} is negative; mend the row")
    if role == "supernatant":
        numbers = [full_height - number for number in numbers]
    observable = "sedimentation_ratio" if unit in RATIO_UNITS else "mudline"
    return Values(observable, numbers, _errors(points, layout, sheet, unit, mark), unit, si)


def _whole_and_si(role: str, unit: str, tube: Tube, first: Cell) -> tuple[float, float]:
    """The suspension's height in a unit, NaN if not needed, and the unit in m or as a ratio."""
    if unit in RATIO_UNITS:
        return 1.0 / RATIO_UNITS[unit], RATIO_UNITS[unit]
    si = HEIGHT_UNITS.get(unit)
    if si is None:
        if tube.diameter is None:
            raise InputError(
                f"{first.at}: {role} = {first.text} is a volume, in {unit}; give the sample's "
                "tube_diameter in m, or heights"
            )
        si = VOLUME_UNITS[unit] / (math.pi / 4.0 * tube.diameter**2)
    if role == "supernatant" and tube.height is None:
        raise InputError(f"{first.at}: supernatant needs the height of the suspension, in m")
    return (tube.height or math.nan) / si, si


def _unit(points: Sequence[Point], layout: Layout, sheet: CurveSheet) -> str:
    """The unit of all readings: from the header, the settings, or behind the numbers."""
    column, at = layout.readings[0], points[0].reading.at.rsplit(", ", 1)[0]
    units = {_header_unit(column, at) for column in layout.readings} - {None}
    if len(units) > 1:
        raise InputError(
            f"{at}: its columns of readings have units {' and '.join(sorted(map(str, units)))}; "
            "give one unit, or state columns"
        )
    unit = units.pop() if units else None
    if unit and sheet.unit and unit != sheet.unit:
        raise InputError(
            f"{at}: the header gives the readings in {unit}, and unit = {shown(sheet.unit)} is "
            "stated; mend the header, or take unit away"
        )
    unit = unit or sheet.unit
    for point in points:
        number = cells.number(point.reading.text)
        if number is not None and number.unit:
            unit_of_cell = READINGS.named(number.unit)
            unit = unit or unit_of_cell
            if unit_of_cell != unit:
                raise point.reading.refuse(
                    f"is in {unit_of_cell}, and its column in {unit}; mend one"
                )
    if unit is None and column.role == "sedimentation_ratio":
        # Numbers are ratios; percents without a unit are above the height, and are refused.
        unit = "%" if column.heading.words & vocabulary.PERCENT else "1"
    if unit is None:
        raise InputError(
            f"{at}: its readings have no unit; write it into the header, as in "
            f'"{column.role} (mm)", or give unit, one of {", ".join(READINGS.units)}'
        )
    if column.role == "sedimentation_ratio" and unit not in RATIO_UNITS:
        raise InputError(
            f"{at}: unit = {unit!r} is none of a sedimentation_ratio; give one of "
            f"{', '.join(RATIO_UNITS)}"
        )
    return unit


def _header_unit(column: Column, at: str) -> str | None:
    """The unit in the header of a column; None if it has none."""
    word = column.heading.unit
    unit = READINGS.named(word)
    if word and unit is None and column.heading.explicit:
        raise InputError(
            f"{at}: column {shown(column.named)} is in {shown(word)}, which is no unit of a "
            f"mudline; give one of {', '.join(READINGS.units)}, or state columns"
        )
    return unit


def _number(cell: Cell, unit: str, mark: str) -> float:
    """A reading or an error in its column's unit."""
    number = cells.number(cell.text)
    if number is None:
        raise cells.not_a_number(cell)
    if number.unit and READINGS.named(number.unit) != unit:
        raise cell.refuse(f"is not in {unit}, the unit of its column; mend one")
    return cells.value(cell, number.written, mark)


def _errors(
    points: Sequence[Point], layout: Layout, sheet: CurveSheet, unit: str, mark: str
) -> list[float]:
    """Standard deviations in the unit of the readings; NaN without one."""
    unit_of_errors, factor = unit, 1.0
    if layout.errors and layout.errors[0].heading.unit:
        unit_of_errors = _header_unit(layout.errors[0], points[0].reading.at) or unit
        factor = _factor(unit_of_errors, unit, layout.errors[0].named, points[0].reading.at)
    stated = math.nan if sheet.standard_deviation is None else sheet.standard_deviation
    errors = []
    for point in points:
        error = factor * _number(point.error, unit_of_errors, mark) if point.error else stated
        if error <= 0:
            raise InputError(
                f"{point.reading.at}: standard_deviation = {error:g} must be above zero; give the "
                "error of the reading"
            )
        errors.append(error)
    refuse_some_errors(errors, [point.reading.at for point in points])
    return errors


def _factor(unit_of_errors: str, unit: str, named: str, at: str) -> float:
    """Factor from the unit of the errors to that of the readings."""
    for units in (HEIGHT_UNITS, VOLUME_UNITS, RATIO_UNITS):
        if unit_of_errors in units and unit in units:
            return units[unit_of_errors] / units[unit]
    raise InputError(
        f"{at}: column {shown(named)} is in {unit_of_errors}, and the readings in {unit}; give "
        "errors in that"
    )
