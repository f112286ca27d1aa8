"""Half the curvature of chi-squared at a fit, and the covariance that follows."""

import numpy as np

from calibrate.least_squares.fit import Fit

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero. Along such a direction the data
would have to be a million times better to say anything."""

UNKNOWN = 10.0
"""Standard error of a logarithm beyond which nothing is known: a factor of 22,000 either way."""


def information(fit: Fit, error_scale: float = 1.0) -> np.ndarray:
    """Half the curvature of chi-squared, data and priors together, in the logarithms; (P, P).

    Args:
      fit: the fit.
      error_scale: factor on the errors of the measurements.
    """
    return fit.jacobian.T @ fit.jacobian / error_scale**2 + np.diag(fit.prior_precision)


def covariance(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of the logarithms, (P, P), and the unbounded directions, (P, K).

    The covariance leaves the unbounded directions out.

    Args:
      information: half the curvature of chi-squared, (P, P).
    """
    if not np.isfinite(information).all():
        return np.zeros_like(information), np.eye(len(information))
    strength, directions = np.linalg.eigh(information)
    lost = strength < RANK_TOLERANCE**2 * max(strength[-1], np.finfo(float).tiny)
    variance = np.where(lost, 0.0, 1.0 / np.where(lost, 1.0, strength))
    return (directions * variance) @ directions.T, directions[:, lost]


def standard_errors(fit: Fit, error_scale: float = 1.0) -> dict[str, float]:
    """Standard errors of the values, by the slopes of data and priors together.

    Args:
      fit: the fit.
      error_scale: as for `information`.
    """
    spread, unbounded = covariance(information(fit, error_scale))
    unknown = np.sum(unbounded**2, axis=1) > RANK_TOLERANCE
    unknown |= np.sqrt(np.diag(spread)) > UNKNOWN
    return {
        name: float(np.inf if none else value * error)
        for name, value, error, none in zip(
            fit.names, fit.values, np.sqrt(np.diag(spread)), unknown, strict=True
        )
    }
