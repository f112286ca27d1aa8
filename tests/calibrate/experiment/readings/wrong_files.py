"""Sixty mistakes that people make with files of readings, each alone in a file that is right."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

Rows = list[list[str]]
RIGHT: Rows = [
    ["time (min)", "mudline (mm)"], ["0", "400.0"], ["2", "391.5"], ["4", "382.8"],
    ["6", "375.1"], ["10", "358.4"], ["16", "336.8"], ["24", "318.9"],
]  # fmt: skip
DATES = ["2023-05-17", "2023-05-18", "2023-05-19", "2023-05-20", "2023-05-22", "2023-05-25"]


class Mistake(NamedTuple):
    """A mistake, and what a message about it names."""

    name: str
    content: bytes | None
    """Of the file; None of one that is not there."""
    stated: dict[str, Any]
    named: tuple[str, ...]
    height: float = 0.4
    tube_diameter: float | None = 0.03


def table(rows: Rows, delimiter: str = ",") -> bytes:
    return ("\n".join(delimiter.join(row) for row in rows) + "\n").encode()


def with_cell(row: int, column: int, text: str, rows: Rows = RIGHT) -> Rows:
    """The rows with another text in a cell."""
    return [
        [text if (place, other) == (row, column) else cell for other, cell in enumerate(cells)]
        for place, cells in enumerate(rows)
    ]


def with_head(*names: str) -> Rows:
    return [list(names), *RIGHT[1:]]


def with_column(name: str, cells: list[str]) -> Rows:
    """The rows with a column more."""
    return [[*row, cell] for row, cell in zip(RIGHT, [name, *cells], strict=True)]


def dated(cells: list[str]) -> Rows:
    rows = zip(cells, RIGHT[1:], strict=False)
    return [["date", "mudline (mm)"], *([cell, row[1]] for cell, row in rows)]


def commas(rows: Rows) -> Rows:
    return [rows[0], *([cell.replace(".", ",") for cell in row] for row in rows[1:])]


def _cells() -> list[Mistake]:
    """One cell is wrong."""
    at = [
        ("a word for a reading", 3, 1, "broken", ("line 4", "broken")),
        ("a word for a time", 3, 0, "later", ("line 4", "later")),
        ("a question mark", 2, 1, "391.5?", ("line 3", "391.5?")),
        ("about", 4, 1, "~375", ("line 5", "~375")),
        ("a range", 4, 1, "370-380", ("line 5", "370-380")),
        ("an infinite reading", 4, 1, "inf", ("line 5", "inf")),
        ("a division by zero", 4, 1, "#DIV/0!", ("line 5", "#DIV/0!")),
        ("two points", 2, 1, "391.5.0", ("line 3", "391.5.0")),
        ("a negative reading", 6, 1, "-336.8", ("line 7", "-336.8")),
        ("another unit behind a number", 2, 1, "39.15 cm", ("line 3", "cm")),
        ("a foreign unit behind a number", 2, 1, "391.5 kg", ("line 3", "391.5 kg")),
        ("a unit of another kind behind a time", 2, 0, "2 mm", ("line 3", "2 mm")),
        ("an enormous reading", 2, 1, "1e99", ("line 3", "1e+99")),
        ("a letter for a digit", 2, 1, "39l.5", ("line 3", "39l.5")),
        ("a reading above the suspension", 2, 1, "491.5", ("line 3", "491.5")),
        ("a digit too many", 4, 1, "3751", ("line 5", "3751")),
        ("a mudline that rises", 5, 1, "395.0", ("line 6", "395")),
        ("a first reading far below", 1, 1, "300.0", ("line 2", "300")),
        ("a mudline at the floor", 7, 1, "3.0", ("line 8", "3")),
    ]  # fmt: skip
    return [
        Mistake(name, table(with_cell(row, column, text)), {}, named)
        for name, row, column, text, named in at
    ]


def _heads() -> list[Mistake]:
    """The header or the columns are wrong."""
    three = [["", ""], *([row[0], row[1]] for row in RIGHT[1:])]
    errors = ["3", "3", "0", "3", "3", "3", "3"]
    return [
        Mistake("no time", table(with_head("step", "mudline (mm)")), {}, ("step", "time")),
        Mistake("no reading", table(with_head("time (min)", "pH")), {}, ("pH", "mudline")),
        Mistake("no unit of time", table(with_head("time", "mudline (mm)")), {}, ("time_unit",)),
        Mistake("no unit of readings", table(with_head("time (min)", "mudline")), {}, ("unit",)),
        Mistake("years", table(with_head("time (years)", "mudline (mm)")), {}, ("years",)),
        Mistake("kilometres", table(with_head("time (min)", "mudline (km)")), {}, ("km",)),
        Mistake("heights in hours", table(with_head("time (min)", "mudline (h)")), {}, ("h",)),
        Mistake("two units", table(with_column("mudline 2 (cm)", ["40"] * 7)), {}, ("mm", "cm")),
        Mistake("two mudlines", table([["time (min)", "height (mm)", "level (mm)"],
                *([*row, "400"] for row in RIGHT[1:])]), {}, ("height", "level")),
        Mistake("two times", table([["time (min)", *row] if not place else [row[0], *row]
                                    for place, row in enumerate(RIGHT)]), {}, ("time",)),
        Mistake("one column", table([row[:1] for row in RIGHT]), {}, ("time (min)",)),
        Mistake("three columns without names",
                table([[*row, "21"] for row in three[1:]]), {}, ("3 columns", "header")),
        Mistake("an error of zero", table(with_column("sd (mm)", errors)), {}, ("line 4", "0")),
        Mistake("some errors", table(with_column("sd (mm)", ["3"] * 3 + [""] * 4)), {},
                ("line 5", "standard_deviation")),
        Mistake("two samples", table(with_column("sample", ["A"] * 4 + ["B"] * 3)), {},
                ("line 6", "'B'", "'A'")),
        Mistake("a row that is longer", table([*RIGHT[:4], [*RIGHT[4], "21", "22"], *RIGHT[5:]]),
                {}, ("line 5", "4 cells")),
        Mistake("a quotation mark alone", table(with_cell(3, 1, '"382.8')), {}, ("line 4",)),
    ]  # fmt: skip


def _forms() -> list[Mistake]:
    """Times, dates and numbers are in a form that is wrong, or that can be read in two ways."""
    one, clocks = RIGHT[0], [[f"0:{row[0]:0>2}", row[1]] for row in RIGHT[1:]]
    thousands = [["time (min)", "mudline (um)"], ["0", "400,000"], ["2", "391,500"],
                 ["4", "382,800"]]  # fmt: skip
    return [
        Mistake("day and month either way", table(dated(["01/02/2023", "02/02/2023",
                "03/02/2023"])), {}, ("01/02/2023", "date_format")),
        Mistake("no such day", table(dated([*DATES[:3], "2023-02-30"])), {},
                ("line 5", "2023-02-30")),
        Mistake("a date among numbers", table(with_cell(3, 0, "2023-05-17")), {},
                ("line 4", "2023-05-17")),
        Mistake("75 minutes", table(with_cell(3, 0, "0:75", [["time (hh:mm)", one[1]], *clocks])),
                {}, ("line 4", "0:75")),
        Mistake("clocks in minutes", table([one, *clocks]), {}, ("line 2", "0:00", "min")),
        Mistake("dates of another form", table(dated(DATES)), {"date_format": "%d.%m.%Y"},
                ("2023-05-17", "date_format")),
        Mistake("thousands", table(thousands, "\t"), {}, ("400,000",)),
        Mistake("decimal commas in commas", table(commas(RIGHT)), {}, ("line 2",)),
        Mistake("both decimal marks", table(with_cell(3, 1, "382,8"), ";"), {}, ("382,8",)),
        Mistake("one time", table([one, RIGHT[1], ["0", "399.0"]]), {}, ("one time",)),
        Mistake("a header alone", table([one]), {}, ("reading",)),
        Mistake("nothing", b"", {}, ("header",)),
    ]  # fmt: skip


def _stated() -> list[Mistake]:
    """What is stated contradicts the file, or is not known."""
    right = table(RIGHT)
    return [
        Mistake("another unit", right, {"unit": "cm"}, ("'cm'", "mm")),
        Mistake("another unit of time", right, {"time_unit": "h"}, ("'h'", "min")),
        Mistake("a delimiter that is not there", right, {"delimiter": ";"}, ("';'",)),
        Mistake("a column that is not there", right, {"columns": {"mudline": "level"}},
                ("'level'",)),
        Mistake("a column beyond the last", right, {"columns": {"time": 1, "mudline": 5}}, ("5",)),
        Mistake("an encoding of nobody", right, {"encoding": "utf-9"}, ("'utf-9'",)),
        Mistake("an encoding of another file", right, {"encoding": "utf-16"}, ("'utf-16'",)),
        Mistake("a decimal comma", right, {"decimal": ","}, ("400.0", "decimal")),
        Mistake("a sheet of a text", right, {"sheet": "readings"}, ("sheet",)),
        Mistake("volumes without a diameter", table(with_head("time (min)", "volume (mL)")), {},
                ("tube_diameter",), tube_diameter=None),
        Mistake("a height in cm", right, {}, ("height",), height=40.0),
        Mistake("a file that is not there", None, {}, ("no such file",)),
        Mistake("a picture", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00", {}, ("no text",)),
        Mistake("an old workbook", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", {}, (".xls",)),
    ]  # fmt: skip


def mistakes() -> list[Mistake]:
    """All of them."""
    kinds: list[Callable[[], list[Mistake]]] = [_cells, _heads, _forms, _stated]
    return [one for kind in kinds for one in kind()]


def write(folder: Path, mistake: Mistake) -> str:
    """Writes the file of a mistake, and gives its name."""
    name = "mistake.xls" if mistake.name == "an old workbook" else "mistake.csv"
    (folder / name).unlink(missing_ok=True)
    if mistake.content is not None:
        (folder / name).write_bytes(mistake.content)
    return name
