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
    """Draws a bar for each parameter, with the most influential parameter on top.

    An exponent p means that the observable rises by p per cent if the parameter rises by one per
    cent.

    Args:
      exponents: d ln observable / d ln parameter, by the name of the parameter, () each.
      observable: name of the observable.

    Raises:
      InputError: there are no exponents, or one is not a finite number.
    """
    values = _finite(exponents, dimensions=0)
    names = sorted(values, key=lambda name: abs(values[name]))
    widths = np.array([values[name] for name in names])
    figure = Figure(figsize=(COLUMN, 0.7 + 0.24 * len(names)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(names))
    bars = axes.barh(rows, widths, 0.65, color="0.6", edgecolor="k", linewidth=0.6)
    axes.set_yticks(rows, map(in_figure, names))
    labels = [f"{width:+.3g}".replace("-", "\N{MINUS SIGN}") for width in widths]
    axes.bar_label(bars, labels, fontsize=7.0, padding=2)
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
    """Draws a line for each parameter over time.

    Args:
      times: times, (F,) in s.
      exponents: d ln observable / d ln parameter, by the name of the parameter, (F,) each; at most
        six, because there are six line styles.
      observable: name of the observable.

    Raises:
      InputError: there are no exponents, too many, or one is not a finite number at every time.
    """
    values = _finite(exponents, dimensions=1)
    if len(values) > len(LINES):
        raise InputError(f"{len(values)} exponents: give at most {len(LINES)} to tell apart")
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0.0, color="0.8", linewidth=0.6)
    for (name, curve), style in zip(values.items(), LINES, strict=False):
        [line] = axes.plot(np.asarray(times, float), curve, label=in_figure(name))
        line.set(**style)
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
