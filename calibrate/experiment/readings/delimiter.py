"""The delimiter of a text: the mark that splits its lines into readings, or the stated one."""

import csv
import re
from collections.abc import Iterable, Iterator

from calibrate.experiment.readings import cells
from calibrate.experiment.readings.dates import is_clock_or_date
from calibrate.experiment.readings.table import Row, refuse_wide
from mrjax import InputError
from mrjax.core.errors import shown

NAMES = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "spaces"}
"""Delimiters in the order of their trial; commas and spaces also occur within cells."""
STATED = {
    **{mark: mark for mark in NAMES},
    **{"comma": ",", "semicolon": ";", "tab": "\t", "\\t": "\t", "bar": "|", "space": " "},
}
"""Delimiters by the words of an experiment file."""
IN_CELLS = ", "
"""Delimiters that occur within cells."""
NEARLY_ALL = 0.8
"""Share of the largest number of lines of readings that a mark must give if it is in no cell."""
LOOKED_AT = 200
"""Number of lines in which the delimiter is searched."""
_WORDS = re.compile(r"[^\s(\[]+(?:\s*(?:\([^)]*\)|\[[^\]]*\])[^\s(\[]*)*")
"""A word, with what stands in brackets behind it, such as its unit."""

Line = tuple[int, str]


def delimiter_of(lines: list[Line], stated: str | None, path: str) -> str:
    """The delimiter that splits most lines into two readings or more, or the stated one.

    Args:
      lines: lines that are neither empty nor comments.
      stated: delimiter that the experiment file states; None to find it.
      path: path of the file, for messages.

    Raises:
      InputError: a stated delimiter that is not known, or that no line has.
    """
    if stated is not None:
        return _stated_delimiter(stated, lines, path)
    beginning = lines[:LOOKED_AT]
    counts = {mark: _counts(beginning, mark) for mark in NAMES}
    most = max(readings for readings, _ in counts.values())
    for mark, (readings, parted) in counts.items():
        # Words and numbers of a header have spaces and commas within, and seldom any other mark.
        if mark not in IN_CELLS and parted > readings > NEARLY_ALL * most:
            return mark
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
    first_line = 0
    behind_quote = re.compile(rf'"[ ]+(?={re.escape(delimiter)}|$)')

    def numbered_lines() -> Iterator[str]:
        nonlocal first_line
        for number, line in lines:
            first_line = first_line or number
            yield behind_quote.sub('"', line) + "\n"

    reader = csv.reader(numbered_lines(), delimiter=delimiter, strict=True, skipinitialspace=True)
    while True:
        first_line = 0
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise InputError(
                f"{path}, line {first_line}: {error}; mend its quotation marks, or shorten it"
            ) from None
        refuse_wide(f"{path}, line {first_line}", len(row), 2)
        yield Row(first_line, [" ".join(cell.split()) for cell in row])


def _stated_delimiter(stated: str, lines: list[Line], path: str) -> str:
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


def _counts(lines: list[Line], mark: str) -> tuple[int, int]:
    """Numbers of lines with readings, and of lines with two cells or more from the header on.

    Sentences above the header are not counted: they have any number of words.
    """
    parted = [_cells(line, mark) for line in lines]
    readings = [place for place, parts in enumerate(parted) if _has_readings(parts)]
    header = max(0, readings[0] - 1) if readings else 0
    return len(readings), sum(len(parts) > 1 for parts in parted[header:])


def _cells(line: Line, mark: str) -> list[str]:
    """The cells of a line; none where its quotation marks have no partner."""
    try:
        (row,) = rows([line], mark, "")
    except (InputError, ValueError):
        return []
    return row.cells


def _has_readings(cells_of: list[str]) -> bool:
    """True for at least two numbers, times or empty cells, and one that is not empty."""
    holds_reading = [is_reading(cell) for cell in cells_of]
    return sum(holds_reading) > 1 or (
        sum(holds_reading) == 1 and any(map(cells.is_missing, cells_of))
    )


def is_reading(cell: str) -> bool:
    """True if a cell begins with a number, or holds a time or a date."""
    return cells.number(cell) is not None or is_clock_or_date(cell)
