"""The header of a table that holds concentrations, which may be the last comment above it."""

from collections.abc import Callable

from calibrate.experiment.readings import cells
from calibrate.experiment.readings.columns import LOOKED_AT
from calibrate.experiment.readings.rows import is_numbers
from calibrate.experiment.readings.table import Row, Table


def header(table: Table, accepts: Callable[[Row], bool]) -> tuple[Row | None, list[Row]]:
    """The header with the units of a row below it, and the rows of readings.

    Args:
      table: rows of the file.
      accepts: function that is true for a row with the names of the needed columns.

    Returns:
      the header, None where the table begins with numbers, and the rows below it.
    """
    beginning = table.rows[:LOOKED_AT]
    for place, row in enumerate(beginning):
        if not is_numbers(row) and accepts(row):
            below = table.rows[place + 1 :]
            return (_with_units(row, below[0]), below[1:]) if _is_units(below) else (row, below)
    first = next((place for place, row in enumerate(beginning) if is_numbers(row)), None)
    if first is None:
        return (table.rows[0] if table.rows else None), table.rows[1:]
    if first:
        return table.rows[first - 1], table.rows[first:]
    comment = table.last_comment
    alike = comment is not None and comment.width == table.rows[0].width
    return (comment if comment and alike and accepts(comment) else None), table.rows


def _is_units(below: list[Row]) -> bool:
    """True if the first row below a header has units and no numbers."""
    return bool(below) and not any(cells.number(cell) for cell in below[0].cells)


def _with_units(header: Row, units: Row) -> Row:
    """A header with the units of a row of their own behind its names."""
    words = [units.cell(place).strip("()[] ") for place in range(len(header.cells))]
    pairs = zip(header.cells, words, strict=True)
    return header._replace(cells=[f"{name} ({unit})" if unit else name for name, unit in pairs])
