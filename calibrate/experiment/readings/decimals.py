"""The decimal mark of a file: a point or a comma, found from its numbers or stated."""

import re
from collections.abc import Iterable

from calibrate.experiment.readings import cells
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.dates import is_clock_or_date

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""Numbers such as 1,701, which may be 1701 or 1.701."""


def decimal_mark(numbers: Iterable[Cell], delimiter: str, stated: str | None) -> str:
    """The decimal mark of all cells that are read, "." or ",".

    A comma is a decimal mark where columns are separated by something else, or where a number
    shows that it separates no thousands.

    Args:
      numbers: cells of times and readings; those without numbers are ignored.
      delimiter: mark between columns, "" for a workbook.
      stated: mark that the experiment file states; None to find it.

    Raises:
      InputError: two marks in a number, both marks in a file, another mark than the stated one, or
        commas that may separate thousands.
    """
    first: dict[str, Cell] = {}
    ambiguous: Cell | None = None
    plain = False
    last: Cell | None = None
    for cell in numbers:
        last = cell
        number = cells.number(cell.text)
        if number is None or is_clock_or_date(cell.text):
            continue
        marks = number.written.count(","), number.written.count(".")
        if sum(marks) > 1:
            raise cell.refuse(
                "has more than one decimal mark; write it without thousands separators"
            )
        if marks[0]:
            first.setdefault(",", cell)
            thousands = _THOUSANDS.fullmatch(number.written)
            ambiguous = ambiguous or (cell if thousands else None)
            plain = plain or not thousands
        elif marks[1]:
            first.setdefault(".", cell)
    other_mark = {".": ",", ",": "."}
    if stated is not None and (against := first.get(other_mark[stated])):
        raise against.refuse(
            f'has another decimal mark than decimal = "{stated}", which is stated; mend one'
        )
    if stated == delimiter == "," and "," not in first and last is not None:
        raise last.refuse(
            'stands between commas, and decimal = "," is stated; state another delimiter, or take '
            "decimal away"
        )
    if len(first) > 1:
        raise first[","].refuse(
            f"has a comma, and {first['.'].text} a point; write one decimal mark, and no thousands "
            "separators"
        )
    if ambiguous and not plain and stated is None and delimiter != ";":
        written = ambiguous.text.replace(",", "")
        raise ambiguous.refuse(
            f"may be {written} or {ambiguous.text.replace(',', '.')}; write {written}, or state "
            'decimal = ","'
        )
    return "," if "," in first else "."
