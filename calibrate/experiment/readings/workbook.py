"""Rows of a workbook (.xlsx), read with openpyxl, with cells as text."""

import io
import re
import zipfile
from collections.abc import Iterator
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from calibrate.experiment.readings.table import MOST_CELLS, Row, Table, refuse_wide
from mrjax import InputError
from mrjax.core.errors import shown

MOST_UNPACKED = 2 * 10**8
"""Largest unpacked size of a workbook, bytes."""
MOST_ROWS = 100_002
COMMENT = re.compile(r"#(?!N/A)")
FIRST_YEAR = 1901
"""Dates before this year are elapsed times of more than a day, counted from the first day of a
workbook."""


def tables(content: bytes, path: Path, stated: str | int | None) -> list[Table]:
    """The sheets of a workbook that are not empty, or the stated one.

    Args:
      content: content of the file.
      path: path of the file, for messages.
      stated: name of a sheet, or its number from 1; None for all sheets.

    Raises:
      InputError: openpyxl is missing, the file is no workbook, or it has no such sheet.
    """
    try:
        import openpyxl
    except ImportError:
        raise InputError(
            f"{path}: is a workbook, which needs openpyxl; pip install 'mrjax[xlsx]', or save the "
            "sheet as CSV"
        ) from None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > MOST_UNPACKED:
            raise InputError(f"{path}: is larger than {MOST_UNPACKED / 1e6:g} MB unpacked")
        book = openpyxl.load_workbook(io.BytesIO(content), data_only=True, read_only=True)
        sheets = {worksheet.title: worksheet for worksheet in book.worksheets}
        chosen = _chosen_sheets(sheets, stated, path)
        found_tables = [
            _table(worksheet, f"{path}, sheet {shown(name)}", name)
            for name, worksheet in chosen.items()
        ]
        book.close()
    except InputError:
        raise
    except Exception as error:  # a damaged file may raise KeyError, ParseError, zlib.error
        raise InputError(
            f"{path}: cannot be read as a workbook ({type(error).__name__}); save it again as "
            ".xlsx or CSV"
        ) from None
    return [table for table in found_tables if table.rows] or found_tables[:1]


def _chosen_sheets(sheets: dict[str, Any], stated: str | int | None, path: Path) -> dict[str, Any]:
    names = list(sheets)
    if stated is None:
        return sheets
    if isinstance(stated, int) and 1 <= stated <= len(names):
        stated = names[stated - 1]
    if stated not in sheets:
        raise InputError(
            f"{path}: has no sheet = {shown(stated)}; it has {', '.join(map(shown, names[:5]))}"
        )
    return {str(stated): sheets[stated]}


def _table(sheet: Any, path: str, name: str) -> Table:
    rows = [row for row in _rows(sheet, path) if not COMMENT.match(row.cells[0])]
    return Table(path, "row", rows, None, {"sheet": name})


def _rows(sheet: Any, path: str) -> Iterator[Row]:
    for number, row in enumerate(sheet.iter_rows(max_col=MOST_CELLS + 1), start=1):
        cells = [_cell_text(cell.value, getattr(cell, "number_format", "")) for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        refuse_wide(f"{path}, row {number}", len(cells), 2)
        if number > MOST_ROWS:
            return
        if cells:
            yield Row(number, cells)


def _cell_text(value: Any, number_format: str | None) -> str:
    """The text that a cell of a text file would have."""
    from openpyxl.utils.datetime import to_excel

    match value:
        case None:
            return ""
        case bool():
            return str(value)
        case int() | float() if "%" in (number_format or ""):
            return f"{100.0 * value:.15g}%"
        case int() | float():
            return f"{value:.15g}"
        case datetime() if value.year < FIRST_YEAR:
            return _clock(timedelta(days=to_excel(value)))
        case datetime():
            return value.isoformat(" ")
        case date():
            return value.isoformat()
        case time():
            return value.isoformat()
        case timedelta():
            return _clock(value)
        case _:
            return " ".join(str(value).split())


def _clock(elapsed: timedelta) -> str:
    minutes, rest = divmod(abs(elapsed), timedelta(minutes=1))
    sign = "-" if elapsed < timedelta(0) else ""
    return f"{sign}{minutes // 60}:{minutes % 60:02d}:{rest.total_seconds():09.6f}"
