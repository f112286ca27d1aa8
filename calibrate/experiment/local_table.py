"""Concentrations at a height or at a time, as measurements."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from calibrate.experiment.readings import concentrations, local_concentrations
from calibrate.experiment.readings.local_concentrations import LocalConcentrations
from calibrate.experiment.readings.sheet import LocalSheet
from calibrate.experiment.repeats import BEFORE_THE_FIT, LEAST_SCATTER, scatter_of_repeats
from calibrate.experiment.sample import LocalTable, Measurement, Point, Scatter
from calibrate.experiment.units import RATIO_UNITS, TIME_UNITS
from mrjax import InputError, Recipe

THICKNESS = 0.01
"""Default thickness of the layer that a reading averages over, as a share of the height."""


def read_all(
    sheets: Sequence[LocalSheet], folder: Path, recipe: Recipe, height: float
) -> tuple[list[LocalTable], list[Measurement]]:
    """Reads the tables of a sample; gives them and their measurements.

    Args:
      sheets: the files and their settings.
      folder: folder of the experiment file.
      recipe: recipe, whose densities give volume fractions.
      height: height of the suspension, m.

    Raises:
      InputError: a file that cannot be used, or a height above that of the suspension.
    """
    tables: list[LocalTable] = []
    measurements: list[Measurement] = []
    for sheet in sheets:
        name = _name(sheet, (table.name for table in tables))
        table_read = _read(sheet, folder, recipe, height)
        tables.append(
            LocalTable(name, table_read.unit, table_read.understood, _scatter(table_read, recipe))
        )
        measurements += _measurements(sheet, table_read, tables[-1], len(measurements))
    return tables, measurements


def _name(sheet: LocalSheet, names: Iterable[str]) -> str:
    """Name of a table, with a number if another table has the same height or time."""
    kind = "concentration" if sheet.height is not None else "profile"
    name = f"{kind} {local_concentrations.said_place(sheet)}"
    alike = sum(other.split(", table")[0] == name for other in names)
    return f"{name}, table {alike + 1}" if alike else name


def _read(sheet: LocalSheet, folder: Path, recipe: Recipe, height: float) -> LocalConcentrations:
    for key, value in (("height", sheet.height), ("thickness", sheet.thickness)):
        if value is not None and value > height:
            raise InputError(
                f"concentration.{key} = {value:g} m is above the height of the suspension, "
                f"{height:g} m; mend one"
            )

    def fraction(kind: str, value: float) -> float:
        return concentrations.local_fraction(kind, value, recipe)

    thickness = _thickness(sheet, height)
    return local_concentrations.read(sheet, folder, fraction, height, thickness)


def _thickness(sheet: LocalSheet, height: float) -> float:
    return THICKNESS * height if sheet.thickness is None else sheet.thickness


def _scatter(table_read: LocalConcentrations, recipe: Recipe) -> Scatter | None:
    """Scatter of a table in its unit, from repeats or a first guess; None if errors are stated."""
    if table_read.understood.errors == "stated":
        return None
    size = recipe.volume_fraction / RATIO_UNITS[table_read.unit]
    values = [reading.value / RATIO_UNITS[table_read.unit] for reading in table_read.readings]
    repeated = scatter_of_repeats(
        [reading.at for reading in table_read.readings], values, relative=False
    )
    if repeated is None:
        return Scatter(BEFORE_THE_FIT * size, 0.0, "assumed")
    return repeated._replace(value=max(repeated.value, LEAST_SCATTER * size))


def _measurements(
    sheet: LocalSheet, table_read: LocalConcentrations, table: LocalTable, first: int
) -> list[Measurement]:
    """Measurements of a table; `first` is the index of the first one among those of its sample."""
    si = RATIO_UNITS[table_read.unit]
    thickness = table_read.understood.thickness
    measurements = []
    for place, reading in enumerate(table_read.readings, start=first):
        if sheet.height is not None:
            point = Point(
                sheet.height, reading.at, thickness, place, table.name, "m", table_read.axis.unit
            )
        else:
            unit = sheet.time_unit or "s"
            time = (sheet.time or 0.0) * TIME_UNITS[unit]
            point = Point(
                reading.at, time, thickness, place, table.name, table_read.axis.unit, unit
            )
        error = reading.error / si if table.scatter is None else table.scatter.value
        measurements.append(
            Measurement(
                "volume_fraction",
                reading.value / si,
                error,
                table_read.unit,
                si,
                row=reading.row,
                point=point,
            )
        )
    return measurements
