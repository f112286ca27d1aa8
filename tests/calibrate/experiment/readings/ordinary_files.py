"""Files of readings as laboratories write them: one curve in sixty forms, and sixty mistakes.

Every form is drawn, by its number alone, from independent lists: of delimiters, decimal marks,
encodings, headers, forms of time and of height, and of what else stands in a file.
"""

import random
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

HEIGHT, DIAMETER = 0.4, 0.03
"""Of the tube, m."""
AREA = 3.141592653589793 * DIAMETER**2 / 4.0
STEPS = [0, 1, 2, 3, 5, 8, 12, 18, 30]
"""Times, in steps of their form."""
FALL = [0.0, 0.021, 0.043, 0.062, 0.104, 0.158, 0.203, 0.236, 0.25]
"""What has settled by then, over the height."""
BEGAN = datetime(2023, 5, 17, 9, 30)

EVERY_WORKBOOK = 8
"""Of so many files one is a workbook."""
DELIMITERS = [",", ";", "\t", "|", "  "]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "latin-1", "cp1252"]
ENDS = ["\n", "\r\n"]
HEADS = ["{what} ({unit})", "{what} [{unit}]", "{what}/{unit}", "{what}_{unit}", "{what} in {unit}"]
CASES: list[Callable[[str], str]] = [str, str.upper, str.title]


class TimeForm(NamedTuple):
    """How times are written."""

    name: str
    step: float
    """s."""
    write: Callable[[float], str]
    """The text of some seconds."""
    units: tuple[str, ...] = ()
    """Spellings of its unit; none of what shows what it is."""
    names: tuple[str, ...] = ("time", "t", "elapsed time", "Zeit", "temps", "settling time")
    parts: bool = False
    """True where the day stands in a column of its own."""


def number(unit: float, digits: int) -> Callable[[float], str]:
    return lambda seconds: f"{seconds / unit:.{digits}f}"


def clock(form: str) -> Callable[[float], str]:
    def write(seconds: float) -> str:
        hours, rest = divmod(round(seconds), 3600)
        minutes, second = divmod(rest, 60)
        return form.format(hours=hours, minutes=minutes, seconds=second)

    return write


def date(form: str) -> Callable[[float], str]:
    return lambda seconds: (BEGAN + timedelta(seconds=seconds)).strftime(form)


TIMES = [
    TimeForm("s", 45.0, number(1.0, 0), ("s", "sec", "seconds", "Sekunden")),
    TimeForm("min", 90.0, number(60.0, 1), ("min", "mins", "minutes", "Minuten")),
    TimeForm("h", 1800.0, number(3600.0, 2), ("h", "hr", "hrs", "hours", "Stunden", "heures")),
    TimeForm("day", 43200.0, number(86400.0, 1), ("d", "day", "days", "Tage", "jours")),
    TimeForm("week", 302400.0, number(604800.0, 1), ("weeks", "week", "wk")),
    TimeForm("e", 86400.0, lambda seconds: f"{seconds:.6e}", ("s",)),
    TimeForm("with units", 90.0, lambda seconds: f"{seconds / 60.0:.1f} min"),
    TimeForm("am", 1200.0, date("%I:%M %p"), names=("time",)),
    TimeForm("date and clock", 86400.0, date("%Y-%m-%d@%H:%M"), names=("time",), parts=True),
    TimeForm("hh:mm", 1500.0, clock("{hours}:{minutes:02d}")),
    TimeForm("hh:mm:ss", 95.0, clock("{hours:02d}:{minutes:02d}:{seconds:02d}")),
    TimeForm("iso", 86400.0, date("%Y-%m-%d %H:%M"), names=("date", "date and time")),
    TimeForm("german", 86400.0, date("%d.%m.%Y %H:%M"), names=("Datum", "date")),
    TimeForm("british", 86400.0, date("%d/%m/%Y %H:%M"), names=("date", "Date/Time")),
]


class HeightForm(NamedTuple):
    """How readings are written."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    write: Callable[[float], float]
    """The number, of a height over that of the suspension."""
    digits: int
    read: Callable[[float], float]
    """That ratio, of the number."""


def length(units: tuple[str, ...], metres: float, digits: int) -> HeightForm:
    names = (
        "mudline", "h", "height", "interface height", "level", "interface", "Höhe", "hauteur",
        "sediment height", "slurry height", "height of interface", "mud line", "Interface position",
        "solid-liquid interface height", "h(t)",
    )  # fmt: skip
    scale = HEIGHT / metres
    return HeightForm(names, units, lambda ratio: ratio * scale, digits, lambda one: one / scale)


VOLUME = 1e6 * AREA * HEIGHT
"""Of the suspension, mL."""
HEIGHTS = [
    length(("mm", "millimetres"), 1e-3, 1),
    length(("cm", "centimeters"), 1e-2, 2),
    length(("m", "metres"), 1.0, 4),
    length(("inch", "in"), 0.0254, 2),
    HeightForm(
        ("sediment volume", "volume", "volume of sediment", "V"), ("mL", "ml", "cm3", "cm³"),
        lambda r: r * VOLUME, 2, lambda one: one / VOLUME,
    ),
    HeightForm(
        ("supernatant", "clear layer", "supernatant depth", "clear liquid height", "Überstand",
         "clarified layer", "supernatant height"), ("mm",),
        lambda r: (1.0 - r) * HEIGHT * 1e3, 1, lambda one: 1.0 - one / (HEIGHT * 1e3),
    ),
    HeightForm(
        ("supernatant volume", "clear volume", "volume of clear liquid"), ("mL", "cc"),
        lambda r: (1.0 - r) * VOLUME, 2, lambda one: 1.0 - one / VOLUME,
    ),
    HeightForm(("supernatant",), ("%",), lambda r: 100.0 * (1.0 - r), 1,
               lambda one: 1.0 - one / 100.0),
    HeightForm(("height", "H/H0", "sedimentation ratio", "sediment volume ratio", "h"),
               ("%", "percent"), lambda r: 100.0 * r, 1, lambda one: one / 100.0),
    HeightForm(("sedimentation ratio", "h/h0", "relative height", "H/H_0", "ratio"), ("-", "1"),
               lambda r: r, 3, lambda one: one),
    HeightForm(("height", "mudline"), (), lambda r: 100.0 * r, 1, lambda one: one / 100.0),
]  # fmt: skip
PERCENT_BEHIND = HEIGHTS[-1]
"""`92.1 %` in each cell."""


class OrdinaryFile(NamedTuple):
    """A file, what its experiment states of it, and what is to be read."""

    name: str
    stated: dict[str, Any]
    times: list[float]
    """s, in order."""
    ratios: list[float]
    """Heights over that of the suspension."""
    told: str
    """What it is made of."""


def write(folder: Path, seed: int) -> OrdinaryFile:
    """Writes the file of a number."""
    pick = random.Random(seed)
    time, height = pick.choice(TIMES), pick.choice(HEIGHTS)
    workbook = seed % EVERY_WORKBOOK == EVERY_WORKBOOK - 1
    delimiter = pick.choice(DELIMITERS)
    if delimiter == "  " and (workbook or not time.units or height is PERCENT_BEHIND):
        delimiter = "\t"
    decimal = pick.choice([".", "."] if delimiter == "," or workbook else [".", ","])
    repeats = pick.choice(["none", "none", "rows", "columns"])
    extras = pick.choice(["none", "before", "after", "both"])
    error = pick.choice([None, None, "stated", "column"])
    stated: dict[str, Any] = {}
    head, units = _heads(pick, time, height, stated)
    rows, times, ratios = _rows(pick, time, height, repeats)
    names = [head[0], *_repeated(head[1], 2 if repeats == "columns" else 1)]
    if error == "stated":
        stated["standard_deviation"] = round(height.write(0.99) / 500.0, 5) or 0.01
    if error == "column":
        names.append("standard deviation")
        rows = [[*row, f"{abs(height.write(0.98)) / 300.0 + 0.01:.3f}"] for row in rows]
    if height is PERCENT_BEHIND:
        where = 2 if repeats == "columns" else 1
        rows = [[*row[:1], *(one and f"{one} %" for one in row[1 : 1 + where]), *row[1 + where :]]
                for row in rows]  # fmt: skip
    if time.parts:
        names = ["date", *names]
        rows = [[*row[0].split("@"), *row[1:]] for row in rows]
    if any(units):
        below = [""] * time.parts + [units[0], *[units[1]] * (2 if repeats == "columns" else 1)]
        rows = [[*below, *[""] * (len(names) - len(below))], *rows]
    if extras in ("before", "both"):
        names = ["No.", *names]
        rows = [
            [str(place) if row[-1] or row[0] else "", *row] for place, row in enumerate(rows, 1)
        ]
        if any(units):
            rows[0][0] = ""
    if extras in ("after", "both"):
        names = [*names, "temperature (°C)", "remarks"]
        rows = [[*row, "21.5", "clear" if place > 1 else ""] for place, row in enumerate(rows)]
        if any(units):
            rows[0][-2] = ""
    if delimiter == "  ":
        names = [name.replace(" ", "_") for name in names]
        rows = [[cell.replace(" ", "_") or "-" for cell in row] for row in rows]
    if workbook:
        name = _workbook(folder, seed, pick, names, rows)
    else:
        name = _text(folder, seed, pick, names, rows, delimiter, decimal)
    told = f"{time.name}, {height.names[0]}, {names}, {rows[:2]}, {delimiter!r} {decimal!r}"
    return OrdinaryFile(name, stated, times, ratios, told)


def _heads(
    pick: random.Random, time: TimeForm, height: HeightForm, stated: dict[str, Any]
) -> tuple[list[str], list[str]]:
    """Names of the two columns, and units for a row below; without these they are stated."""
    form, case = pick.choice(HEADS), pick.choice(CASES)
    where = pick.choice(["header", "header", "header", "stated", "below"])
    heads, below = [], []
    for what, units, key in (
        (pick.choice(time.names), time.units, "time_unit"),
        (pick.choice(height.names), height.units, "unit"),
    ):
        unit = pick.choice(units) if units else None
        if unit is not None and where == "header":
            plain = not set("/()") & set(what) and unit not in ("in", "-", "1")
            whole = form if plain else "{what} ({unit})"
            heads.append(whole.format(what=case(what), unit=unit))
            continue
        heads.append(case(what))
        if unit not in (None, "-") and where == "stated":
            stated[key] = unit
        below.append(unit if unit is not None and where == "below" else "")
    return heads, below if len(below) == 2 else ["", ""]


def _repeated(name: str, number: int) -> list[str]:
    """Headers of repeats: `h (mm)`, `h 2 (mm)`."""
    if number == 1:
        return [name]
    for mark in (" (", " [", "/", "_", " in "):
        what, found, unit = name.rpartition(mark)
        if found and not unit.lower().startswith(("h0", "h_0", "0")):
            return [f"{what}{'_' if mark == '_' else ' '}{n}{found}{unit}" for n in (1, 2)]
    return [f"{name} 1", f"{name} 2"]


def _rows(
    pick: random.Random, time: TimeForm, height: HeightForm, repeats: str
) -> tuple[list[list[str]], list[float], list[float]]:
    """Cells of the rows, and times and ratios as they are written."""
    rows, readings = [], []
    for step, fall in zip(STEPS, FALL, strict=True):
        seconds = step * time.step
        texts = [
            f"{height.write(1.0 - fall - apart):.{height.digits}f}"
            for apart in ((0.0, 0.001 if step else 0.0) if repeats != "none" else (0.0,))
        ]
        if repeats == "rows":
            rows += [[time.write(seconds), text] for text in texts]
        else:
            rows.append([time.write(seconds), *texts])
        readings += [(seconds, height.read(float(text))) for text in texts]
    if pick.random() < 0.3 and time.units:
        pick.shuffle(rows)
    if pick.random() < 0.3:  # not read that time
        rows.insert(
            len(rows) // 2, [time.write(STEPS[-1] * time.step * 0.5), *[""] * (len(rows[0]) - 1)]
        )
    readings.sort(key=lambda one: (one[0], -one[1]))
    return rows, [seconds for seconds, _ in readings], [ratio for _, ratio in readings]


def _text(
    folder: Path, seed: int, pick: random.Random, names: list[str], rows: list[list[str]],
    delimiter: str, decimal: str,
) -> str:  # fmt: skip
    """Writes a text, and gives its name."""
    if decimal == ",":
        rows = [
            [cell.replace(".", ",") if _is_number(cell.split(" ")[0]) else cell for cell in row]
            for row in rows
        ]
    quoted = pick.random() < 0.25 and delimiter != "  "
    if quoted:
        names, *rows = ([f'"{cell}"' for cell in row] for row in [names, *rows])
    trailing = delimiter if delimiter in ";\t" and pick.random() < 0.3 else ""
    cells = [delimiter.join(row) + trailing for row in [names, *rows]]
    mark = pick.choice(["#", "%", "//", None])
    if mark:
        cells = [f"{mark} settling of sample {seed}", f"{mark} read by eye", *cells]
    elif pick.random() < 0.4:
        cells = ["Settling test", *cells]
    if pick.random() < 0.3:
        cells.insert(3, "")
    if pick.random() < 0.3:
        cells.append("")
    name, end = f"ordinary-{seed}.{pick.choice(['csv', 'txt', 'dat'])}", pick.choice(ENDS)
    (folder / name).write_bytes((end.join(cells) + end).encode(pick.choice(ENCODINGS)))
    return name


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _workbook(
    folder: Path, seed: int, pick: random.Random, names: list[str], rows: list[list[str]]
) -> str:
    """Writes a workbook with a sheet of notes beside, and gives its name."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    sheet.title = "readings"
    if pick.random() < 0.5:
        sheet.append(["Settling test", None, "tube 3"])
        sheet.append([])
    sheet.append(names)
    for row in rows:
        sheet.append([float(cell) if _is_number(cell) else cell or None for cell in row])
    if pick.random() < 0.5:
        notes = book.create_sheet("notes")
        notes.append(["read by eye"])
    name = f"ordinary-{seed}.xlsx"
    book.save(folder / name)
    return name
