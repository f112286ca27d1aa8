"""A table of initial velocities against concentration, from cells to numbers with units.

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
"""Fewest readings of a table."""


class Velocity(NamedTuple):
    """One row of a table, or one of its repeats."""

    concentration: float
    """Concentration, as it is written."""
    volume_fraction: float
    """Volume fraction of the uncoated particles; 1."""
    value: float
    """The velocity, in the table's unit."""
    error: float
    """Its standard deviation in that unit; NaN if none is stated."""
    row: int
    """Number of the row in the file."""


class Velocities(NamedTuple):
    """A table of velocities, in the order of the file."""

    readings: list[Velocity]
    unit: VelocityUnit
    """Unit of the velocities, without the power of ten."""
    kind: str
    """Kind of the concentrations, one of `concentrations.KINDS`."""
    understood: VelocitiesUnderstood


def read(
    sheet: VelocitiesSheet, folder: Path, fraction: Callable[[str, float], float]
) -> Velocities:
    """Reads the velocities of a file, and checks every number.

    Args:
      sheet: the file and its settings.
      folder: folder of the experiment file, to which paths are relative.
      fraction: function from a kind and a concentration to the volume fraction.

    Raises:
      InputError: the file, its header or a row cannot be used; the message has the line and the
        remedy.
    """
    table = only_table(
        rows.tables(sheet, folder),
        lambda table: bool(layout(table, sheet).rows),
        folder / sheet.file,
        "several sheets of velocities",
        "no sheet with concentration and velocity",
    )
    columns = layout(table, sheet)
    kind = concentrations.kind_as_stated(
        kind_of(columns.concentration.written),
        sheet.concentration,
        columns.concentration.named,
        columns.at,
    )
    unit, quantity = _unit(columns, sheet), _quantity(columns, sheet)
    mark = decimals.decimal_mark(_cells(table, columns), table.delimiter, sheet.decimal)
    readings: list[Velocity] = []
    left_out: list[int] = []
    for row in columns.rows:
        of_row = _row_readings(table, row, columns, mark)
        if not of_row:
            left_out.append(row.number)
        for concentration, value, own_error in of_row:
            try:
                share = fraction(kind, concentration)
            except InputError as refusal:
                raise InputError(f"{table.at(row)}: {refusal}") from None
            error = _error(own_error, value, columns, sheet, unit)
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
        [reading.error for reading in readings],
        [table.at(Row(reading.row, [])) for reading in readings],
    )
    understood = _understood(
        sheet, table, columns, readings, kind, unit, quantity, tuple(left_out), mark
    )
    return Velocities(readings, VelocityUnit(unit.name), kind, understood)


def _unit(columns: VelocityLayout, sheet: VelocitiesSheet) -> VelocityUnit:
    """The unit of the readings: of the header, or as stated."""
    column = columns.readings[0]
    stated = velocity_unit(sheet.unit) if sheet.unit else None
    if column.unit and stated and column.unit != stated:
        raise _contradiction(columns, column, f"in {column.unit.written}", "unit", sheet.unit)
    unit = column.unit or stated
    if unit is None:
        raise InputError(
            f"{columns.at}: column {shown(column.named)} has no unit of a velocity; write it into "
            f'the header, as in "{column.role} (mm/s)", or give unit, such as {EXAMPLES}'
        )
    return unit


def _contradiction(
    columns: VelocityLayout, column: VelocityColumn, header_says: str, key: str, stated: str | None
) -> InputError:
    """The error of a header that contradicts the experiment file."""
    return InputError(
        f"{columns.at}: column {shown(column.named)} is {header_says}, and {key} = "
        f"{shown(stated)} is stated; mend the header, or take {key} away"
    )


def _quantity(columns: VelocityLayout, sheet: VelocitiesSheet) -> str:
    """`velocity` or `flux`, from the header or as stated."""
    column = columns.readings[0]
    quantity = sheet.quantity or column.role or "velocity"
    named = named_quantity(column.written)
    if named and named != quantity:
        raise InputError(
            f"{columns.at}: column {shown(column.named)} is a {named}, and {quantity} is stated; "
            "mend the header, or take that away"
        )
    return quantity


def _cells(table: Table, layout_of_file: VelocityLayout) -> list[Cell]:
    """All cells that are read."""
    columns = [
        layout_of_file.concentration,
        *layout_of_file.readings,
        *([layout_of_file.error] if layout_of_file.error else []),
    ]
    found_cells = [_cell(table, row, column) for row in layout_of_file.rows for column in columns]
    return [cell for cell in found_cells if not cells.is_missing(cell.text)]


def _cell(table: Table, row: Row, column: VelocityColumn) -> Cell:
    return Cell(table.at(row), column.role or "concentration", row.cell(column.place))


def _row_readings(
    table: Table, row: Row, columns: VelocityLayout, mark: str
) -> list[tuple[float, float, float]]:
    """Concentration, reading and error (or NaN) of each repeat; empty for a row without any."""
    refuse_wider(table.at(row), row, columns.width)
    concentration = _cell(table, row, columns.concentration)
    readings = [_cell(table, row, column) for column in columns.readings]
    readings = [reading for reading in readings if not cells.is_missing(reading.text)]
    if cells.is_missing(concentration.text) or not readings:
        return []
    number = _number(concentration, mark)
    values = [_number(reading, mark) for reading in readings]
    if number == 0.0 and not any(values):
        return []  # the flux without particles
    error = math.nan
    if columns.error and not cells.is_missing(row.cell(columns.error.place)):
        error = _positive_number(_cell(table, row, columns.error), mark)
    number = _positive_number(concentration, mark)
    return [(number, _positive_number(reading, mark), error) for reading in readings]


def _error(
    error_of_row: float,
    value: float,
    columns: VelocityLayout,
    sheet: VelocitiesSheet,
    unit: VelocityUnit,
) -> float:
    """The standard deviation of a reading in its unit: that of its row, or as stated; else NaN."""
    if math.isnan(error_of_row):
        if sheet.relative_standard_deviation is not None:
            return sheet.relative_standard_deviation * value
        return math.nan if sheet.standard_deviation is None else sheet.standard_deviation
    column = columns.error
    if column is not None and "%" in column.written:
        return error_of_row / 100.0 * value
    if column is not None and column.unit is not None:
        return error_of_row * (column.unit.factor * column.unit.si) / (unit.factor * unit.si)
    return error_of_row


def _number(cell: Cell, mark: str) -> float:
    number = cells.number(cell.text)
    if number is None:
        raise cells.not_a_number(cell)
    if number.unit and not (number.unit == "%" and cell.name == "concentration"):
        raise cell.refuse("has a unit behind it; write it into the header")
    return cells.value(cell, number.written, mark)


def _positive_number(cell: Cell, mark: str) -> float:
    value = _number(cell, mark)
    if value <= 0.0:
        raise InputError(f"{cell.at}: {cell.name} = {value:g} must be above zero; mend the row")
    return value


def _understood(
    sheet: VelocitiesSheet,
    table: Table,
    layout_of_file: VelocityLayout,
    readings: list[Velocity],
    kind: str,
    unit: VelocityUnit,
    quantity: str,
    left_out: tuple[int, ...],
    mark: str,
) -> VelocitiesUnderstood:
    """Record of how the file was read."""
    errors = [reading.error for reading in readings]
    return VelocitiesUnderstood(
        file=sheet.file,
        read_as=table.facts | ({"decimal": "decimal commas"} if mark == "," else {}),
        columns={
            "concentration": shown(layout_of_file.concentration.named),
            quantity: " and ".join(shown(column.named) for column in layout_of_file.readings),
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
        ignored_columns=tuple(column.named for column in layout_of_file.others),
        left_out=left_out,
        row_word=table.word,
    )
