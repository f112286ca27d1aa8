"""The scatter of a table that states no errors, from its repeats."""

from collections.abc import Sequence

import numpy as np

from calibrate.experiment.sample import FEWEST_REPEATS, Scatter

BEFORE_THE_FIT = 0.1
"""Scatter with which a fit begins that estimates it, and ends where nothing tells it.

Of velocities as a share of each, of concentrations as a share of that of the suspension."""
LEAST_SCATTER = 1e-3
"""Scatter, as the same share, below which nothing was ever read."""


def scatter_of_repeats(
    at: Sequence[float], values: Sequence[float], relative: bool
) -> Scatter | None:
    """The scatter of readings about the mean of those at one place; None if there are too few.

    Args:
      at: place of each reading, (N,).
      values: the readings, (N,).
      relative: whether it is a share of the mean.
    """
    places, place, count = np.unique(at, return_inverse=True, return_counts=True)
    value = np.asarray(values, float)
    mean = np.bincount(place, value) / count
    freedom = value.size - places.size
    if freedom < FEWEST_REPEATS:
        return None
    off = value / mean[place] - 1.0 if relative else value - mean[place]
    return Scatter(float(np.sum(off**2) / freedom) ** 0.5, float(freedom), "repeats")
