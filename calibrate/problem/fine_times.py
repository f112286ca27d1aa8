"""Times between the readings of a curve, so that what is predicted is a smooth line."""

import inspect
from collections.abc import Sequence

import numpy as np

from calibrate.models.prediction import ForwardModel

INTERVALS = 120
"""Of the time of a curve, at least: no gap between its times is wider."""
FEWEST_PARTS = 3
"""Of the time between two readings."""


def takes_times(model: ForwardModel) -> bool:
    """True for a forward model that predicts a curve at any times."""
    return "times" in inspect.signature(model).parameters


def times_between(readings: Sequence[float]) -> np.ndarray:
    """Times of readings and others between them, from 0 on, so that a predicted curve is smooth.

    Args:
      readings: times of readings, in s, (R,).

    Returns:
      increasing times in s, those of readings among them.
    """
    times = np.unique([0.0, *readings])
    widest = times[-1] / INTERVALS
    parts = np.maximum(np.ceil(np.diff(times) / widest), FEWEST_PARTS).astype(int)
    between = [
        np.linspace(first, last, number, endpoint=False)
        for first, last, number in zip(times[:-1], times[1:], parts, strict=True)
    ]
    return np.array([*np.concatenate(between), times[-1]])
