"""A heat map of a field of a settling column over time and height."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from jax.typing import ArrayLike
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, MaxNLocator

from mrjax.continuum.profile import Column
from mrjax.continuum.sizes.profile import PolydisperseColumn
from mrjax.core.errors import InputError, shown
from mrjax.figures.style import COLUMN, STYLE

LABELS = {
    "volume_fraction": "volume fraction",
    "settling_velocity": "settling velocity, µm/s",
    "solid_stress": "solid stress, Pa",
    "class_fractions": "volume fraction of class",
    "class_velocities": "settling velocity of class",
}
"""Labels of the fields, by name."""
FACTORS = {"settling_velocity": 1e6, "class_velocities": 1e6}
"""Factors from SI units to those of the labels."""
DARKEST = 0.7
"""Shade of the largest value, so that lines remain legible on it."""
SMEARED = 2.5
"""Cells below the mudline without isolines."""
TIME_UNITS = {"days": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0}
LEAST_OF_UNIT = 3.0
"""Least duration in a unit of time for its choice."""


class Readings(NamedTuple):
    """Measured heights of a mudline."""

    times: ArrayLike
    """Times, (R,) in s."""
    heights: ArrayLike
    """Heights, (R,) in m."""


@STYLE
def column_field(
    column: Column | PolydisperseColumn,
    field: str = "volume_fraction",
    *,
    class_number: int | None = None,
    readings: tuple[ArrayLike, ArrayLike] | None = None,
    isolines: Iterable[float] | None = None,
) -> Figure:
    """Draws a field of a settling column over time and height, with isolines and readings.

    Args:
      column: result of `mrjax.column` or `mrjax.polydisperse_column`, not traced.
      field: `volume_fraction`, `settling_velocity` or `solid_stress`; with `class_number` also
        `class_fractions` or `class_velocities`.
      class_number: number of the class, from 0, for fields of classes.
      readings: times, s, and heights, m, of a measured mudline, (R,) each.
      isolines: volume fractions at which lines are drawn; by default some round ones on the volume
        fraction, with lines on its scale, and none on other fields.

    Raises:
      InputError: there is no such field or class, or a value of the field is not finite.
    """
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    points = None if readings is None else Readings(*readings)
    draw(axes, column, field, class_number, points, isolines)
    return figure


def draw(
    axes: Axes,
    column: Column | PolydisperseColumn,
    field: str = "volume_fraction",
    class_number: int | None = None,
    readings: Readings | None = None,
    isolines: Iterable[float] | None = None,
) -> None:
    """Draws on given axes; arguments are those of `column_field`."""
    values, label = _field(column, field, class_number)
    times, levels = np.asarray(column.times, float), np.asarray(column.levels, float)
    unit, seconds = time_unit(times[-1])
    height = float(column.initial_height)
    # Each time covers the interval of the times that are nearest to it.
    middles = 0.5 * (times[1:] + times[:-1])
    time_edges = np.concatenate([times[:1], middles, times[-1:]]) / seconds
    mesh = axes.pcolormesh(
        time_edges,
        np.linspace(0.0, height, levels.size + 1),
        values.T,
        **_shades(values, one_sided=field != "class_velocities"),
        rasterized=True,
    )
    assert axes.figure is not None
    bar = axes.figure.colorbar(mesh, ax=axes, label=label)
    shown_there = field == "volume_fraction"
    if isolines is None and not shown_there:
        isolines = ()
    lines = _draw_isolines(axes, column, isolines, seconds)
    if lines is not None and shown_there:
        bar.add_lines(lines)
    axes.plot(times / seconds, column.mudline, "k-", label="mudline")
    if readings is not None:
        axes.plot(
            np.asarray(readings.times, float) / seconds,
            np.asarray(readings.heights, float),
            "o",
            ms=3,
            color="k",
            markerfacecolor="w",
            label="measured",
        )
    axes.set_xlim(times[0] / seconds, times[-1] / seconds)
    axes.set_ylim(0.0, height)
    axes.set_xlabel(f"time, {unit}")
    axes.set_ylabel("height")
    axes.yaxis.set_major_formatter(EngFormatter("m"))
    axes.legend(loc="lower right" if _rises(column) else "upper right")


def time_unit(duration: float) -> tuple[str, float]:
    """Returns the unit of times of a figure, and its length in s.

    Args:
      duration: last time, s.
    """
    for unit, seconds in TIME_UNITS.items():
        if duration >= LEAST_OF_UNIT * seconds:
            return unit, seconds
    return "s", 1.0


def _shades(values: np.ndarray, one_sided: bool) -> dict[str, Any]:
    """Returns the range of shades, and their map, in which zero is white."""
    least, most = values.min() / DARKEST, values.max() / DARKEST
    if one_sided and -least > most:  # velocities of particles that rise
        return {"vmin": least, "vmax": 0.0, "cmap": "gray"}
    return {"vmin": 0.0 if one_sided else min(0.0, least), "vmax": max(most, 1e-300)}


def _draw_isolines(
    axes: Axes,
    column: Column | PolydisperseColumn,
    isolines: Iterable[float] | None,
    seconds: float,
) -> QuadContourSet | None:
    """Draws lines of equal volume fraction below the mudline; returns them, or None without any."""
    fraction, levels = np.array(column.volume_fraction, float), np.asarray(column.levels)
    if isolines is None:
        isolines = MaxNLocator(5).tick_values(fraction[0].max(), fraction.max())[1:-1]
    mudline = np.asarray(column.mudline)[:, None]
    # Across the mudline, which is smeared over some cells, all lines would be one.
    cell = float(column.initial_height) / len(levels)
    depth = (levels - mudline) if _rises(column) else (mudline - levels)
    fraction[depth < SMEARED * cell] = np.nan
    below = fraction[np.isfinite(fraction)]
    inner = sorted(line for line in isolines if below.size and below.min() < line < below.max())
    if inner and len(levels) > 1 and len(mudline) > 1:
        times = np.asarray(column.times) / seconds
        return axes.contour(times, levels, fraction.T, inner, colors="0.9", linewidths=0.6)
    return None


def _rises(column: Column | PolydisperseColumn) -> bool:
    """True if the bed is under the lid: solid stress is then largest there."""
    stress = np.asarray(column.solid_stress)
    return bool(stress[:, -1].max() > stress[:, 0].max())


def _field(
    column: Column | PolydisperseColumn, field: str, class_number: int | None
) -> tuple[np.ndarray, str]:
    """Returns the values of a field, (T, C), in the unit of its label, and the label.

    Raises:
      InputError: there is no such field or class, or a value is not finite.
    """
    known = [name for name in LABELS if hasattr(column, name)]
    if field not in known:
        raise InputError(f"field = {shown(field)}: must be one of {', '.join(known)}")
    values = np.asarray(getattr(column, field), float) * FACTORS.get(field, 1.0)
    label = LABELS[field]
    if field.startswith("class_"):
        if class_number not in range(values.shape[1]):
            raise InputError(
                f"class_number = {shown(class_number)}: give the number of a class, 0 to "
                f"{values.shape[1] - 1}, for {field}"
            )
        values = values[:, class_number]
        label = f"{label} {class_number}" + (", µm/s" if field == "class_velocities" else "")
    elif class_number is not None:
        raise InputError(f"class_number = {shown(class_number)}: {field} is that of all classes")
    if not np.isfinite(values).all():
        raise InputError(f"{field} of the column is not finite; give a column that is valid")
    return values, label
