"""Whether samples reach as far as their posterior does.

Neither weights nor chains tell of a part where no sample is, such as the far end of a bent valley.
Beyond the samples of a value, where others follow it as in a profile likelihood, there must be next
to nothing left.
"""

import numpy as np

from calibrate.inference.density import Density
from calibrate.least_squares.fit import Fit

BEYOND = 3.0
"""Standard deviations of the samples from their mean."""
LEFT = float(np.exp(-2.0))
"""Density there over that at the optimum, from which on something is missing. Of a normal
distribution it is exp(-4.5), of Student's t with five degrees of freedom exp(-4.2)."""
STEPS = 3
"""Of Gauss and Newton, by which the other values follow."""


def ends_early(
    fit: Fit, density: Density, middle: np.ndarray, covariance: np.ndarray
) -> tuple[str, ...]:
    """Names of the values beyond whose samples the posterior goes on.

    A few runs of the model and its slopes for each value.

    Args:
      fit: of the posterior.
      density: of the posterior.
      middle, covariance: of the logarithms of the samples, (P,) and (P, P).
    """
    best = np.log(fit.values)
    enough = float(density.log_density(best, fit.at(best).value)) + np.log(LEFT)
    return tuple(
        name
        for place, name in enumerate(fit.names)
        if any(
            _largest(fit, density, place, middle + sign * offset) > enough
            for offset in [BEYOND * covariance[place] / np.sqrt(covariance[place, place])]
            for sign in (-1.0, 1.0)
        )
    )


def _largest(fit: Fit, density: Density, place: int, logs: np.ndarray) -> float:
    """Logarithm of the density where one value is held and the others follow, if within bounds."""
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
