"""One cell of a file: empty, a number, or other text."""

import math
import re
import unicodedata
from typing import NamedTuple

from mrjax import InputError
from mrjax.core.errors import shown
from mrjax.recipe.sheets import LARGEST, SMALLEST

MISSING = frozenset(
    [
        *("", "-", "--", "---", "\N{EN DASH}", "\N{EM DASH}", ".", "nan", "-nan", "na", "n/a"),
        *("n.a.", "#n/a", "null", "none", "nd", "n.d."),
    ]
)
"""Texts of cells without a reading."""
_NUMBER = re.compile(
    r"(?P<number>[+-]?(?:[0-9][0-9.,]*|[.,][0-9][0-9.,]*)(?:[eE][+-]?[0-9]+)?)"
    r"\s*(?P<unit>[%\"]|[^\W\d_][\w/^ .]*)?"
)


class Number(NamedTuple):
    """A number as it is written, and the unit behind it."""

    written: str
    """Digits with their decimal mark."""
    unit: str
    """The word behind it, "" if there is none."""


class Cell(NamedTuple):
    """A cell with its place in the file."""

    at: str
    """File and line, for messages."""
    name: str
    """Name of its column, for messages."""
    text: str

    def refuse(self, fault: str) -> InputError:
        """The error of a fault, with the place, column and value of the cell."""
        return InputError(f"{self.at}: {self.name} = {shown(self.text)} {fault}")


def is_missing(text: str) -> bool:
    """True for a cell without a reading."""
    return text.casefold() in MISSING


def number(text: str) -> Number | None:
    """The number of a cell; None if the cell does not begin with one."""
    match = _NUMBER.fullmatch(unicodedata.normalize("NFKC", text).replace("\u2212", "-"))
    return Number(match["number"], match["unit"] or "") if match else None


def value(cell: Cell, written: str, mark: str) -> float:
    """The value of the number in a cell, checked.

    Args:
      cell: the cell, for messages.
      written: its number as text.
      mark: decimal mark, "." or ",".

    Raises:
      InputError: the number is not finite, or out of range.
    """
    try:
        result = float(written.replace(mark, "."))
    except ValueError:
        result = math.nan
    if not math.isfinite(result):
        raise cell.refuse(f"is not a finite number; {_remedy(mark)}")
    if result and not SMALLEST <= abs(result) <= LARGEST:
        raise InputError(
            f"{cell.at}: {cell.name} = {result:g} must be 0, or between 1e-30 and 1e30; mend the "
            "row"
        )
    return result


def not_a_number(cell: Cell) -> InputError:
    """The error of a cell that holds something else."""
    return cell.refuse(f"is not a finite number; {_remedy('.')}")


def _remedy(mark: str) -> str:
    named = "a point" if mark == "." else "a comma"
    return (
        f"write decimals with {named}, no thousands separators, and leave empty what was not read"
    )
