"""A check of the null directions of the Jacobian far from the fit.

A null direction is local: along it predictions do not change near the fit. The report says that
they do not change at all only if they were computed again at a distance.
"""

import numpy as np

from calibrate.inference.identify import Identification
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from mrjax.core.promotion import relaxed_promotion

FACTOR = 10.0
"""Factor on the value that changes most, up and down."""
UNCHANGED = 0.01
"""Change of a prediction that counts as none, in standard deviations of its measurement."""


def unchanged_at_a_distance(fit: Fit, identification: Identification) -> tuple[str, ...]:
    """Null directions along which predictions do not change up to a factor of ten away.

    Both signs are checked, as far as the bounds allow, with one run of the model each.

    Args:
      fit: the fit.
      identification: identification of the fit.
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
