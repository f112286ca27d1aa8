"""A table of concentrations, at one height against time, or at one time against height.

    time (min),c (g/L)          height (cm),phi
    0,250                       1,0.31
    5,248                       2,0.24

They are converted to volume fractions of the particles without their coating.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from calibrate.experiment.readings import cells, concentrations, decimals, rows, vocabulary
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.columns import Column, refuse_several_samples
from calibrate.experiment.readings.concentrations import kind_of
from calibrate.experiment.readings.headings import RATIO_OF_SYMBOLS
from calibrate.experiment.readings.local_columns import FROM_ABOVE, LocalLayout, layout
from calibrate.experiment.readings.local_understood import LocalUnderstood
from calibrate.experiment.readings.points import with_date
from calibrate.experiment.readings.sheet import LocalColumnsSheet, LocalSheet
from calibrate.experiment.readings.table import (
    Row,
    Table,
    only_table,
    refuse_some_errors,
    refuse_wider,
)
from calibrate.experiment.readings.times import times
from calibrate.experiment.units import HEIGHT, HEIGHT_UNITS, LEVEL, RATIO_UNITS, TIME, TIME_UNITS
from mrjax import InputError
from mrjax.core.errors import shown

FEWEST = 2
"""Fewest readings of a table."""
STEP = 1e-6
"""Step of a concentration, over the largest one, for the slope that converts errors."""


class Written(NamedTuple):
    """One reading, as it is written."""

    row: Row
    axis: Cell
    value: Cell
    error: Cell | None


class Axis(NamedTuple):
    """Times or heights of readings, (N,)."""

    values: list[float]
    """Times, s, or heights, m."""
    unit: str
    """Unit for reports."""
    si: float
    """One unit in s or m."""
    form: str
    """Form in the file: a unit, `as hh:mm`, `as dates`."""


class LocalConcentration(NamedTuple):
    """One reading."""

    at: float
    """Time in s, or height in m."""
    value: float
    """Volume fraction of the uncoated particles; 1."""
    error: float
    """Its standard deviation; NaN if none is stated."""
    row: int
    """Number of the row in the file."""


class LocalConcentrations(NamedTuple):
    """A table of local concentrations, by time or height."""

    readings: list[LocalConcentration]
    axis: Axis
    unit: str
    """Unit of volume fractions in reports: `1` or `%`."""
    understood: LocalUnderstood


def read(
    sheet: LocalSheet,
    folder: Path,
    fraction: Callable[[str, float], float],
    height: float,
    thickness: float,
) -> LocalConcentrations:
    """Reads the concentrations of a file, and checks every number.

    Args:
      sheet: the file and its settings.
      folder: folder of the experiment file, to which paths are relative.
      fraction: function from a kind and a concentration to the volume fraction.
      height: height of the suspension, m.
      thickness: thickness of the layer that a reading averages over, m.

    Raises:
      InputError: the file, its header or a row cannot be used; the message has the line and the
        remedy.
    """
    table = only_table(
        rows.tables(sheet, folder),
        lambda table: bool(layout(table, sheet).rows),
        folder / sheet.file,
        "several sheets of concentrations",
        "no sheet with concentrations",
    )
    columns = layout(table, sheet)
    refuse_several_samples(table, columns.others, columns.rows)
    _refuse_other_places(table, columns, sheet)
    kind = _kind(columns, sheet)
    written, left_out = _written(table, columns)
    numbers = [cell for reading in written for cell in reading[1:] if isinstance(cell, Cell)]
    mark = decimals.decimal_mark(numbers, table.delimiter, sheet.decimal)
    axis = _axis(written, columns, sheet, mark, height)
    if min(axis.values) == max(axis.values):
        which = "height" if sheet.height is None else "time"
        raise InputError(f"{table.path}: has readings at one {which} alone; give a second")
    values = [_not_negative(reading.value, mark) for reading in written]
    errors = _errors(written, columns, sheet, kind, mark)
    step = STEP * (max(values) or 1.0)
    readings = []
    for reading, at, value, error in zip(written, axis.values, values, errors, strict=True):
        try:
            share = fraction(kind, value)
            lower = value - step if value > step else value + step
            slope = abs((fraction(kind, lower) - share) / step)
        except InputError as refusal:
            raise InputError(f"{reading.value.at}: {refusal}") from None
        readings.append(LocalConcentration(at, share, error * slope, reading.row.number))
    readings.sort(key=lambda reading: reading.at)
    unit = "%" if kind == "volume percent" else "1"
    understood = _understood(sheet, table, columns, readings, axis, kind, unit, thickness)
    marked = understood.read_as | ({"decimal": "decimal commas"} if mark == "," else {})
    understood = replace(understood, read_as=marked, left_out=tuple(left_out))
    return LocalConcentrations(readings, axis, unit, understood)


def _refuse_other_places(table: Table, columns: LocalLayout, sheet: LocalSheet) -> None:
    """Refuses rows of another height or time than the stated one, as another column shows.

    Nothing is refused if the columns are stated.
    """
    if sheet.columns != LocalColumnsSheet():
        return
    at_height = sheet.height is not None
    stated = sheet.height if at_height else (sheet.time or 0.0) * TIME_UNITS[sheet.time_unit or "s"]
    units, key = (HEIGHT, "height") if at_height else (TIME, "time")
    for column in columns.others:
        head = column.heading
        if column.role != key or head.words & vocabulary.INTERFACE:
            continue
        unit = None if head.words & FROM_ABOVE else units.named(head.unit)
        first = ""
        for row in columns.rows:
            cell = _cell(table.at(row), row, column)
            first = first or ("" if cells.is_missing(cell.text) else cell.text)
            number = cells.number(cell.text)
            differs = bool(number) and cell.text != first
            if number and unit:
                mark = "," if "," in number.written else "."
                value = cells.value(cell, number.written, mark) * units.units[unit]
                differs = differs or not math.isclose(value, stated or 0.0, rel_tol=1e-3)
            if differs:
                raise InputError(
                    f"{cell.at}: {column.named} = {shown(cell.text)} is not the stated {key}, or "
                    f"not that of the rows above; give each {key} a file or sheet of its own, or "
                    "state columns"
                )


def _kind(columns: LocalLayout, sheet: LocalSheet) -> str:
    """Kind of the concentrations, from the header or as stated."""
    kinds = {kind_of(column.heading.written) for column in columns.concentrations} - {None}
    if len(kinds) > 1:
        raise InputError(
            f"{columns.at}: columns of concentrations are of "
            f"{' and '.join(sorted(map(str, kinds)))}; state columns of one kind"
        )
    kind = kinds.pop() if kinds else None
    column = columns.concentrations[0].named
    return concentrations.kind_as_stated(kind, sheet.concentration, column, columns.at)


def _written(table: Table, columns: LocalLayout) -> tuple[list[Written], list[int]]:
    """The readings of a table, one for each repeat, and the numbers of rows without one."""
    readings: list[Written] = []
    left_out: list[int] = []
    date = ""
    for row in columns.rows:
        at = table.at(row)
        refuse_wider(at, row, columns.width)
        if columns.date:
            date = row.cell(columns.date.place) or date  # one cell for all rows of a day
        axis = with_date(_cell(at, row, columns.axis), date)
        values = [_cell(at, row, column) for column in columns.concentrations]
        values = [cell for cell in values if not cells.is_missing(cell.text)]
        if cells.is_missing(axis.text) or not values:
            left_out.append(row.number)
            continue
        error = _cell(at, row, columns.error) if columns.error else None
        error = None if error is None or cells.is_missing(error.text) else error
        readings += [Written(row, axis, cell, error) for cell in values]
    if len(readings) < FEWEST:
        raise InputError(
            f"{table.path}: has {len(readings)} rows of numbers; give at least {FEWEST} with a "
            f"{columns.axis.role} and a concentration"
        )
    return readings, left_out


def _cell(at: str, row: Row, column: Column) -> Cell:
    return Cell(at, column.role, row.cell(column.place))


def _axis(
    written: list[Written], columns: LocalLayout, sheet: LocalSheet, mark: str, height: float
) -> Axis:
    """The times or the heights of a table."""
    column = [reading.axis for reading in written]
    if sheet.height is None:
        return _heights(column, columns, sheet, mark, height)
    head = columns.axis.heading
    if columns.date is not None:
        head = head._replace(name="time of day")
    times_read = times(column, head, sheet, mark)
    form = times_read.form if times_read.form == times_read.unit else f"as {times_read.form}"
    return Axis(times_read.seconds, times_read.unit, TIME_UNITS[times_read.unit], form)


def _heights(
    column: list[Cell], columns: LocalLayout, sheet: LocalSheet, mark: str, height: float
) -> Axis:
    unit = _unit_of_heights(columns, sheet)
    si = HEIGHT_UNITS[unit] if unit in HEIGHT_UNITS else RATIO_UNITS[unit] * height
    heights = []
    for cell in column:
        number = cells.number(cell.text)
        if number is None:
            raise cells.not_a_number(cell)
        if number.unit and LEVEL.named(number.unit) != unit:
            raise cell.refuse(f"is not in {unit}, the unit of its column; mend one")
        value = cells.value(cell, number.written, mark)
        if not 0.0 <= value * si <= height * (1.0 + 1e-9):
            raise InputError(
                f"{cell.at}: height = {cell.text} is {value * si:.4g} m, not between the floor and "
                f"the height of the suspension, {height:g} m; mend the row, its unit or height"
            )
        heights.append(value * si)
    if unit in HEIGHT_UNITS:
        return Axis(heights, unit, si, unit)
    return Axis(heights, "m", 1.0, "as a ratio" if unit == "1" else f"in {unit}")


def _unit_of_heights(columns: LocalLayout, sheet: LocalSheet) -> str:
    """The unit of the heights: of the header, or as stated."""
    head, column = columns.axis.heading, shown(columns.axis.named)
    if head.words & FROM_ABOVE:
        raise InputError(
            f"{columns.at}: column {column} is measured from above; give heights from the floor"
        )
    unit = LEVEL.named(head.unit) if head.unit else None
    if RATIO_OF_SYMBOLS.fullmatch(head.written.casefold().strip()):
        unit = "1"
    elif head.unit and head.explicit and unit is None:
        raise InputError(
            f"{columns.at}: column {column} is in {shown(head.unit)}, which is no unit of a "
            f"height; give one of {', '.join(LEVEL.units)}, or state columns"
        )
    if unit and sheet.height_unit and unit != sheet.height_unit:
        raise InputError(
            f"{columns.at}: column {column} is in {unit}, and height_unit = "
            f"{shown(sheet.height_unit)} is stated; mend the header, or take height_unit away"
        )
    unit = unit or sheet.height_unit
    if unit is None:
        raise InputError(
            f"{columns.at}: column {column} has no unit; write it into the header, as in "
            f'"height (cm)", or give height_unit, one of {", ".join(LEVEL.units)}'
        )
    return unit


def _errors(
    written: list[Written], columns: LocalLayout, sheet: LocalSheet, kind: str, mark: str
) -> list[float]:
    """Standard deviations in the unit of the concentrations; NaN without one."""
    if columns.error is not None:
        kind_of_errors = kind_of(columns.error.heading.written)
        other = kind_of_errors is not None and not concentrations.alike(kind_of_errors, kind)
        if other or (columns.error.heading.unit == "%" and "percent" not in kind):
            raise InputError(
                f"{columns.at}: column {shown(columns.error.named)} is not in the unit of the "
                f"concentrations, {kind}; give errors in that"
            )
    stated = math.nan if sheet.standard_deviation is None else sheet.standard_deviation
    errors = [_number(reading.error, mark) if reading.error else stated for reading in written]
    for reading, error in zip(written, errors, strict=True):
        if error <= 0.0:
            raise InputError(
                f"{reading.value.at}: standard_deviation = {error:g} must be above zero; give the "
                "error of the reading"
            )
    refuse_some_errors(errors, [reading.value.at for reading in written])
    return errors


def _not_negative(cell: Cell, mark: str) -> float:
    value = _number(cell, mark)
    if value < 0.0:
        raise InputError(f"{cell.at}: concentration = {value:g} is negative; mend the row")
    return value


def _number(cell: Cell, mark: str) -> float:
    number = cells.number(cell.text)
    if number is None:
        raise cells.not_a_number(cell)
    if number.unit and number.unit != "%":
        raise cell.refuse("has a unit behind it; write it into the header")
    return cells.value(cell, number.written, mark)


def _understood(
    sheet: LocalSheet,
    table: Table,
    layout_of_file: LocalLayout,
    readings: list[LocalConcentration],
    axis: Axis,
    kind: str,
    unit: str,
    thickness: float,
) -> LocalUnderstood:
    """Record of how the file was read; its readings are in the order of the axis."""
    which = "time" if sheet.height is not None else "height"
    ends = [
        (reading.at / axis.si, reading.value / RATIO_UNITS[unit])
        for reading in readings[:: len(readings) - 1]
    ]
    errors = [reading.error / RATIO_UNITS[unit] for reading in readings]
    estimated = any(map(math.isnan, errors))
    names = [column for column in (layout_of_file.date, layout_of_file.axis) if column]
    return LocalUnderstood(
        file=sheet.file,
        read_as=table.facts,
        columns={
            which: " and ".join(shown(column.named) for column in names),
            "concentration": " and ".join(
                shown(column.named) for column in layout_of_file.concentrations
            ),
        },
        at=said_place(sheet),
        thickness=thickness,
        axis=which,
        axis_form=axis.form,
        axis_unit=axis.unit,
        concentration=kind,
        unit=unit,
        readings=len(readings),
        first=ends[0],
        last=ends[-1],
        errors="estimated" if estimated else "stated",
        standard_deviation=None if estimated else (min(errors), max(errors)),
        ignored_columns=tuple(column.named for column in layout_of_file.others),
        row_word=table.word,
    )


def said_place(sheet: LocalSheet) -> str:
    """The stated height or time in words."""
    if sheet.height is not None:
        return f"at height {sheet.height:g} m"
    return f"at time {sheet.time:g} {sheet.time_unit or 's'}"
