"""Log-normal priors of positive quantities."""

from typing import NamedTuple

import numpy as np


class LogNormal(NamedTuple):
    """A prior: ln(x / median) is normal with this standard deviation."""

    median: float
    """Median, in the unit of the value."""
    log_standard_deviation: float
    """Standard deviation of the natural logarithm; 1."""


def prior_arrays(
    names: tuple[str, ...], priors: dict[str, LogNormal]
) -> tuple[np.ndarray, np.ndarray]:
    """Medians and precisions, (P,) each."""
    median = np.array([priors[n].median if n in priors else 1.0 for n in names])
    spread = np.array([priors[n].log_standard_deviation if n in priors else np.inf for n in names])
    return median, spread**-2.0
