"""The readings of a table: the cells of their times, values and errors."""

from typing import NamedTuple

from calibrate.experiment.readings import cells
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.columns import Column, Layout
from calibrate.experiment.readings.dates import is_clock, is_clock_or_date, is_date
from calibrate.experiment.readings.table import Row, Table, refuse_wider
from calibrate.experiment.units import READINGS, TIME
from mrjax import InputError


class Point(NamedTuple):
    """One reading, as it is written."""

    row: Row
    time: Cell
    reading: Cell
    error: Cell | None
    """None if no column has its error, or the cell is empty."""


class Points(NamedTuple):
    """All readings, and rows without one."""

    points: list[Point]
    left_out: list[int]
    """Numbers of rows with an empty time or without any reading."""


def points(table: Table, layout: Layout, date_format: str | None = None) -> Points:
    """The readings of a table; a row has one for each of its repeats.

    Args:
      table: rows of the file.
      layout: the columns.
      date_format: stated format of the times, which may be an unusual one.

    Raises:
      InputError: a row of more cells than the header, fewer than two readings, or a row without a
        reading that holds no time either.
    """
    readings: list[Point] = []
    left_out: list[int] = []
    date = ""
    for row in layout.rows:
        at = table.at(row)
        refuse_wider(at, row, layout.width)
        if layout.date:
            date = row.cell(layout.date.place) or date  # one cell for all rows of a day
        time = with_date(_cell(at, row, layout.time), date)
        filled = [
            column for column in layout.readings if not cells.is_missing(row.cell(column.place))
        ]
        if not date_format and not cells.is_missing(time.text) and not _is_time(time.text):
            raise time.refuse(
                "is not a finite number, nor a time such as 01:30 or a date such as 2024-01-31; "
                "mend the row, or begin it with # if it is a comment"
            )
        if not filled or cells.is_missing(time.text):
            left_out.append(row.number)
            continue
        readings += [
            Point(row, time, _reading(at, row, column), _error(at, row, column, layout))
            for column in filled
        ]
    if len(readings) < 2:
        raise InputError(
            f"{table.path}: has {len(readings)} rows of numbers; give at least 2 with a time and a "
            "reading"
        )
    return Points(readings, left_out)


def _is_time(text: str) -> bool:
    number = cells.number(text)
    is_number = number is not None and (not number.unit or TIME.named(number.unit) is not None)
    return is_number or is_clock_or_date(text)


def _cell(at: str, row: Row, column: Column) -> Cell:
    return Cell(at, column.role, row.cell(column.place))


def _reading(at: str, row: Row, column: Column) -> Cell:
    """The cell of a reading: a number, alone or with a unit."""
    cell = _cell(at, row, column)
    number = cells.number(cell.text)
    if number is None or (number.unit and READINGS.named(number.unit) is None):
        raise cells.not_a_number(cell)
    return cell


def _error(at: str, row: Row, reading: Column, layout: Layout) -> Cell | None:
    """The cell of the error of a reading; None if there is none."""
    if not layout.errors:
        return None
    place = layout.readings.index(reading) if len(layout.errors) > 1 else 0
    cell = _cell(at, row, layout.errors[place])
    return None if cells.is_missing(cell.text) else cell


def with_date(time: Cell, date: str) -> Cell:
    """The time of a row with its date or day in front, if these have a column of their own.

    Args:
      time: cell of the time.
      date: text of the date or number of the day, "" without one.
    """
    if not date or not is_clock(time.text):
        return time
    if cells.number(date) is not None and not is_date(date):
        return time._replace(text=f"{date.removesuffix('.0')}d {time.text}")
    day = date.split(" ")[0] if " 00:00" in date else date
    return time._replace(text=f"{day} {time.text}")
