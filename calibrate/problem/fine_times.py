"""Times between the readings of a curve, so that the predicted curve is a smooth line."""

import inspect
from collections.abc import Sequence

import numpy as np

from calibrate.models.prediction import ForwardModel

INTERVALS = 120
"""Least number of intervals of a curve: no interval is longer than its duration over this
number."""
FEWEST_PARTS = 3
"""Least number of intervals between two readings."""


def takes_times(model: ForwardModel) -> bool:
    """True for a forward model that predicts a curve at any times."""
    return "times" in inspect.signature(model).parameters


def times_between(readings: Sequence[float]) -> np.ndarray:
    """Times of the readings and times between them, from 0 on, for a smooth predicted curve.

    Args:
      readings: times of the readings, s, (R,).

    Returns:
      increasing times, s, which include those of the readings.
    """
    times = np.unique([0.0, *readings])
    widest = times[-1] / INTERVALS
    parts = np.maximum(np.ceil(np.diff(times) / widest), FEWEST_PARTS).astype(int)
    between = [
        np.linspace(first, last, number, endpoint=False)
        for first, last, number in zip(times[:-1], times[1:], parts, strict=True)
    ]
    return np.array([*np.concatenate(between), times[-1]])
