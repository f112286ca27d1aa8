"""A file as rows of cells, each with its number in the file."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from mrjax import InputError
from mrjax.core.errors import shown

MOST_CELLS = 1000
"""Most columns of a row of readings."""


class Row(NamedTuple):
    """Cells of a row, without blanks around them."""

    number: int
    """Number in the file, from 1."""
    cells: list[str]

    def cell(self, column: int) -> str:
        """The text of a column, "" where the row is shorter."""
        return self.cells[column] if column < len(self.cells) else ""

    @property
    def width(self) -> int:
        """Number of columns up to the last that is not empty."""
        return max((place for place, cell in enumerate(self.cells, 1) if cell), default=0)


class Table(NamedTuple):
    """Rows of a file that are neither empty nor a comment."""

    path: str
    """File and sheet, for messages."""
    word: str
    """Word for a row: `line` of a text, `row` of a workbook."""
    rows: list[Row]
    last_comment: Row | None
    """The last comment before the first row, which may be the header."""
    facts: dict[str, str]
    """Encoding and delimiter, or sheet, by which it was read."""
    delimiter: str = ""
    """Character between columns; "" of a workbook."""

    def at(self, row: Row) -> str:
        """The place of a row, for messages."""
        return f"{self.path}, {self.word} {row.number}"


def only_table(
    tables: list[Table], has_readings: Callable[[Table], bool], path: Path, several: str, none: str
) -> Table:
    """The one table of a file that has readings.

    Args:
      tables: tables of the file, at least one.
      has_readings: function that is true for a table with readings; for others it may raise
        InputError.
      path: path of the file, for messages.
      several, none: words of the message if several tables have readings, or none.

    Raises:
      InputError: there are several tables, and none or more than one of them has readings.
    """
    if len(tables) == 1:
        return tables[0]
    readable = [table for table in tables if _is_readable(has_readings, table)]
    if len(readable) == 1:
        return readable[0]
    names = ", ".join(shown(table.facts["sheet"]) for table in (readable or tables)[:4])
    fault = several if readable else none
    raise InputError(f"{path}: has {fault}: {names}; state sheet, or give each its header")


def _is_readable(has_readings: Callable[[Table], bool], table: Table) -> bool:
    try:
        return has_readings(table)
    except InputError:
        return False


def refuse_wider(at: str, row: Row, width: int) -> None:
    """Refuses a row of more cells than there are columns.

    Raises:
      InputError: it has more; the message has its place and the remedy.
    """
    if row.width > width:
        raise InputError(
            f"{at}: has {row.width} cells for {width} columns; write decimals with a point, or "
            "separate columns by semicolons"
        )


def refuse_some_errors(errors: Sequence[float], places: Sequence[str]) -> None:
    """Refuses standard deviations that only some rows have; NaN stands for none.

    Args:
      errors: standard deviations of the readings.
      places: places of their rows, for messages.

    Raises:
      InputError: some are missing; the message has the first row without one.
    """
    without = [at for error, at in zip(errors, places, strict=True) if math.isnan(error)]
    if without and len(without) < len(errors):
        raise InputError(
            f"{without[0]}: has no standard_deviation, and other rows have; give it, or one for "
            "all in the experiment file"
        )


def refuse_wide(at: str, cells: int, columns: int) -> None:
    """Refuses a row of more columns than any curve has."""
    if cells > MOST_CELLS:
        raise InputError(
            f"{at}: has {cells} cells for {columns} columns; separate columns by one delimiter and "
            "write decimals with a point"
        )
