"""Sensitivities of observables to parameters: d ln observable / d ln parameter."""

from collections.abc import Mapping

import numpy as np
from jax.typing import ArrayLike
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mrjax.core.errors import InputError
from mrjax.core.text import in_figure
from mrjax.figures.style import COLUMN, LINES, STYLE


@STYLE
def sensitivities(exponents: Mapping[str, ArrayLike], observable: str) -> Figure:
    """A bar for each parameter, the most influential on top.

    An exponent p means that one per cent more of the parameter is p per cent more of what is
    observed.

    Args:
      exponents: d ln observable / d ln parameter by the parameter's name, () each.
      observable: its name.

    Raises:
      InputError: no exponents, or one that is not a finite number.
    """
    values = _finite(exponents, dimensions=0)
    names = sorted(values, key=lambda name: abs(values[name]))
    widths = np.array([values[name] for name in names])
    figure = Figure(figsize=(COLUMN, 0.7 + 0.24 * len(names)), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(names))
    drawn = axes.barh(places, widths, 0.65, color="0.6", edgecolor="k", linewidth=0.6)
    axes.set_yticks(places, map(in_figure, names))
    labels = [f"{width:+.3g}".replace("-", "\N{MINUS SIGN}") for width in widths]
    axes.bar_label(drawn, labels, fontsize=7.0, padding=2)
    axes.axvline(0.0, color="k", linewidth=0.6)
    axes.set_xlabel(f"d ln {in_figure(observable)} / d ln parameter")
    reach = max(1e-300, np.abs(widths).max())
    # Room for the numbers beside the bars.
    axes.set_xlim(
        min(0.0, 1.35 * widths.min(), -0.02 * reach), max(0.02 * reach, 1.35 * widths.max())
    )
    return figure


@STYLE
def sensitivity_curves(
    times: ArrayLike, exponents: Mapping[str, ArrayLike], observable: str
) -> Figure:
    """A line for each parameter along a run.

    Args:
      times: (F,) in s.
      exponents: d ln observable / d ln parameter by the parameter's name, (F,) each; at most 6.
      observable: its name.

    Raises:
      InputError: no exponents, more than there are lines to tell apart, or one that is not a finite
        number at every time.
    """
    values = _finite(exponents, dimensions=1)
    if len(values) > len(LINES):
        raise InputError(f"{len(values)} exponents: give at most {len(LINES)} to tell apart")
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0.0, color="0.8", linewidth=0.6)
    for (name, curve), look in zip(values.items(), LINES, strict=False):
        [line] = axes.plot(np.asarray(times, float), curve, label=in_figure(name))
        line.set(**look)
    axes.set_xlim(float(np.min(times)), float(np.max(times)))
    axes.set_xlabel("time")
    axes.xaxis.set_major_formatter(EngFormatter("s"))
    axes.set_ylabel(f"d ln {in_figure(observable)}\n/ d ln parameter")
    figure.legend(ncols=3, loc="outside upper center")
    return figure


def _finite(exponents: Mapping[str, ArrayLike], dimensions: int) -> dict[str, np.ndarray]:
    if not exponents:
        raise InputError("exponents is empty: give at least one parameter")
    values = {name: np.asarray(value, float) for name, value in exponents.items()}
    for name, value in values.items():
        if value.ndim != dimensions or not np.isfinite(value).all():
            needed = "a number" if dimensions == 0 else "a number for every time"
            raise InputError(f"exponents[{name!r}] = {value}: give {needed}, finite")
    return values
