"""The style of all figures: legible in greyscale, with the widths and font sizes of a paper."""

import matplotlib
import numpy as np

from mrjax.core.run import Run

COLUMN, PAGE = 3.4, 7.0
"""Widths of a figure in one column, and across both columns; inches."""

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
        # `mrjax.core.text.in_figure` escapes labels for matplotlib's own formulas, not for TeX.
        "text.usetex": False,
        "text.parse_math": True,
    }
)
"""Decorator of functions that draw a figure; a user's own settings stay as they are."""

LINES = (
    {"color": "0.0", "linestyle": "-"},
    {"color": "0.0", "linestyle": "--"},
    {"color": "0.45", "linestyle": "-"},
    {"color": "0.45", "linestyle": "-."},
    {"color": "0.0", "linestyle": ":"},
    {"color": "0.65", "linestyle": "--"},
)
"""Line styles that differ without colour."""


def interface(run: Run) -> str:
    """Returns the label of the mudline of a run, or of several."""
    return "bottom of the lowest particle" if np.any(run.rising) else "top of the highest particle"
