"""Null directions of a Jacobian, asked again far from the fit.

A null direction of the Jacobian is local: along it predictions do not change near the fit. That
they do not change at all is said where they were computed again at a distance.
"""

import numpy as np

from calibrate.inference.identify import Identification
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from mrjax.core.promotion import relaxed_promotion

FACTOR = 10.0
"""On the value that changes most, either way."""
UNCHANGED = 0.01
"""Largest change of a prediction that is none; in standard deviations of its reading."""


def unchanged_at_a_distance(fit: Fit, identification: Identification) -> tuple[str, ...]:
    """The null directions along which predictions are those of the fit a factor of ten away, too.

    Both ways, or as far as the bounds let each value go. Two runs of the model for each direction.

    Args:
      fit: where to begin.
      identification: of it.
    """
    directions = zip(identification.null_directions, identification.null_exponents, strict=True)
    with stoppable(), relaxed_promotion():
        return tuple(name for name, exponents in directions if _unchanged(fit, exponents))


def _unchanged(fit: Fit, exponents: np.ndarray) -> bool:
    direction = np.log(FACTOR) * exponents / np.abs(exponents).max()
    count = fit.residuals.size
    for sign in (-1.0, 1.0):
        lower, upper = (np.broadcast_to(end, direction.shape) for end in fit.box)
        logs, step = np.log(fit.values), sign * direction
        moves = step != 0.0
        room = (np.where(step > 0.0, upper, lower) - logs)[moves] / step[moves]
        _, value = fit.linearised(logs + min(1.0, *room) * step, fit.given)
        change = np.asarray(value)[:count] - fit.residuals
        if not np.abs(change).max() < UNCHANGED:
            return False
    return True
