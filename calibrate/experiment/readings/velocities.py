"""A table of initial velocities by concentration, from cells to numbers with units.

    volume fraction,velocity (cm/s)
    0.054,0.256
    0.099,0.212

A flux is the volume of solids that settles through an area in a time: volume fraction times
velocity. It is divided by its volume fraction.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from calibrate.experiment.readings import cells, concentrations, decimals, rows
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.concentrations import kind_of
from calibrate.experiment.readings.sheet import VelocitiesSheet
from calibrate.experiment.readings.table import (
    Row,
    Table,
    only_table,
    refuse_some_errors,
    refuse_wider,
)
from calibrate.experiment.readings.velocity_columns import (
    VelocityColumn,
    VelocityLayout,
    layout,
    named_quantity,
)
from calibrate.experiment.readings.velocity_understood import VelocitiesUnderstood
from calibrate.experiment.velocity_units import EXAMPLES, VelocityUnit, velocity_unit
from mrjax import InputError
from mrjax.core.errors import shown

FEWEST = 2
"""Rows of a table."""


class Velocity(NamedTuple):
    """One row of a table, or one of its repeats."""

    concentration: float
    """As it is written."""
    volume_fraction: float
    """Volume fraction of the uncoated particles; 1."""
    value: float
    """The velocity, in the table's unit."""
    error: float
    """Its standard deviation in that unit; NaN where none is stated."""
    row: int
    """Number of the row in the file."""


class Velocities(NamedTuple):
    """A table of velocities; as many rows as there are readings, in the order of the file."""

    readings: list[Velocity]
    unit: VelocityUnit
    """Unit of the velocities, without the power of ten."""
    kind: str
    """Kind of the concentrations, one of `concentrations.KINDS`."""
    understood: VelocitiesUnderstood


def read(
    sheet: VelocitiesSheet, folder: Path, fraction: Callable[[str, float], float]
) -> Velocities:
    """The velocities of a file, every number checked.

    Args:
      sheet: the file, and what is stated of it.
      folder: that of the experiment file, from which paths are.
      fraction: the volume fraction of a concentration of a kind.

    Raises:
      InputError: the file, its header or a row cannot be used: the file, the line and the remedy.
    """
    table = only_table(
        rows.tables(sheet, folder),
        lambda one: bool(layout(one, sheet).rows),
        folder / sheet.file,
        "several sheets of velocities",
        "no sheet with concentration and velocity",
    )
    found = layout(table, sheet)
    kind = concentrations.kind_as_stated(
        kind_of(found.concentration.written),
        sheet.concentration,
        found.concentration.named,
        found.at,
    )
    unit, quantity = _unit(found, sheet), _quantity(found, sheet)
    mark = decimals.decimal_mark(_cells(table, found), table.delimiter, sheet.decimal)
    readings: list[Velocity] = []
    left_out: list[int] = []
    for row in found.rows:
        of_row = _of_row(table, row, found, mark)
        if not of_row:
            left_out.append(row.number)
        for concentration, value, own_error in of_row:
            try:
                share = fraction(kind, concentration)
            except InputError as refusal:
                raise InputError(f"{table.at(row)}: {refusal}") from None
            error = _error(own_error, value, found, sheet, unit)
            scale = unit.factor / (share if quantity == "flux" else 1.0)
            readings.append(
                Velocity(concentration, share, value * scale, error * scale, row.number)
            )
    if len(readings) < FEWEST:
        raise InputError(
            f"{table.path}: has {len(readings)} rows of numbers; give at least {FEWEST} with a "
            f"concentration and a {quantity}"
        )
    refuse_some_errors(
        [one.error for one in readings], [table.at(Row(one.row, [])) for one in readings]
    )
    told = _understood(sheet, table, found, readings, kind, unit, quantity, tuple(left_out), mark)
    return Velocities(readings, VelocityUnit(unit.name), kind, told)


def _unit(found: VelocityLayout, sheet: VelocitiesSheet) -> VelocityUnit:
    """The unit of the readings: of the header, or as stated."""
    column = found.readings[0]
    stated = velocity_unit(sheet.unit) if sheet.unit else None
    if column.unit and stated and column.unit != stated:
        raise _contradiction(found, column, f"in {column.unit.written}", "unit", sheet.unit)
    unit = column.unit or stated
    if unit is None:
        raise InputError(
            f"{found.at}: column {shown(column.named)} has no unit of a velocity; write it into "
            f'the header, as in "{column.role} (mm/s)", or give unit, such as {EXAMPLES}'
        )
    return unit


def _contradiction(
    found: VelocityLayout, column: VelocityColumn, said: str, key: str, stated: str | None
) -> InputError:
    """The error of a header that says another thing than the experiment file."""
    return InputError(
        f"{found.at}: column {shown(column.named)} is {said}, and {key} = {shown(stated)} is "
        f"stated; mend the header, or take {key} away"
    )


def _quantity(found: VelocityLayout, sheet: VelocitiesSheet) -> str:
    """`velocity` or `flux`, from the header or as stated."""
    column = found.readings[0]
    quantity = sheet.quantity or column.role or "velocity"
    named = named_quantity(column.written)
    if named and named != quantity:
        raise InputError(
            f"{found.at}: column {shown(column.named)} is a {named}, and {quantity} is stated; "
            "mend the header, or take that away"
        )
    return quantity


def _cells(table: Table, found: VelocityLayout) -> list[Cell]:
    """All cells that are read."""
    columns = [found.concentration, *found.readings, *([found.error] if found.error else [])]
    every = [_cell(table, row, column) for row in found.rows for column in columns]
    return [cell for cell in every if not cells.is_missing(cell.text)]


def _cell(table: Table, row: Row, column: VelocityColumn) -> Cell:
    return Cell(table.at(row), column.role or "concentration", row.cell(column.place))


def _of_row(
    table: Table, row: Row, found: VelocityLayout, mark: str
) -> list[tuple[float, float, float]]:
    """Concentration, reading and error, NaN without one, of each repeat; [] of a row without."""
    refuse_wider(table.at(row), row, found.width)
    concentration = _cell(table, row, found.concentration)
    readings = [_cell(table, row, one) for one in found.readings]
    readings = [one for one in readings if not cells.is_missing(one.text)]
    if cells.is_missing(concentration.text) or not readings:
        return []
    at = _number(concentration, mark)
    values = [_number(one, mark) for one in readings]
    if at == 0.0 and not any(values):
        return []  # a flux begins at nothing
    error = math.nan
    if found.error and not cells.is_missing(row.cell(found.error.place)):
        error = _above_zero(_cell(table, row, found.error), mark)
    at = _above_zero(concentration, mark)
    return [(at, _above_zero(one, mark), error) for one in readings]


def _error(
    own: float, value: float, found: VelocityLayout, sheet: VelocitiesSheet, unit: VelocityUnit
) -> float:
    """The standard deviation of a reading in its unit: that of its row, or as stated; else NaN."""
    if math.isnan(own):
        if sheet.relative_standard_deviation is not None:
            return sheet.relative_standard_deviation * value
        return math.nan if sheet.standard_deviation is None else sheet.standard_deviation
    column = found.error
    if column is not None and "%" in column.written:
        return own / 100.0 * value
    if column is not None and column.unit is not None:
        return own * (column.unit.factor * column.unit.si) / (unit.factor * unit.si)
    return own


def _number(cell: Cell, mark: str) -> float:
    number = cells.number(cell.text)
    if number is None:
        raise cells.not_a_number(cell)
    if number.unit and not (number.unit == "%" and cell.name == "concentration"):
        raise cell.refuse("has a unit behind it; write it into the header")
    return cells.value(cell, number.written, mark)


def _above_zero(cell: Cell, mark: str) -> float:
    value = _number(cell, mark)
    if value <= 0.0:
        raise InputError(f"{cell.at}: {cell.name} = {value:g} must be above zero; mend the row")
    return value


def _understood(
    sheet: VelocitiesSheet,
    table: Table,
    found: VelocityLayout,
    readings: list[Velocity],
    kind: str,
    unit: VelocityUnit,
    quantity: str,
    left_out: tuple[int, ...],
    mark: str,
) -> VelocitiesUnderstood:
    """Record of how the file was read."""
    errors = [one.error for one in readings]
    return VelocitiesUnderstood(
        file=sheet.file,
        read_as=table.facts | ({"decimal": "decimal commas"} if mark == "," else {}),
        columns={
            "concentration": shown(found.concentration.named),
            quantity: " and ".join(shown(one.named) for one in found.readings),
        },
        quantity=quantity,
        concentration=kind,
        unit=unit.written,
        readings=len(readings),
        first=concentrations.said(kind, readings[0].concentration),
        last=concentrations.said(kind, readings[-1].concentration),
        velocities=(readings[0].value, readings[-1].value),
        velocity_unit=unit.name,
        errors="estimated" if any(map(math.isnan, errors)) else "stated",
        standard_deviation=None if any(map(math.isnan, errors)) else (min(errors), max(errors)),
        ignored_columns=tuple(one.named for one in found.others),
        left_out=left_out,
        row_word=table.word,
    )
