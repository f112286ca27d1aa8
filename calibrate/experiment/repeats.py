"""The scatter of a table that states no errors, from its repeats."""

from collections.abc import Sequence

import numpy as np

from calibrate.experiment.sample import FEWEST_REPEATS, Scatter

BEFORE_THE_FIT = 0.1
"""First guess of a scatter that the fit estimates, and its value if nothing estimates it.

It is a share of each velocity, and for concentrations a share of that of the suspension."""
LEAST_SCATTER = 1e-3
"""Least scatter of any reading, as the same share."""


def scatter_of_repeats(
    at: Sequence[float], values: Sequence[float], relative: bool
) -> Scatter | None:
    """Scatter of readings about the mean of their repeats; None if there are too few.

    Args:
      at: time, height or concentration of each reading, (N,); it is the same for repeats.
      values: the readings, (N,).
      relative: True for a scatter relative to the mean.
    """
    places, place, count = np.unique(at, return_inverse=True, return_counts=True)
    value = np.asarray(values, float)
    mean = np.bincount(place, value) / count
    freedom = value.size - places.size
    if freedom < FEWEST_REPEATS:
        return None
    off = value / mean[place] - 1.0 if relative else value - mean[place]
    return Scatter(float(np.sum(off**2) / freedom) ** 0.5, float(freedom), "repeats")
