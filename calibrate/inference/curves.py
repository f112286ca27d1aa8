"""Predicted curves at the times of the readings and between them, with standard errors."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibrate.inference.curvature import covariance, information
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from calibrate.problem.problem import Problem
from mrjax.core.promotion import relaxed_promotion

SHARE = 0.1
"""Step of central differences, in standard deviations along a principal direction of the
covariance. Along a single value, predictions may change far more than its error allows."""

KINK = 0.2
"""Sum of the changes to either side, over the larger of them, above which there is a kink."""


class PredictedCurve(NamedTuple):
    """The predicted curve of a sample, at T times."""

    sample: str
    """Name of the sample."""
    observable: str
    """`mudline` or `sedimentation_ratio`."""
    unit: str
    """Unit of the readings."""
    times: np.ndarray
    """Times, s, (T,)."""
    predicted: np.ndarray
    """Predicted values, (T,) in `unit`."""
    standard_error: np.ndarray
    """Standard errors, from data and priors together, (T,) in `unit`."""


def predicted_curves(problem: Problem, fit: Fit) -> tuple[PredictedCurve, ...]:
    """The predicted curve of each sample that has a curve.

    Args:
      problem: the fitted problem.
      fit: its fit.
    """
    curves = problem.curves
    if not curves:
        return ()
    times = problem.times_of_curves()
    predict = jax.jit(lambda logs: problem.predict_curves(_theta(fit, jnp.exp(logs)), times))

    def at(logs: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(curve) for curve in predict(logs)])

    best = np.log(fit.values)
    variances, axes = np.linalg.eigh(covariance(information(fit))[0])
    deviations = (axes * np.sqrt(np.maximum(variances, 0.0))).T
    with stoppable(), relaxed_promotion():
        predicted = at(best)
        changes = [_change(at, best, predicted, deviation) for deviation in deviations]
    errors = np.sqrt(np.sum(np.square(changes), axis=0))
    ends = np.cumsum([len(times_of_curve) for times_of_curve in times])[:-1]
    pieces = zip(curves, times, np.split(predicted, ends), np.split(errors, ends), strict=True)
    return tuple(
        PredictedCurve(sample.name, reading.observable, reading.unit, at, values, spread)
        for (sample, reading), at, values, spread in pieces
    )


def _change(
    at: Callable[[np.ndarray], np.ndarray],
    best: np.ndarray,
    predicted: np.ndarray,
    deviation: np.ndarray,
) -> np.ndarray:
    """Change of predictions, (T,), over a deviation, (P,), by differences of fourth order.

    At a kink, where a mudline meets its bed, such a difference is neither of the two slopes. The
    change is then the root mean square of those over a whole deviation to either side.
    """

    def sides(share: float) -> np.ndarray:
        """Changes over a share of the deviation, and over the same share backwards; (2, T)."""
        return np.array([at(best + n * share * deviation) - predicted for n in (1.0, -1.0)])

    near, far = sides(SHARE), sides(2.0 * SHARE)
    smooth = (8.0 * (near[0] - near[1]) - (far[0] - far[1])) / (12.0 * SHARE)
    with np.errstate(invalid="ignore"):
        kinked = np.abs(far.sum(axis=0)) > KINK * np.abs(far).max(axis=0)
    if not kinked.any():
        return smooth
    root_mean_square = np.sqrt(np.mean(np.square(sides(1.0)), axis=0))
    return np.where(kinked & np.isfinite(root_mean_square), root_mean_square, smooth)


def _theta(fit: Fit, values: jax.Array) -> dict[str, jax.Array]:
    return dict(zip(fit.names, values, strict=True))
