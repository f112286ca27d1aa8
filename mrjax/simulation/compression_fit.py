"""Fits the law of a yielding bed, `Compression`, to stresses measured at volume fractions.

    log sigma(phi) = log sigma_0 + log((phi / phi_gel)^k - 1)

by least squares of the logarithm, because the stress grows over decades. The curve of one start is
one correlated whole, so that standard errors come from leaving out one start at a time (jackknife).
"""

from typing import NamedTuple

import numpy as np

from mrjax.continuum.compression import Compression
from mrjax.core.errors import SimulationError

LEAST = 4
"""Points of a curve that a fit of three numbers needs."""
STEEPEST, FLATTEST = 50.0, 0.5
"""Bounds of the exponent."""
LOOSEST = 0.5
"""Lowest gel point of a fit, over the lowest volume fraction that carries a stress. Curves over
decades are nearly powers of phi, which a gel point far below does not change."""


class CompressionFit(NamedTuple):
    """A fitted law, and the covariance of its numbers."""

    compression: Compression
    covariance: np.ndarray  # of (gel_fraction, log stress, exponent), (3, 3); NaN for one start
    fitted: np.ndarray  # True for the volume fractions that were fitted, (K,)


def fit_compression(
    fractions: np.ndarray, stresses: np.ndarray, least_stress: float
) -> CompressionFit:
    """Fits `Compression` to the mean over starts.

    Fitted are the volume fractions from the last one on at which the mean stress is not above
    `least_stress`, or not above twice its standard error.

    Args:
      fractions: volume fractions, ascending, (K,).
      stresses: stress of each start, (M, K) in Pa.
      least_stress: stress above which a point counts, Pa.

    Raises:
      SimulationError: fewer than four points carry a stress, or it does not grow as the law does.
    """
    starts = len(stresses)
    mean = stresses.mean(axis=0)
    error = stresses.std(axis=0, ddof=1) / np.sqrt(starts) if starts > 1 else 0.0 * mean
    below = np.flatnonzero((mean <= least_stress) | (mean <= 2.0 * error))
    fitted = np.arange(len(fractions)) > (below[-1] if below.size else -1)
    if fitted.sum() < LEAST:
        raise SimulationError(
            f"only {fitted.sum()} volume fractions carry a stress above {least_stress:.3g} Pa: "
            "compress further (`end`), in smaller steps (`strain`), or with more `seeds`"
        )
    phi = fractions[fitted]
    values = _fitted(phi, mean[fitted])
    if not 1.01 * FLATTEST < values[2] < 0.99 * STEEPEST:
        raise SimulationError(
            f"the stress does not grow as the law of a column does: its exponent would be "
            f"{values[2]:.3g}; give more `particles` or `seeds`, or a wider range to `end`"
        )
    covariance = np.full((3, 3), np.nan)
    if starts > 1:
        without = (np.delete(stresses, start, axis=0).mean(axis=0) for start in range(starts))
        left_out = np.stack([_fitted(phi, np.maximum(one[fitted], 1e-300)) for one in without])
        spread = left_out - left_out.mean(axis=0)
        covariance = (starts - 1) / starts * spread.T @ spread
    gel, log_stress, exponent = map(float, values)
    law = Compression(gel_fraction=gel, stress=float(np.exp(log_stress)), exponent=exponent)
    return CompressionFit(law, covariance, fitted)


def _fitted(fractions: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Gel point, logarithm of the scale and exponent that fit best; (3,)."""
    from scipy.optimize import least_squares

    target = np.log(stress)
    highest = fractions[0] * (1.0 - 1e-6)

    def shape(values: np.ndarray) -> np.ndarray:
        gel, exponent = values
        return np.log(np.expm1(exponent * np.log(fractions / gel)))

    def residuals(values: np.ndarray) -> np.ndarray:
        # The scale that fits best is that which makes the mean residual zero.
        difference = target - shape(values)
        return difference - difference.mean()

    best = min(
        (
            least_squares(
                residuals,
                [begin * highest, exponent],
                bounds=([LOOSEST * highest, FLATTEST], [highest, STEEPEST]),
                x_scale=[0.1, 5.0],
            )
            for begin in (0.8, 0.95)
            for exponent in (3.0, 10.0)
        ),
        key=lambda result: result.cost,
    )
    gel, exponent = best.x
    return np.array([gel, np.mean(target - shape(best.x)), exponent])
