"""Rows of a file: of a text with delimiters, or of a sheet of a workbook."""

import re
from pathlib import Path

from calibrate.experiment.readings import delimiter, text, workbook
from calibrate.experiment.readings.sheet import FileSheet
from calibrate.experiment.readings.table import Row, Table
from mrjax import InputError
from mrjax.io import reading

MOST_BYTES = 10**7
"""Largest size of a file of readings, bytes."""
MOST_POINTS = 100_000
"""Most rows of readings."""
COMMENTS = ("#", "%", "//")
"""Beginnings of a comment."""
OLD_EXCEL = b"\xd0\xcf\x11\xe0"
WORKBOOK = b"PK\x03\x04"
_SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""First line by which some spreadsheets state their delimiter."""


def tables(sheet: FileSheet, folder: Path) -> list[Table]:
    """The table of a text, or those of the sheets of a workbook that are not empty.

    Raises:
      InputError: a file that cannot be read as either: its path and the remedy.
    """
    path = folder / sheet.file
    content = _content(path)
    if content.startswith(OLD_EXCEL):
        raise InputError(f"{path}: is a workbook of an old kind (.xls); save it as .xlsx or CSV")
    if content.startswith(WORKBOOK):
        for key in ("delimiter", "encoding"):
            if getattr(sheet, key) is not None:
                raise InputError(f"{path}: {key} is stated, and a workbook has none; take it away")
        found_tables = workbook.tables(content, path, sheet.sheet)
    else:
        if sheet.sheet is not None:
            raise InputError(f"{path}: sheet is stated, and a text has none; take it away")
        found_tables = [_table(content, path, sheet)]
    for table in found_tables:
        if len(table.rows) > MOST_POINTS + 1:
            raise InputError(
                f"{table.at(table.rows[MOST_POINTS + 1])}: comes after {MOST_POINTS} rows; give "
                "fewer readings"
            )
    return found_tables


def _content(path: Path) -> bytes:
    try:
        return reading.content(path, MOST_BYTES)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give a CSV or .xlsx file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; give a CSV or .xlsx file in it") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None


def _table(content: bytes, path: Path, sheet: FileSheet) -> Table:
    decoded = text.decoded(content, path, sheet.encoding)
    lines: list[delimiter.Line] = []
    comment: delimiter.Line | None = None
    mark = sheet.delimiter
    for number, line in enumerate(decoded.text.splitlines(), start=1):
        plain = line.strip()
        if not lines and (named := _SEPARATOR.fullmatch(plain)):
            mark = mark or named[1]
        elif line.lstrip(' "').startswith(COMMENTS):  # a tab is an empty cell
            comment = comment if lines else (number, plain.lstrip('"#%/ \t'))
        elif plain:
            lines.append((number, line))
    mark = delimiter.delimiter_of(lines, mark, str(path))
    try:
        last = next(delimiter.rows([comment], mark, str(path))) if comment else None
    except InputError:
        last = None  # a sentence with a quotation mark
    rows = [row for row in delimiter.rows(lines, mark, str(path)) if row.width]
    facts = {"encoding": decoded.encoding, "delimiter": delimiter.NAMES[mark]}
    return Table(str(path), "line", rows, last, facts, mark)


def is_numbers(row: Row) -> bool:
    """True if a row holds numbers, times and empty cells alone, two of them at least."""
    filled = [cell for cell in row.cells if cell]
    return len(filled) > 1 and all(delimiter.is_reading(cell) for cell in filled)
