"""The scatter of readings without a stated error, estimated from the readings themselves.

Each reading is compared with the parabola through three neighbours on both sides of it, or with the
line through two neighbours if readings are few. For readings of standard deviation s the distance
has the standard deviation s (1 + w . w)^(1/2), where w are the weights of the neighbours. Repeats
at one time are compared with their mean. A bend that the parabola does not follow counts as
scatter, so that a sparse curve has a large error.
"""

import numpy as np

FEWEST = 3
"""Fewest distances for an estimate; with fewer the scatter follows from the height alone."""
WITHOUT_READINGS = 0.01
"""Error of too few readings for an estimate, as a share of the height of the suspension."""
LEAST = 1e-3
"""Least error by eye or camera, as a share of the height of the suspension."""
MEDIAN_OF_NORMAL = 0.6745
"""Median of the absolute value of a standard normal number."""
FOR_A_PARABOLA = 5
"""Fewest different times for parabolas."""


def scatter(times: list[float], values: list[float], height: float) -> float:
    """The estimated standard deviation of a reading, in the unit of the values.

    Args:
      times: times of the readings, in order, (T,).
      values: values of the readings, (T,).
      height: height of the suspension, in the unit of the values.
    """
    time, place, count = np.unique(times, return_inverse=True, return_counts=True)
    read = np.asarray(values, float)
    mean = np.bincount(place, read) / count
    spread = np.sqrt(1.0 - 1.0 / np.maximum(2, count[place]))
    distances = [((read - mean[place]) / spread)[count[place] > 1]]
    neighbours = 3 if time.size >= FOR_A_PARABOLA else 2
    with np.errstate(all="ignore"):  # weights are unbounded if times differ by rounding
        for inner in range(1, neighbours):
            distances.append(_from_polynomial(time, mean, 1.0 / count, neighbours, inner))
    sizes = np.abs(np.concatenate(distances))
    sizes = sizes[np.isfinite(sizes)]
    if sizes.size < FEWEST:
        return WITHOUT_READINGS * height
    return max(float(np.median(sizes)) / MEDIAN_OF_NORMAL, LEAST * height)


def _from_polynomial(
    time: np.ndarray, mean: np.ndarray, variance: np.ndarray, neighbours: int, inner: int
) -> np.ndarray:
    """Distances of readings to the polynomial through neighbours, over their spread for s = 1.

    Args:
      time: different times in order, (T,).
      mean: readings at them, (T,).
      variance: variance of the readings for s = 1, (T,).
      neighbours: readings that the polynomial goes through.
      inner: how many of them come before the one that is compared.
    """
    windows = np.arange(max(0, time.size - neighbours))[:, None] + np.arange(neighbours + 1)
    own, others = windows[:, inner], np.delete(windows, inner, axis=1)
    distance, square = mean[own].copy(), variance[own].copy()
    for neighbour in range(neighbours):
        rest = time[np.delete(others, neighbour, axis=1)]
        at, node = time[own][:, None], time[others[:, neighbour]][:, None]
        weight = np.prod((at - rest) / (node - rest), axis=1)  # Lagrange weights
        distance -= weight * mean[others[:, neighbour]]
        square += weight**2 * variance[others[:, neighbour]]
    return distance / np.sqrt(square)
