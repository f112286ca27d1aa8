"""A first guess of the drag from the initial slope of a curve, before any search."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.sample import Sample
from calibrate.experiment.units import CURVES
from calibrate.least_squares.unknowns import Unknowns
from calibrate.models.prediction import initial_rate
from mrjax import terminal_velocity
from mrjax.core.promotion import relaxed_promotion

SHARE = 1.0 / 3.0
"""Share of a curve's fall over which its slope is taken."""
STEPS = 4
"""Newton steps; few suffice, since velocities are nearly powers of most parameters."""
CERTAIN = 1e-6
"""Relative singular value below which a combination of parameters does not change velocities."""


def initial_slope(sample: Sample) -> float | None:
    """Initial settling speed of a curve, m/s; None without a curve, or if it does not fall.

    It is the slope of the straight line through the readings of the first third of the fall.
    """
    curve = [measurement for measurement in sample.measurements if measurement.observable in CURVES]
    if not curve:
        return None
    scale = sample.height if curve[0].observable == "sedimentation_ratio" else 1.0
    heights = np.array(
        [sample.height, *(measurement.value * measurement.si * scale for measurement in curve)]
    )
    times = np.array([0.0, *(sample.times[measurement.place or 0] for measurement in curve)])
    if not heights.min() < heights[0]:
        return None
    least = heights[0] - SHARE * (heights[0] - heights.min())
    early = max(2, int(np.argmax(heights < least))) if (heights < least).any() else times.size
    if np.ptp(times[:early]) == 0.0:
        early += 1
    times, heights = times[:early] - times[:early].mean(), heights[:early]
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = -float(times @ heights / (times @ times))
    return slope if 0.0 < slope < np.inf else None


def with_initial_slopes(
    experiment: Experiment, unknown: Unknowns, places: np.ndarray
) -> np.ndarray:
    """Moves points until terminal velocities match the initial slopes of the curves, (S, P).

    Each point makes the shortest move, in standard deviations of the priors.

    Args:
      experiment: samples and parameters.
      unknown: the fitted parameters.
      places: the points, logarithms of the parameters, (S, P).
    """
    slopes = [initial_slope(sample) for sample in experiment.samples]
    falling_samples = [
        (sample, slope) for sample, slope in zip(experiment.samples, slopes, strict=True) if slope
    ]
    if not falling_samples:
        return places

    def missing(logs: Array) -> tuple[Array, Array]:
        theta = unknown.tree(jnp.exp(logs))
        suspensions = [experiment.suspension_of(sample, theta) for sample, _ in falling_samples]
        falling = [
            initial_rate(sample, suspension) * jnp.mean(terminal_velocity(suspension.parameters))
            for (sample, _), suspension in zip(falling_samples, suspensions, strict=True)
        ]
        logs_of = jnp.log(jnp.stack(falling)) - jnp.log(
            jnp.array([slope for _, slope in falling_samples])
        )
        return logs_of, logs_of

    linearised = jax.jit(jax.vmap(jax.jacfwd(missing, has_aux=True)))
    moved = places
    with relaxed_promotion():
        for _ in range(STEPS):
            slopes_of, mismatch = map(np.asarray, linearised(moved))
            spread = slopes_of * unknown.spread  # each velocity by each parameter, (S, K, P)
            usable = np.isfinite(spread).all(axis=(1, 2)) & np.isfinite(mismatch).all(axis=1)
            inverse = np.linalg.pinv(spread[usable], rcond=CERTAIN)
            steps = np.einsum("spk,sk->sp", inverse, mismatch[usable])
            moved = moved.copy()
            moved[usable] = unknown.box.clip(moved[usable] - unknown.spread * steps)
    return moved
