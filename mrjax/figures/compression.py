"""The figure of a compressive yield stress: measured stresses and the law of a column."""

import numpy as np
from matplotlib.figure import Figure

from mrjax.figures.style import COLUMN, STYLE
from mrjax.simulation.compressive_yield import CompressiveYield

LOWEST = 1e-3
"""Lowest stress drawn, over F_c / d^2."""


@STYLE
def compressive_yield(result: CompressiveYield) -> Figure:
    """Draws stress over F_c / d^2 against volume fraction, and the fitted law.

    Stresses are means over the starts with their standard errors.

    Args:
      result: stresses of a compressed box, from `mrjax.compressive_yield`.
    """
    stress = result.stress / result.scale
    error = np.nan_to_num(result.standard_error / result.scale)
    shown = stress > LOWEST
    law = result.compression
    smooth = np.linspace(float(law.gel_fraction), result.volume_fraction[-1], 400)[1:]
    figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
    axes = figure.subplots()
    axes.errorbar(
        result.volume_fraction[shown],
        stress[shown],
        error[shown],
        fmt="ko",
        ms=3,
        elinewidth=0.7,
        label=f"{len(result.seeds)} starts",
    )
    label = rf"$\phi_{{gel}}$ = {float(law.gel_fraction):.3f}, k = {float(law.exponent):.2f}"
    axes.plot(smooth, np.asarray(law.solid_stress(smooth)) / result.scale, color="0.5", label=label)
    axes.set_yscale("log")
    axes.set_ylim(bottom=LOWEST)
    axes.set_xlabel("volume fraction")
    axes.set_ylabel(f"stress / ($F_c/d^2$ = {result.scale:.3g} Pa)")
    axes.legend()
    return figure
