"""The look of all figures: legible in grey, in the widths and font sizes of a paper's columns."""

import matplotlib
import numpy as np

from mrjax.core.run import Run

COLUMN, PAGE = 3.4, 7.0
"""Widths of a figure in one column, and across both; inches."""

STYLE = matplotlib.rc_context(
    {
        "font.size": 8.0,
        "axes.titlesize": 8.0,
        "axes.labelsize": 8.0,
        "xtick.labelsize": 7.0,
        "ytick.labelsize": 7.0,
        "legend.fontsize": 7.0,
        "legend.frameon": False,
        "legend.handlelength": 2.4,
        "axes.linewidth": 0.6,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "xtick.minor.width": 0.4,
        "ytick.minor.width": 0.4,
        "lines.linewidth": 1.0,
        "image.cmap": "gray_r",
        # Labels are made for matplotlib's own mathematics, by `mrjax.core.text.in_figure`.
        "text.usetex": False,
        "text.parse_math": True,
    }
)
"""Decorates what draws a figure; nobody else's settings are touched."""

LINES = (
    {"color": "0.0", "linestyle": "-"},
    {"color": "0.0", "linestyle": "--"},
    {"color": "0.45", "linestyle": "-"},
    {"color": "0.45", "linestyle": "-."},
    {"color": "0.0", "linestyle": ":"},
    {"color": "0.65", "linestyle": "--"},
)
"""Lines that differ without colour."""


def interface(run: Run) -> str:
    """The label of the mudline of a run, or of several."""
    return "bottom of the lowest particle" if np.any(run.rising) else "top of the highest particle"
