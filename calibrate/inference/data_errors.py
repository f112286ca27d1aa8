"""Errors by the data alone, without priors, from profile likelihoods.

The error of a product of powers, c . ln theta, is half the width of an interval about the optimum
of the data. Within it the chi-squared of the measurements, minimised over all else, rises by less
than one. If residuals are linear, the curvature at the fit gives the same error. It does not in a
valley that bends, or for a bed that the mudline has not reached.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from calibrate.inference.curvature import RANK_TOLERANCE, UNKNOWN
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.evaluator import half_square
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from calibrate.least_squares.levenberg import Point, minimise
from mrjax.core.promotion import relaxed_promotion

NEAR = 0.03
"""Distance of the root of the rise from one below which a point is the end of an interval."""
MOST_POINTS = 40
"""Most points of the profile on each side."""
MOST_STEPS = 30
"""Most steps of all other values at each point; too few would make the rise too large."""
FOLLOWS_FAR = 10.0
"""A value at its bound that moved this many times farther than the product hardly influences it."""
AT_BOUND = 1e-9
"""Distance of a logarithm to its bound below which it is at the bound."""
ALL_OVER = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
"""Trial changes of a value that the data do not see near the fit, in widths of its prior."""
FARTHER = 2.0
"""Largest ratio of a step to the one before."""
TOO_FAR, TOO_LONG = 3.0, 0.3
"""Root of the rise above which a step was too long, and the factor that then shortens it."""


class Valley(NamedTuple):
    """An optimum of the data alone: over all values, or with one product of them held."""

    logs: np.ndarray
    """Logarithms of the values, (P,)."""
    loss: float
    """Half of chi-squared of the measurements."""


def data_errors(fit: Fit, directions: np.ndarray, level: float) -> np.ndarray:
    """Errors by the data alone of the logarithms of products of powers, (K,).

    An error is infinite if chi-squared does not rise by `level` within a factor of e^10 or within
    the bounds.

    Args:
      fit: the fit.
      directions: exponents of the products, unit vectors, (K, P).
      level: rise of chi-squared at the ends of an interval; above one if the errors of the
        measurements are too small.
    """
    if not np.isfinite(fit.jacobian).all() or not np.isfinite(fit.residuals).all():
        return np.full(len(directions), np.inf)
    with stoppable(), relaxed_promotion():
        best = _minimise_data(fit, np.log(fit.values), np.eye(fit.values.size), fit.box)
        return np.array([_error(fit, best, direction, level) for direction in directions])


def _error(fit: Fit, best: Valley, direction: np.ndarray, level: float) -> float:
    ends = []
    for sign in (-1.0, 1.0):
        ends.append(_end_of_interval(fit, best, direction, sign, level))
        if not np.isfinite(ends[-1]):
            return np.inf
    return 0.5 * sum(ends)


def _straight_valley(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, float]:
    """Direction of a straight valley per unit of a product, (P,); distance to a rise of one."""
    jacobian = fit.at(logs).jacobian[: fit.residuals.size]
    if not np.isfinite(jacobian).all():
        return direction, 1.0
    information = jacobian.T @ jacobian
    spread = np.linalg.pinv(information, rcond=RANK_TOLERANCE**2, hermitian=True)
    unseen = direction - spread @ (information @ direction)
    if (share := float(unseen @ unseen)) > RANK_TOLERANCE:
        return unseen / share, 1.0
    variance = float(direction @ spread @ direction)
    return spread @ direction / variance, min(variance**0.5, UNKNOWN)


def _end_of_interval(
    fit: Fit, best: Valley, direction: np.ndarray, sign: float, level: float
) -> float:
    """Distance from the optimum at which chi-squared has risen by `level`; infinite if it does not.

    Args:
      fit: the fit.
      best: the optimum of the data.
      direction: exponents of the held product, (P,).
      sign: -1 or 1, the side of the optimum.
      level: rise of chi-squared.
    """
    free, box = _free_directions(fit, direction)
    farthest = min(UNKNOWN, _distance_to_bound(fit, best.logs, sign * direction))
    inner, last = (0.0, 0.0), best.logs  # distance, root of the rise there; valley
    tangent, first = _straight_valley(fit, last, direction)
    unseen_changes = _unseen_changes(fit, best.logs, direction)
    step = first * level**0.5
    for _ in range(MOST_POINTS):
        distance = min(inner[0] + step, farthest)
        step = distance - inner[0]
        trial = fit.box.clip(last + sign * step * tangent)
        if box is not None:  # a single value is held exactly
            place = int(np.argmax(np.abs(direction)))
            trial[place] = best.logs[place] + sign * distance * direction[place]
        valley = _minimise_data(fit, trial, free, box)
        root = _root_of_rise(valley, best, level)
        if root > 1.0 - NEAR:  # an end, unless unseen values can compensate
            alternatives = (
                _minimise_data(fit, fit.box.clip(trial + change), free, box)
                for change in unseen_changes
            )
            valley = min([valley, *alternatives], key=lambda other: other.loss)
            root = _root_of_rise(valley, best, level)
        if abs(root - 1.0) < NEAR:
            return (
                distance / root
                if _caused_by_data(fit, best.logs, valley.logs, direction)
                else np.inf
            )
        if root < 1.0:
            if distance >= farthest:
                break
            inner, last = (distance, root), valley.logs
            tangent, _ = _straight_valley(fit, last, direction)
            step = min(FARTHER * step, distance * (1.0 / max(root, 1e-9) - 1.0))
        else:
            if step < NEAR * distance:
                # A wall: chi-squared jumps within a step too short to resolve.
                return (
                    distance if _caused_by_data(fit, best.logs, valley.logs, direction) else np.inf
                )
            # A large rise may mean that a long step has left the valley.
            step *= (1.0 - inner[1]) / (root - inner[1]) if root < TOO_FAR else TOO_LONG
    return np.inf


def _root_of_rise(valley: Valley, best: Valley, level: float) -> float:
    """Root of the rise of chi-squared over a level."""
    return max(2.0 * (valley.loss - best.loss) / level, 0.0) ** 0.5


def _unseen_changes(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> list[np.ndarray]:
    """Trial changes of values that the data do not see near the fit, over their whole priors, (P,).

    A bed below all readings is such a value: a higher bed could compensate for a wrong velocity.
    """
    jacobian = fit.at(logs).jacobian[: fit.residuals.size]
    seen = np.linalg.norm(jacobian, axis=0)
    unseen = (seen < RANK_TOLERANCE * max(seen.max(), 1e-300)) & (np.abs(direction) < 1e-12)
    believed = fit.prior_precision > 0.0
    width = np.where(believed, fit.prior_precision, 1.0) ** -0.5
    ways = np.diag(width)[unseen]
    return [share * width_vector for width_vector in ways for share in ALL_OVER]


def _caused_by_data(fit: Fit, best: np.ndarray, logs: np.ndarray, direction: np.ndarray) -> bool:
    """True if the data caused a rise of chi-squared, and not the bounds of the other values.

    A value that reached its bound ten times as far away as the held product hardly influences it.

    Args:
      fit: the fit, with its bounds.
      best: logarithms at the optimum of the data, (P,).
      logs: logarithms at which chi-squared has risen, (P,).
      direction: exponents of the held product, (P,).
    """
    lower, upper = (np.broadcast_to(end, logs.shape) for end in fit.box)
    follows = np.abs(direction) < 1.0 - RANK_TOLERANCE
    stopped = follows & (np.minimum(logs - lower, upper - logs) <= AT_BOUND)
    far = FOLLOWS_FAR * abs(float(direction @ (logs - best)))
    return bool((np.abs(logs - best)[stopped] >= far).all())


def _free_directions(fit: Fit, direction: np.ndarray) -> tuple[np.ndarray, Bounds | None]:
    """Free directions beside a held one, (P, P - 1), and their bounds if they are single values."""
    alone = np.abs(direction) > 1.0 - RANK_TOLERANCE
    if not alone.any():
        return null_space(direction[None]), None
    keep = np.flatnonzero(~alone)
    lower, upper = (np.broadcast_to(end, direction.shape) for end in fit.box)
    return np.eye(direction.size)[:, keep], Bounds(lower[keep], upper[keep])


def _distance_to_bound(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> float:
    """Distance to the bound of a single held value; infinite for a product of several."""
    place = int(np.argmax(np.abs(direction)))
    if abs(direction[place]) < 1.0 - RANK_TOLERANCE:
        return np.inf
    lower, upper = (np.broadcast_to(end, logs.shape)[place] for end in fit.box)
    end = upper if direction[place] > 0.0 else lower
    return float(abs(end - logs[place]))


def _minimise_data(fit: Fit, logs: np.ndarray, free: np.ndarray, box: Bounds | None) -> Valley:
    """The least sum of squares of the measurements along the free directions.

    Args:
      fit: the fit, with its residuals.
      logs: logarithms at the start, (P,).
      free: free directions, (P, F).
      box: bounds along these; None if they are no single values: points beyond the bounds of the
        fit are then refused.
    """
    count = fit.residuals.size

    def at(places: list[np.ndarray]) -> list[Point]:
        return [point(place) for place in places]

    def point(place: np.ndarray) -> Point:
        position = logs + free @ (place - begin)
        if (fit.box.clip(position) != position).any() and box is None:
            nothing = np.full(count, np.nan)
            return Point(np.inf, place, np.full((count, place.size), np.nan), nothing)
        _, _, jacobian, value = fit.at(position)
        of_data = value[:count]
        return Point(half_square(of_data), place, jacobian[:count] @ free, of_data)

    begin = free.T @ logs
    bounds = box or Bounds(np.array(-np.inf), np.array(np.inf))
    first = point(begin)
    if not free.size:
        return Valley(logs, first.loss)
    (end,), _ = minimise(at, [first], bounds, MOST_STEPS)
    return Valley(logs + free @ (end.logs - begin), end.loss)
