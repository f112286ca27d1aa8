"""The delimiter of a text: found by which one parts its lines into readings, or stated."""

import csv
import re
from collections.abc import Callable, Iterable, Iterator

from calibrate.experiment.readings import cells
from calibrate.experiment.readings.dates import is_clock_or_date
from calibrate.experiment.readings.table import Row, refuse_wide
from mrjax import InputError
from mrjax.core.errors import shown

NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
"""Delimiters in the order in which they are tried: commas and spaces stand in cells, too."""
STATED = {
    **{mark: mark for mark in NAMES},
    **{"comma": ",", "semicolon": ";", "tab": "\t", "\\t": "\t", "bar": "|", "space": " "},
}
"""Delimiters by the words of an experiment file."""
LOOKED_AT = 200
"""Lines by which a delimiter is found."""
_WORDS = re.compile(r"[^\s(\[]+(?:\s*(?:\([^)]*\)|\[[^\]]*\]))?")
"""A word, with the unit in brackets behind it."""

Line = tuple[int, str]


def delimiter_of(lines: list[Line], stated: str | None, path: str) -> str:
    """The delimiter that parts most lines into two readings or more, or the stated one.

    Args:
      lines: neither empty nor comments.
      stated: in the experiment file.
      path: as messages name it.

    Raises:
      InputError: a stated delimiter that is not known, or that no line has.
    """
    if stated is not None:
        return _stated(stated, lines, path)
    beginning = lines[:LOOKED_AT]
    counts = {
        mark: (_lines_of_readings(beginning, mark), _lines_of_cells(beginning, mark))
        for mark in NAMES
    }
    best = max(counts, key=lambda mark: counts[mark])
    return best if any(counts[best]) else ","


def rows(lines: Iterable[Line], delimiter: str, path: str) -> Iterator[Row]:
    """The cells of each line.

    Raises:
      InputError: quotation marks without their partner, or far too many columns.
    """
    if delimiter == " ":
        for number, line in lines:
            yield Row(number, _WORDS.findall(line))
        return
    at = 0
    behind_quote = re.compile(rf'"[ ]+(?={re.escape(delimiter)}|$)')

    def told() -> Iterator[str]:
        nonlocal at
        for number, line in lines:
            at = at or number
            yield behind_quote.sub('"', line) + "\n"

    reader = csv.reader(told(), delimiter=delimiter, strict=True, skipinitialspace=True)
    while True:
        at = 0
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise InputError(
                f"{path}, line {at}: {error}; mend its quotation marks, or shorten it"
            ) from None
        refuse_wide(f"{path}, line {at}", len(row), 2)
        yield Row(at, [" ".join(cell.split()) for cell in row])


def _stated(stated: str, lines: list[Line], path: str) -> str:
    mark = STATED.get(stated if stated in NAMES else stated.strip().casefold())
    if mark is None:
        raise InputError(
            f'{path}: delimiter = {shown(stated)} is not known; give ",", ";", "\\t", "|" or " "'
        )
    if lines and not any(mark in line for _, line in lines):
        raise InputError(
            f"{path}: delimiter = {shown(stated)} is stated, and no line has one; take it away to "
            "have it found"
        )
    return mark


def _lines_of_readings(lines: list[Line], mark: str) -> int:
    """Lines of at least two numbers, times or empty cells, and one that is not empty."""

    def has_readings(cells_of: list[str]) -> bool:
        read = [is_reading(cell) for cell in cells_of]
        return sum(read) > 1 or (sum(read) == 1 and any(map(cells.is_missing, cells_of)))

    return _count(lines, mark, has_readings)


def _lines_of_cells(lines: list[Line], mark: str) -> int:
    """Lines of at least two cells."""
    return _count(lines, mark, lambda cells_of: len(cells_of) > 1)


def _count(lines: list[Line], mark: str, accepts: Callable[[list[str]], bool]) -> int:
    count = 0
    for number, line in lines:
        try:
            (row,) = rows([(number, line)], mark, "")
        except (InputError, ValueError):
            continue
        count += accepts(row.cells)
    return count


def is_reading(cell: str) -> bool:
    """True if a cell begins with a number, or holds a time or a date."""
    return cells.number(cell) is not None or is_clock_or_date(cell)
