"""A check that the samples cover the whole posterior.

Neither weights nor chains reveal a part without any sample, such as the far end of a bent valley.
The check moves one value beyond its samples, while the others follow as in a profile likelihood.
The density must be negligible there.
"""

import numpy as np

from calibrate.inference.density import Density
from calibrate.least_squares.fit import Fit

BEYOND = 3.0
"""Distance of that point from the mean of the samples, in their standard deviations."""
LEFT = float(np.exp(-2.0))
"""Density there over that at the optimum, above which samples are missing. A normal distribution
has exp(-4.5), Student's t with five degrees of freedom exp(-4.2)."""
STEPS = 3
"""Gauss-Newton steps by which the other values follow."""


def ends_early(
    fit: Fit, density: Density, middle: np.ndarray, covariance: np.ndarray
) -> tuple[str, ...]:
    """Names of the values whose samples do not cover the posterior.

    Each value takes a few runs of the model with its slopes.

    Args:
      fit: the fit.
      density: density of the posterior.
      middle, covariance: mean and covariance of the logarithms of the samples, (P,) and (P, P).
    """
    best = np.log(fit.values)
    enough = float(density.log_density(best, fit.at(best).value)) + np.log(LEFT)
    return tuple(
        name
        for place, name in enumerate(fit.names)
        if any(
            _largest_log_density(fit, density, place, middle + sign * offset) > enough
            for offset in [BEYOND * covariance[place] / np.sqrt(covariance[place, place])]
            for sign in (-1.0, 1.0)
        )
    )


def _largest_log_density(fit: Fit, density: Density, place: int, logs: np.ndarray) -> float:
    """Largest log-density with one value held; minus infinity if that value is out of bounds."""
    held_value, largest = logs[place], -np.inf
    free = np.arange(logs.size) != place
    for _ in range(1 + STEPS):
        logs = fit.box.clip(logs)
        if logs[place] != held_value:
            return -np.inf
        point = fit.at(logs)
        if not point.finite:
            break
        jacobian, value = point.jacobian, point.value
        largest = max(largest, float(density.log_density(logs, value)))
        if not free.any():
            break
        step, *_ = np.linalg.lstsq(jacobian[:, free], -value, rcond=None)
        logs = logs.copy()
        logs[free] += step
    return largest
