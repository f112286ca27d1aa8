"""Errors by the data alone, without priors, from profile likelihoods.

The error of a product of powers, c . ln theta, is half the width of an interval about the optimum
of the data. Within it the chi-squared of the measurements, minimised over all else, rises by less
than one. If residuals are linear, the curvature at the fit gives the same error. It does not in a
valley that bends, or for a bed that the mudline has not reached.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from calibrate.inference.curvature import RANK_TOLERANCE, UNKNOWN
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.evaluator import half_square
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from calibrate.least_squares.levenberg import LONGEST, SHORT, Point, minimise
from mrjax.core.promotion import relaxed_promotion

NEAR = 0.03
"""Distance of the root of the rise from one below which a point is the end of an interval."""
MOST_POINTS = 40
"""Most points of the profile on each side."""
MOST_STEPS = 30
"""Most steps of all other values at each point; too few would make the rise too large."""
MOST_STEPS_TO_BEST = 100
"""Most steps to the optimum of the data."""
DONE = 0.01
"""Expected decrease of chi-squared, over the level of the ends, at which the steps at each point
end; a tenth of it at the optimum."""
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
        best = _best(fit, level)
        return np.array([_error(fit, best, direction, level) for direction in directions])


def _best(fit: Fit, level: float) -> Valley:
    """The optimum of the data alone, from the fit."""
    return _minimise_data(fit, np.log(fit.values), None, 0.1 * DONE * level, MOST_STEPS_TO_BEST)


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
    farthest = min(UNKNOWN, _distance_to_bounds(fit, best.logs, sign * direction))
    inner, last = (0.0, 0.0), best.logs  # distance, root of the rise there; valley
    tangent, first = _straight_valley(fit, last, direction)
    unseen_changes = _unseen_changes(fit, best.logs, direction)
    step = first * level**0.5

    def valley_near(logs: np.ndarray, distance: float) -> Valley:
        product = float(direction @ best.logs) + sign * distance
        start = _onto(fit.box, logs, direction, product)
        longest = max(float(np.linalg.norm(start - last)), SHORT)
        return _minimise_data(fit, start, direction, DONE * level, MOST_STEPS, longest)

    for _ in range(MOST_POINTS):
        distance = min(inner[0] + step, farthest)
        step = distance - inner[0]
        trial = last + sign * step * tangent
        valley = valley_near(trial, distance)
        root = _root_of_rise(valley, best, level)
        if root > 1.0 - NEAR:  # an end, unless unseen values can compensate
            alternatives = (valley_near(trial + change, distance) for change in unseen_changes)
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


def _distance_to_bounds(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> float:
    """Greatest change of a product, c . ln theta, that the bounds of its values leave."""
    lower, upper = (np.broadcast_to(end, logs.shape) for end in fit.box)
    ends = np.where(direction > 0.0, upper, lower)
    exponents = np.flatnonzero(direction)
    return float(direction[exponents] @ (ends - logs)[exponents])


def _onto(box: Bounds, logs: np.ndarray, direction: np.ndarray, product: float) -> np.ndarray:
    """The logarithms within the bounds, (P,), nearest to others, at which a product is held.

    Args:
      box: bounds of the logarithms.
      logs: logarithms, (P,).
      direction: exponents of the product, (P,).
      product: c . ln theta, which is possible within the bounds.
    """

    def excess(move: float) -> float:
        return float(direction @ box.clip(logs + move * direction)) - product

    near = product - float(direction @ logs)
    reach = 1.0
    while excess(near - reach) * excess(near + reach) > 0.0 and reach < 1e3 * UNKNOWN:
        reach *= 10.0
    if excess(near) and excess(near - reach) * excess(near + reach) <= 0.0:
        near = brentq(excess, near - reach, near + reach)
    return box.clip(logs + near * direction)


def _minimise_data(
    fit: Fit,
    logs: np.ndarray,
    direction: np.ndarray | None,
    done: float,
    most_steps: int,
    longest: float = LONGEST,
) -> Valley:
    """The least sum of squares of the measurements, with one product of powers held.

    The value with the largest exponent follows from the others. Points at which it is beyond its
    bounds are refused.

    Args:
      fit: the fit, with its residuals.
      logs: logarithms at the start, (P,).
      direction: exponents of the held product, (P,); None to hold none.
      done: expected decrease of chi-squared at which the steps end.
      most_steps: most steps.
      longest: largest first step, in logarithms.
    """
    count = fit.residuals.size
    free = np.eye(logs.size)
    others = np.arange(logs.size)
    if direction is not None:
        pivot = int(np.argmax(np.abs(direction)))
        free[pivot] = -direction / direction[pivot]
        others = np.delete(others, pivot)
        free = free[:, others]
    lower, upper = (np.broadcast_to(end, logs.shape)[others] for end in fit.box)

    def at(places: list[np.ndarray]) -> list[Point]:
        return [point(place) for place in places]

    def point(place: np.ndarray) -> Point:
        position = logs + free @ (place - begin)
        position[others] = place
        if (fit.box.clip(position) != position).any():
            nothing = np.full(count, np.nan)
            return Point(np.inf, place, np.full((count, place.size), np.nan), nothing)
        _, _, jacobian, value = fit.at(position)
        of_data = value[:count]
        return Point(half_square(of_data), place, jacobian[:count] @ free, of_data)

    begin = logs[others]
    first = point(begin)
    if not others.size:
        return Valley(logs, first.loss)
    (end,), _ = minimise(at, [first], Bounds(lower, upper), most_steps, done, longest)
    position = logs + free @ (end.logs - begin)
    position[others] = end.logs
    return Valley(position, end.loss)
