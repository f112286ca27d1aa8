"""A measured sedimentation curve, from a file of times with mudlines or sedimentation ratios.

    time (h),mudline (mm)
    0,100
    1.5,92.1

Columns, units, delimiter and decimal mark are found in the file, or stated in the experiment file.
"""

import math
from pathlib import Path
from typing import NamedTuple

from calibrate.experiment.readings import columns, decimals, rows
from calibrate.experiment.readings.columns import Layout
from calibrate.experiment.readings.points import Points, points
from calibrate.experiment.readings.scatter import LEAST, scatter
from calibrate.experiment.readings.sheet import CurveSheet as CurveSheet
from calibrate.experiment.readings.table import Table, only_table
from calibrate.experiment.readings.times import Times, times
from calibrate.experiment.readings.understood import Understood
from calibrate.experiment.readings.values import Tube, Values, values
from calibrate.experiment.repeats import scatter_of_repeats
from calibrate.experiment.sample import Scatter
from calibrate.experiment.units import TIME_UNITS
from mrjax import InputError
from mrjax.core.errors import shown

ERROR = "standard_deviation"


class Curve(NamedTuple):
    """A measured curve: T readings in the order of their times; several may have the same time."""

    observable: str
    """`mudline` or `sedimentation_ratio`."""
    times: list[float]
    """Times, s, (T,)."""
    values: list[float]
    """Readings, (T,) in `unit`."""
    errors: list[float]
    """Standard deviations, (T,) in `unit`."""
    unit: str
    si: float
    """One unit in SI: m of height, or as a ratio."""
    rows: list[int]
    """Numbers of the rows in the file, (T,)."""
    understood: Understood
    """Record of how the file was read."""
    scatter: Scatter | None
    """First guess of the scatter, or that of repeats; None if errors are stated."""


def read(
    sheet: CurveSheet,
    folder: Path,
    height: float | None = None,
    tube_diameter: float | None = None,
) -> Curve:
    """Reads a curve, and checks every number.

    Args:
      sheet: the file and its settings.
      folder: folder of the experiment file, to which paths are relative.
      height: height of the suspension, m; needed for a clear layer, and for readings without
      errors.
      tube_diameter: inner diameter of the tube, m; needed for volumes.

    Raises:
      InputError: the file, its header or a row cannot be used; the message has the line and the
        remedy.
    """
    table = only_table(
        rows.tables(sheet, folder),
        lambda table: bool(columns.layout(table, sheet.columns).rows),
        folder / sheet.file,
        "several sheets of readings",
        "no sheet with a time and a mudline",
    )
    layout = columns.layout(table, sheet.columns, sheet.time_unit, sheet.unit)
    columns.refuse_several_samples(table, layout.others, layout.rows)
    cells_of_readings = points(table, layout, sheet.date_format)
    cells = [
        cell
        for point in cells_of_readings.points
        for cell in (point.time, point.reading, point.error)
    ]
    mark = decimals.decimal_mark(filter(None, cells), table.delimiter, sheet.decimal)
    head = layout.time.heading
    if layout.date is not None:
        head = head._replace(name="time of day")
    times_read = times([point.time for point in cells_of_readings.points], head, sheet, mark)
    readings = values(cells_of_readings.points, layout, sheet, Tube(height, tube_diameter), mark)
    if min(times_read.seconds) == max(times_read.seconds):
        raise InputError(f"{table.path}: has readings at one time alone; give a second time")
    readings, estimated = _with_errors(readings, times_read, height, table)
    errors = "estimated" if estimated else "stated"
    order = sorted(range(len(readings.values)), key=lambda place: times_read.seconds[place])
    times_read = times_read._replace(seconds=[times_read.seconds[place] for place in order])
    readings = readings._replace(
        values=[readings.values[place] for place in order],
        errors=[readings.errors[place] for place in order],
    )
    understood = _understood(
        sheet, table, layout, cells_of_readings, times_read, readings, errors, mark
    )
    return Curve(
        readings.observable,
        times_read.seconds,
        readings.values,
        readings.errors,
        readings.unit,
        readings.si,
        [cells_of_readings.points[place].row.number for place in order],
        understood,
        estimated,
    )


def _with_errors(
    readings: Values, times_read: Times, height: float | None, table: Table
) -> tuple[Values, Scatter | None]:
    """Readings with errors, and the scatter that gives these; None if they are stated."""
    if not any(map(math.isnan, readings.errors)):
        return readings, None
    full_height = 1.0 if readings.observable == "sedimentation_ratio" else height or 0.0
    top = full_height / readings.si
    if not top:
        raise InputError(
            f"{table.path}: no point has an error; give {ERROR} in the experiment file, or a "
            "column of it"
        )
    ordered = sorted(zip(times_read.seconds, readings.values, strict=True))
    times, values = [time for time, _ in ordered], [value for _, value in ordered]
    repeated = scatter_of_repeats(times, values, relative=False)
    if repeated is None:
        estimated = Scatter(scatter(times, values, top), 0.0, "assumed")
    else:
        estimated = repeated._replace(value=max(repeated.value, LEAST * top))
    return readings._replace(errors=[estimated.value] * len(readings.values)), estimated


def _understood(
    sheet: CurveSheet,
    table: Table,
    layout: Layout,
    cells_of_readings: Points,
    times_read: Times,
    readings: Values,
    errors: str,
    mark: str,
) -> Understood:
    """Record of how the file was read; its readings are in the order of their times."""
    named = [column.named for column in layout.readings]
    time = " and ".join(shown(column.named) for column in (layout.date, layout.time) if column)
    used: dict[str, str] = {"time": time, layout.readings[0].role: " and ".join(map(shown, named))}
    if layout.errors:
        used[ERROR] = " and ".join(shown(column.named) for column in layout.errors)
    first, last = (times_read.seconds[place] / TIME_UNITS[times_read.unit] for place in (0, -1))
    return Understood(
        file=sheet.file,
        read_as=table.facts | ({"decimal": "decimal commas"} if mark == "," else {}),
        columns=used,
        observable=readings.observable,
        time_form=times_read.form,
        time_unit=times_read.unit,
        unit=readings.unit,
        readings=len(readings.values),
        first=(first, readings.values[0]),
        last=(last, readings.values[-1]),
        errors=errors,
        standard_deviation=(min(readings.errors), max(readings.errors)),
        ignored_columns=tuple(column.named for column in layout.others),
        left_out=tuple(cells_of_readings.left_out),
        row_word=table.word,
    )
