"""A file as rows of cells, each with its number in the file."""

from typing import NamedTuple

from mrjax import InputError

MOST_CELLS = 1000
"""Columns beyond which a row is none of a curve."""


class Row(NamedTuple):
    """Cells of a row, without blanks around them."""

    number: int
    """In the file, from 1."""
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
    """File and sheet, as messages name them."""
    word: str
    """What a row is called: `line` of a text, `row` of a workbook."""
    rows: list[Row]
    last_comment: Row | None
    """The last comment before the first row, which may be the header."""
    facts: dict[str, str]
    """How it was read: encoding and delimiter, or sheet."""
    delimiter: str = ""
    """Character between columns; "" of a workbook."""

    def at(self, row: Row) -> str:
        """The place of a row, as messages name it."""
        return f"{self.path}, {self.word} {row.number}"


def refuse_wide(at: str, cells: int, columns: int) -> None:
    """Refuses a row of more columns than any curve has."""
    if cells > MOST_CELLS:
        raise InputError(
            f"{at}: has {cells} cells for {columns} columns; separate columns by one delimiter and "
            "write decimals with a point"
        )
