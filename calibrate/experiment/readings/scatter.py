"""The scatter of readings without a stated error, estimated from the readings themselves.

Each reading is compared with the line through those before and after it. With scatter of
standard deviation s its distance to that line has s (1 + w^2 + (1 - w)^2)^(1/2), where w is the
weight of the one before. Repeats at one time are compared with their mean. The bend of the curve
counts as scatter, so that few readings give a large error.
"""

import numpy as np

FEWEST = 3
"""Distances below which the scatter is taken from the height alone."""
WITHOUT_READINGS = 0.01
"""Of the height of the suspension: the error of readings that are too few to tell."""
LEAST = 1e-3
"""Of the height of the suspension: no reading by eye or camera is better."""
MEDIAN_OF_NORMAL = 0.6745
"""Median of the absolute value of a standard normal number."""


def scatter(times: list[float], values: list[float], height: float) -> float:
    """The estimated standard deviation of a reading, in the unit of the values.

    Args:
      times: of the readings, in order, (T,).
      values: of the readings, (T,).
      height: of the suspension, in the unit of the values.
    """
    time, place, count = np.unique(times, return_inverse=True, return_counts=True)
    read = np.asarray(values, float)
    mean = np.bincount(place, read) / count
    repeated = count[place] > 1
    distances = [
        ((read - mean[place]) / np.sqrt(1.0 - 1.0 / np.maximum(2, count[place])))[repeated]
    ]
    if time.size > 2:
        weight = (time[2:] - time[1:-1]) / (time[2:] - time[:-2])
        line = weight * mean[:-2] + (1.0 - weight) * mean[2:]
        variance = 1 / count[1:-1] + weight**2 / count[:-2] + (1 - weight) ** 2 / count[2:]
        distances.append((mean[1:-1] - line) / np.sqrt(variance))
    every = np.abs(np.concatenate(distances))
    if every.size < FEWEST:
        return WITHOUT_READINGS * height
    return max(float(np.median(every)) / MEDIAN_OF_NORMAL, LEAST * height)
