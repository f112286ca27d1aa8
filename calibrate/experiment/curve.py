"""A measured sedimentation curve: a CSV file of time against mudline or sedimentation ratio.

    time,mudline
    0,100
    1.5,92.1

Units are declared in the experiment file; a third column, `standard_deviation`, gives each point
its own error.
"""

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from calibrate.experiment.units import CURVES, HEIGHT_UNITS, RATIO_UNITS, TIME_UNITS, one_of
from mrjax import InputError
from mrjax.core.errors import shown
from mrjax.io import reading
from mrjax.recipe.sheets import LARGEST, SMALLEST, FileName, Sheet

ERROR = "standard_deviation"
MOST_BYTES = 10**7
"""Size of a file beyond which it is no curve that anyone has measured."""
MOST_POINTS = 100_000


class CurveSheet(Sheet):
    """The table of a curve: its file, and the units of its columns."""

    file: FileName = Field(description="a CSV file, as a path from this file")
    time_unit: Annotated[str, one_of(TIME_UNITS)] = Field(
        description=f"one of {', '.join(TIME_UNITS)}"
    )
    unit: Annotated[str, one_of(HEIGHT_UNITS | RATIO_UNITS)] = Field(
        description=f"of the mudline, one of {', '.join(HEIGHT_UNITS)}; of the ratio, 1 or %"
    )
    standard_deviation: float | None = Field(
        default=None,
        gt=0,
        description="the uncertainty of every point in this unit, above zero",
    )


class Curve(NamedTuple):
    """A measured curve; T points."""

    observable: str
    """`mudline` or `sedimentation_ratio`."""
    times: list[float]
    """Increasing, (T,) in s."""
    values: list[float]
    """(T,) in `unit`."""
    errors: list[float]
    """Standard deviations, (T,) in `unit`."""
    unit: str
    si: float
    """One unit in SI."""


def read(sheet: CurveSheet, folder: Path) -> Curve:
    """The curve of a sheet, every number checked.

    Raises:
      InputError: the file, its header or a row cannot be used: the file, the line and the remedy.
    """
    path = folder / sheet.file
    rows = _rows(path)
    columns = _columns(path, *next(rows, (1, [])), sheet)
    observable = next(name for name in CURVES if name in columns)
    times: list[float] = []
    values: list[float] = []
    errors: list[float] = []
    for number, cells in rows:
        at = f"{path}, line {number}"
        if len(cells) != len(columns):
            raise InputError(
                f"{at}: has {len(cells)} cells for {len(columns)} columns; separate columns by "
                "commas and write decimals with a point"
            )
        row = {name: _number(at, name, cell) for name, cell in zip(columns, cells, strict=True)}
        error = row.get(ERROR, sheet.standard_deviation or math.nan)
        for name in ("time", observable):
            if row[name] < 0.0:
                raise InputError(f"{at}: {name} = {row[name]:g} is negative; mend the row")
        if not error > 0:
            raise InputError(
                f"{at}: {ERROR} = {error:g} must be above zero; give the error of the reading"
            )
        if times and not row["time"] > times[-1]:
            raise InputError(
                f"{at}: time = {row['time']:g} comes after {times[-1]:g}; sort the rows by time, "
                "one for each time"
            )
        times.append(row["time"])
        values.append(row[observable])
        errors.append(error)
        if len(times) > MOST_POINTS:
            raise InputError(f"{at}: comes after {MOST_POINTS} rows; give fewer readings")
    if len(times) < 2:
        raise InputError(f"{path}: has {len(times)} rows of numbers; give at least 2")
    second = TIME_UNITS[sheet.time_unit]
    return Curve(
        observable,
        [second * time for time in times],
        values,
        errors,
        sheet.unit,
        CURVES[observable][sheet.unit],
    )


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The cells of every line that is neither empty nor a comment, with its number."""
    try:
        content = reading.text(path, MOST_BYTES)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; give the curve's CSV file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not UTF-8 text; save the curve as a UTF-8 CSV") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    for number, line in enumerate(content.splitlines(), start=1):
        if line.strip() and line.lstrip()[0] != "#":
            yield number, _cells(path, number, line)


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        (row,) = csv.reader([line], strict=True)
    except csv.Error as error:
        raise InputError(
            f"{path}, line {number}: {error}; mend its quotation marks, or shorten it"
        ) from None
    return [cell.strip() for cell in row]


def _columns(path: Path, number: int, header: list[str], sheet: CurveSheet) -> list[str]:
    if len(header) == 1 and ";" in header[0]:
        raise InputError(
            f"{path}, line {number}: columns are separated by semicolons; save with commas, and "
            "decimals with a point"
        )
    known = {"time", *CURVES, ERROR}
    for name in header:
        if name not in known:
            raise InputError(
                f"{path}, line {number}: column {shown(name)} is not known; the header is time, "
                f"then mudline or sedimentation_ratio, then {ERROR} if points have their own"
            )
    of_height = [name for name in header if name in CURVES]
    if "time" not in header or len(of_height) != 1 or len(set(header)) != len(header):
        raise InputError(
            f"{path}, line {number}: the header is {', '.join(header[:4]) or 'missing'}; "
            f"give time and one of {' or '.join(CURVES)}"
        )
    if sheet.unit not in CURVES[of_height[0]]:
        raise InputError(
            f"{path}: unit = {sheet.unit!r} is none of a {of_height[0]}; give one of "
            f"{', '.join(CURVES[of_height[0]])}"
        )
    if ERROR not in header and sheet.standard_deviation is None:
        raise InputError(
            f"{path}: no point has an error; give {ERROR} in the experiment file, or a column of it"
        )
    return header


def _number(at: str, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{at}: {name} = {shown(cell)} is not a finite number; write decimals with a point, "
            "and leave out rows without a reading"
        )
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise InputError(
            f"{at}: {name} = {value:g} must be 0, or between 1e-30 and 1e30; mend the row"
        )
    return value
