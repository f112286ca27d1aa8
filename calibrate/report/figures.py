"""Figures of a fit: data and predictions, residuals, profiles, samples, the search."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from calibrate.experiment.units import HEIGHT_UNITS, TIME_UNITS
from calibrate.inference.posterior import Posterior
from calibrate.inference.profile import Profile
from calibrate.least_squares.fit import Fit
from calibrate.models.tube import Tube
from calibrate.problem.problem import Problem
from calibrate.report.formatting import in_unit, spelled
from mrjax.core.text import in_figure
from mrjax.figures import COLUMN, STYLE, column_fields
from mrjax.figures.column_fields import Readings

MARKERS = "osD^v<>p"
"""Markers of the samples, in their order."""
MOST_ACROSS = 4
"""Most panels side by side."""
NO_TUBES: Mapping[str, Tube] = MappingProxyType({})


def figures(
    problem: Problem,
    fit: Fit,
    result: dict[str, Any],
    profiles: tuple[Profile, ...],
    samples: Posterior | None,
    tubes: Mapping[str, Tube] = NO_TUBES,
) -> dict[str, Figure]:
    """The figures of a fit, by the name of their file; `tubes` are those of samples, by name."""
    all_figures = {}
    if any(_is_single(row) for row in result["predictions"]):
        all_figures["predictions"] = predictions_figure(result)
    if any("concentration" in row for row in result["predictions"]):
        all_figures["velocities"] = velocities_figure(result)
    if any(map(_is_of_curve, result["predictions"])):
        all_figures["curves"] = curves_figure(result)
    if tubes:
        all_figures["fields"] = fields_figure(problem, tubes)
    if any("height_m" in row for row in result["predictions"]):
        all_figures["concentrations"] = concentrations_figure(result)
    if any("at" in row for row in result["predictions"]):
        all_figures["readings"] = readings_figure(result)
    all_figures["residuals"] = residuals_figure(result)
    if profiles:
        all_figures["profiles"] = profiles_figure(problem, profiles)
    if samples is not None:
        all_figures["posterior"] = corner_figure(samples)
    all_figures["loss"] = loss_figure(fit)
    return all_figures


def _is_of_curve(row: dict[str, Any]) -> bool:
    """True for a reading of a curve."""
    return "time_s" in row and "height_m" not in row


def _is_single(row: dict[str, Any]) -> bool:
    """True for a measurement that is neither of a curve nor of a table."""
    return not {"time_s", "concentration", "at"} & row.keys()


@STYLE
def readings_figure(result: dict[str, Any]) -> Figure:
    """Readings of a simulator along their axis, and predictions with a band of two errors."""
    rows = sorted(result["predictions"], key=lambda row: row["at"])
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    _draw(axes, [row["at"] for row in rows], rows)
    axes.set_xlabel(in_figure(rows[0]["axis"]))
    unit = rows[0]["unit"]
    quantity = rows[0]["observable"]
    axes.set_ylabel(in_figure(quantity if unit == "1" else f"{quantity}, {unit}"))
    axes.legend()
    return figure


@STYLE
def velocities_figure(result: dict[str, Any]) -> Figure:
    """Measured and predicted velocities against volume fraction, with two standard errors."""
    rows = [row for row in result["predictions"] if "concentration" in row]
    figure, panels = _panels(rows)
    for axes, of_sample in panels:
        of_sample.sort(key=lambda row: row["volume_fraction"])
        fractions = [row["volume_fraction"] for row in of_sample]
        axes.set_yscale("log")
        _draw(axes, fractions, of_sample, least=0.5)
        axes.set_xlabel("volume fraction")
        axes.set_ylabel(f"initial velocity, {of_sample[0]['unit']}")
    axes.legend()
    return figure


@STYLE
def concentrations_figure(result: dict[str, Any]) -> Figure:
    """Measured and predicted volume fractions of each table, against time or height."""
    rows = [row for row in result["predictions"] if "height_m" in row]
    figure, panels = _panels(rows, lambda row: (row["sample"], row["table"]))
    for axes, of_table in panels:
        first = of_table[0]
        axes.set_title(f"sample {in_figure(first['sample'])}\n{in_figure(first['table'])}")
        if any(row["time_s"] != first["time_s"] for row in of_table):
            abscissas = [row["time_s"] / TIME_UNITS[first["time_unit"]] for row in of_table]
            axes.set_xlabel(f"time, {in_unit(2.0, first['time_unit'])[1]}")
        else:
            abscissas = [row["height_m"] / HEIGHT_UNITS[first["height_unit"]] for row in of_table]
            axes.set_xlabel(f"height, {first['height_unit']}")
        _draw(axes, abscissas, of_table)
        axes.set_ylabel("volume fraction" + ("" if first["unit"] == "1" else ", %"))
        axes.set_ylim(bottom=0.0)
    axes.legend()
    return figure


@STYLE
def curves_figure(result: dict[str, Any]) -> Figure:
    """Measured curves with their errors, and predicted ones with a band of two standard errors."""
    rows = [row for row in result["predictions"] if _is_of_curve(row)]
    figure, panels = _panels(rows)
    for axes, of_sample in panels:
        unit = of_sample[0]["time_unit"]
        times = [row["time_s"] / TIME_UNITS[unit] for row in of_sample]
        if curve := result["curves"].get(of_sample[0]["sample"]):
            times_of_curve = np.array(curve["time_s"]) / TIME_UNITS[unit]
            _draw_measured(axes, times, of_sample)
            _draw_predicted(axes, times_of_curve, curve["predicted"], curve["standard_error"])
        else:
            _draw(axes, times, of_sample)
        axes.set_xlabel(f"time, {in_unit(2.0, unit)[1]}")
        unit = of_sample[0]["unit"]
        quantity = spelled(of_sample[0]["observable"])
        axes.set_ylabel(quantity if unit == "1" else f"{quantity}, {unit}")
        axes.set_ylim(0.0, 1.1 * axes.dataLim.y1)  # room for the errors of a level curve
    axes.legend()
    return figure


@STYLE
def fields_figure(problem: Problem, tubes: Mapping[str, Tube]) -> Figure:
    """Volume fraction over time and height in the tube of each sample, with its readings."""
    samples = [sample for sample in problem.experiment.samples if sample.name in tubes]
    figure, all_axes = _grid(len(samples))
    for axes, sample in zip(all_axes, samples, strict=True):
        readings = [
            (
                sample.times[reading.place],
                reading.value
                * reading.si
                * (1.0 if reading.observable == "mudline" else sample.height),
            )
            for reading in sample.readings_of_curve
            if reading.place is not None
        ]
        points = Readings(*zip(*readings, strict=True)) if readings else None
        column_fields.draw(axes, tubes[sample.name], readings=points)
        axes.set_title(f"sample {in_figure(sample.name)}")
    return figure


def _panels(
    rows: list[dict[str, Any]], key: Callable[[dict[str, Any]], Any] = lambda row: row["sample"]
) -> tuple[Figure, list[tuple[Axes, list[dict[str, Any]]]]]:
    """A figure with axes for each sample, or other key, and the predictions to draw there."""
    keys = list(dict.fromkeys(map(key, rows)))
    figure, all_axes = _grid(len(keys))
    of_each = [[row for row in rows if key(row) == key_of_panel] for key_of_panel in keys]
    for axes, rows_of_panel in zip(all_axes, of_each, strict=True):
        axes.set_title(f"sample {in_figure(rows_of_panel[0]['sample'])}")
    return figure, list(zip(all_axes, of_each, strict=False))


def _grid(number: int) -> tuple[Figure, list[Axes]]:
    """A figure with a number of panels."""
    across = min(number, MOST_ACROSS)
    down = -(-number // across)
    figure = Figure(figsize=(COLUMN * across, 2.4 * down), layout="constrained")
    all_axes = list(figure.subplots(down, across, squeeze=False).ravel())
    for axes in all_axes[number:]:
        axes.set_axis_off()
    return figure, all_axes[:number]


def _draw(
    axes: Axes, at: list[float], rows: list[dict[str, Any]], least: float | None = None
) -> None:
    """Draws measured and predicted values at the same positions; arguments as below."""
    _draw_measured(axes, at, rows)
    predicted, errors = ([row[key] for row in rows] for key in ("predicted", "predicted_error"))
    _draw_predicted(axes, at, predicted, errors, least)


def _draw_measured(axes: Axes, at: list[float], rows: list[dict[str, Any]]) -> None:
    """Draws measured values with their errors.

    Args:
      axes: axes to draw on.
      at: position of each value along the axis.
      rows: predictions, as `fit.json` has them.
    """
    axes.errorbar(
        at,
        [row["measured"] for row in rows],
        [row["sigma"] for row in rows],
        fmt="o",
        ms=3,
        color="black",
        capsize=2,
        label="measured",
    )


def _draw_predicted(
    axes: Axes, at: ArrayLike, predicted: ArrayLike, error: ArrayLike, least: float | None = None
) -> None:
    """Draws predicted values with a band of two standard errors.

    Args:
      axes: axes to draw on.
      at: positions along the axis, (K,).
      predicted, error: values and standard errors, (K,).
      least: least lower end of the band, over the prediction, for a logarithmic axis; None if there
        is no limit.
    """
    values, spread = np.asarray(predicted), 2.0 * np.asarray(error)
    axes.plot(at, values, color="0.4", label="predicted")
    if np.isfinite(spread).all():
        low = values - spread
        low = low if least is None else np.maximum(low, least * values)
        axes.fill_between(at, low, values + spread, color="0.85", zorder=0)


@STYLE
def residuals_figure(result: dict[str, Any]) -> Figure:
    """Predicted minus measured, in standard deviations of the measurement."""
    rows = result["predictions"]
    residuals = [(row["predicted"] - row["measured"]) / row["sigma"] for row in rows]
    names = list(dict.fromkeys(row["sample"] for row in rows))
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    axes.axhspan(-2, 2, color="0.92")
    axes.axhline(0, color="0.5", lw=0.8)
    for number, name in enumerate(names):
        of_sample = [place for place, row in enumerate(rows) if row["sample"] == name]
        axes.plot(
            of_sample,
            [residuals[place] for place in of_sample],
            MARKERS[number % len(MARKERS)],
            color="k",
            markerfacecolor=("0.75", "k", "w")[number % 3],
            ms=4,
            label=None if name is None else f"sample {in_figure(name)}",
        )
    axes.set_xticks([])
    axes.set_xlabel("measurements, in their order")
    axes.set_ylabel("(predicted - measured) / sigma")
    axes.set_ylim(-1.1 * max(3.0, *map(abs, residuals)), 1.1 * max(3.0, *map(abs, residuals)))
    if any(names):
        axes.legend()
    return figure


@STYLE
def profiles_figure(problem: Problem, profiles: tuple[Profile, ...]) -> Figure:
    """Increase of chi-squared with each value, and the levels of its intervals."""
    parameter_of = {parameter.variable: parameter for parameter in problem.experiment.parameters}
    figure = Figure(figsize=(0.4 + 1.65 * len(profiles), 1.9), layout="constrained")
    axes_of = figure.subplots(1, len(profiles), squeeze=False, sharey=True)[0]
    for axes, profile in zip(axes_of, profiles, strict=True):
        parameter = parameter_of[profile.name]
        # Between its points a profile is a parabola: its root is linear.
        away = np.sign(np.linspace(-1.0, 1.0, len(profile.values)))
        root = away * np.sqrt(np.maximum(profile.increase, 0.0))
        first, last = np.log(profile.values[[0, -1]])
        logs = np.linspace(first, last, 200)
        increase = np.interp(logs, np.log(profile.values), root) ** 2
        axes.plot([parameter.value(x) for x in np.exp(logs)], increase, color="black")
        for coverage, level in profile.levels.items():
            axes.axhline(level, color="0.6", lw=0.8)
            axes.annotate(coverage, (1.0, level), xycoords=("axes fraction", "data"), ha="right")
        axes.set_ylim(0, max(9.0, 1.5 * max(profile.levels.values())))
        axes.set_xlabel(in_figure(parameter.label))
    axes_of[0].set_ylabel("increase of chi-squared")
    return figure


@STYLE
def corner_figure(samples: Posterior) -> Figure:
    """Samples of every pair of values, with the distribution of each value on the diagonal."""
    import corner

    figure = Figure(figsize=(2.0 * len(samples.names) + 0.6,) * 2)
    corner.corner(
        samples.samples,
        labels=list(map(in_figure, samples.names)),
        fig=figure,
        show_titles=True,
        quiet=True,  # no warnings about contours of few samples
        title_fmt=".4g",
        title_kwargs={"fontsize": 8},
    )
    return figure


@STYLE
def predictions_figure(result: dict[str, Any]) -> Figure:
    """Measured values with their errors, and predicted values beside them."""
    rows = [row for row in result["predictions"] if _is_single(row)]
    units = list(dict.fromkeys(row["unit"] for row in rows))
    figure = Figure(figsize=(0.6 + 2.2 * len(units), 2.4), layout="constrained")
    for axes, unit in zip(figure.subplots(1, len(units), squeeze=False)[0], units, strict=True):
        of_unit = [row for row in rows if row["unit"] == unit]
        places = np.arange(len(of_unit))
        axes.errorbar(
            places - 0.08,
            [row["measured"] for row in of_unit],
            [row["sigma"] for row in of_unit],
            fmt="o",
            color="black",
            capsize=4,
            label="measured",
        )
        axes.plot(
            places + 0.08,
            [row["predicted"] for row in of_unit],
            "D",
            color="0.55",
            markeredgecolor="black",
            label="predicted",
        )
        axes.set_xticks(
            places,
            [_tick(row) for row in of_unit],
        )
        axes.set_xlim(-0.6, len(of_unit) - 0.4)
        highest = max(max(row["measured"] + row["sigma"], row["predicted"]) for row in of_unit)
        lowest = min(min(row["measured"] - row["sigma"], row["predicted"]) for row in of_unit)
        # Room beyond the error bars of a simulator's readings, which may be negative.
        negative = min(row["measured"] for row in of_unit) < 0.0
        axes.set_ylim(1.15 * lowest if negative else 0.0, max(1.15 * highest, 0.0))
        axes.set_ylabel("ratio" if unit == "1" else unit)
    axes.legend()
    return figure


def _tick(row: dict[str, Any]) -> str:
    """The label of a measurement at its tick."""
    if row["sample"] is None:
        return in_figure(row["observable"])
    return f"{in_figure(row['sample'])}\n{spelled(row['observable'])}"


@STYLE
def loss_figure(fit: Fit) -> Figure:
    """Half the sum of squares at each step of the search, and after the finish."""
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    search, end = fit.loss[:-1], fit.loss[-1]
    axes.semilogy(search, ".-", color="0.4", label="search")
    axes.semilogy([len(search)], [end], "D", color="black", label="finish")
    axes.set_xlabel("step")
    axes.set_ylabel("half the sum of squares,\ndata and priors")
    axes.legend()
    return figure
