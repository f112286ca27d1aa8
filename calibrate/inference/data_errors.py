"""The errors that the data alone leave, by profile likelihood.

The error of a product of powers, c . ln theta, is half the width of the interval about the optimum
of the data in which chi-squared of the measurements rises by less than one, all else free. The
curvature at the fit gives it where residuals are straight; a bed that the mudline has not reached,
or a valley that bends, has another.
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
"""Of the root of the rise to one, at which the end of an interval is read off."""
MOST_POINTS = 40
"""At which the rise is looked at, to either side."""
MOST_STEPS = 30
"""Of everything else, at each of them: too few would make the rise too great."""
FOLLOWS_FAR = 10.0
"""How many times farther what ends at its bound has gone where it hardly matters to a value."""
AT_BOUND = 1e-9
"""Distance of a logarithm to its bound."""
ALL_OVER = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
"""Widths of its prior by which a value is moved that the data do not see near the fit."""
FARTHER = 2.0
"""How many times longer the next step may be."""
TOO_FAR, TOO_LONG = 3.0, 0.3
"""Root of a rise from which a step was too long, and what is left of it."""


class Valley(NamedTuple):
    """The optimum of the data alone near a fit, or of the rest where something is held."""

    logs: np.ndarray
    """(P,)."""
    loss: float
    """Half of chi-squared of the measurements."""


def data_errors(fit: Fit, directions: np.ndarray, level: float) -> np.ndarray:
    """Errors by the data alone of products of powers, in their logarithms, (K,).

    Infinite where chi-squared does not rise by one within a factor of e^10 or the bounds.

    Args:
      fit: where it ended.
      directions: exponents, of length one each, (K, P).
      level: the rise of chi-squared; above one where stated errors are too small.
    """
    if not np.isfinite(fit.jacobian).all() or not np.isfinite(fit.residuals).all():
        return np.full(len(directions), np.inf)
    with stoppable(), relaxed_promotion():
        best = _least(fit, np.log(fit.values), np.eye(fit.values.size), fit.box)
        return np.array([_error(fit, best, direction, level) for direction in directions])


def _error(fit: Fit, best: Valley, direction: np.ndarray, level: float) -> float:
    ends = []
    for sign in (-1.0, 1.0):
        ends.append(_end(fit, best, direction, sign, level))
        if not np.isfinite(ends[-1]):
            return np.inf
    return 0.5 * sum(ends)


def _straight(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, float]:
    """Where a straight valley leads for a unit of a product, (P,), and how far it rises by one."""
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


def _end(fit: Fit, best: Valley, direction: np.ndarray, sign: float, level: float) -> float:
    """Distance from the optimum at which chi-squared has risen by a level; infinite if nowhere.

    Args:
      fit: where it ended.
      best: the optimum of the data.
      direction: what is held, (P,).
      sign: -1 or 1, the side of the optimum.
      level: the rise.
    """
    free, box = _others(fit, direction)
    farthest = min(UNKNOWN, _room(fit, best.logs, sign * direction))
    inner, last = (0.0, 0.0), best.logs  # distance, root of the rise there, and the valley
    tangent, first = _straight(fit, last, direction)
    elsewhere = _elsewhere(fit, best.logs, direction)
    step = first * level**0.5
    for _ in range(MOST_POINTS):
        distance = min(inner[0] + step, farthest)
        step = distance - inner[0]
        trial = fit.box.clip(last + sign * step * tangent)
        if box is not None:  # one value is held, to the last digit
            place = int(np.argmax(np.abs(direction)))
            trial[place] = best.logs[place] + sign * distance * direction[place]
        valley = _least(fit, trial, free, box)
        root = _root(valley, best, level)
        if root > 1.0 - NEAR:  # an end, unless what is not seen near the fit makes up for it
            alternatives = (
                _least(fit, fit.box.clip(trial + change), free, box) for change in elsewhere
            )
            valley = min([valley, *alternatives], key=lambda other: other.loss)
            root = _root(valley, best, level)
        if abs(root - 1.0) < NEAR:
            return distance / root if _by_data(fit, best.logs, valley.logs, direction) else np.inf
        if root < 1.0:
            if distance >= farthest:
                break
            inner, last = (distance, root), valley.logs
            tangent, _ = _straight(fit, last, direction)
            step = min(FARTHER * step, distance * (1.0 / max(root, 1e-9) - 1.0))
        else:
            if step < NEAR * distance:
                # A wall: chi-squared jumps within a step too short to resolve.
                return distance if _by_data(fit, best.logs, valley.logs, direction) else np.inf
            # What rises so much may be no valley: a step that was too long left it.
            step *= (1.0 - inner[1]) / (root - inner[1]) if root < TOO_FAR else TOO_LONG
    return np.inf


def _root(valley: Valley, best: Valley, level: float) -> float:
    """Root of the rise of chi-squared over a level."""
    return max(2.0 * (valley.loss - best.loss) / level, 0.0) ** 0.5


def _elsewhere(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> list[np.ndarray]:
    """Changes of values that the data do not see near the fit, all over their priors, (P,) each.

    A bed that no reading has met makes up for a wrong velocity where it is higher.
    """
    jacobian = fit.at(logs).jacobian[: fit.residuals.size]
    seen = np.linalg.norm(jacobian, axis=0)
    unseen = (seen < RANK_TOLERANCE * max(seen.max(), 1e-300)) & (np.abs(direction) < 1e-12)
    believed = fit.prior_precision > 0.0
    width = np.where(believed, fit.prior_precision, 1.0) ** -0.5
    ways = np.diag(width)[unseen]
    return [share * width_vector for width_vector in ways for share in ALL_OVER]


def _by_data(fit: Fit, best: np.ndarray, logs: np.ndarray, direction: np.ndarray) -> bool:
    """True if the data made a rise, and not the bounds of what follows.

    What has gone to its bound, ten times as far as the product that is held, hardly matters
    to that.

    Args:
      fit: knows the bounds.
      best: the optimum of the data, (P,).
      logs: where chi-squared has risen, (P,).
      direction: what is held, (P,).
    """
    lower, upper = (np.broadcast_to(end, logs.shape) for end in fit.box)
    follows = np.abs(direction) < 1.0 - RANK_TOLERANCE
    stopped = follows & (np.minimum(logs - lower, upper - logs) <= AT_BOUND)
    far = FOLLOWS_FAR * abs(float(direction @ (logs - best)))
    return bool((np.abs(logs - best)[stopped] >= far).all())


def _others(fit: Fit, direction: np.ndarray) -> tuple[np.ndarray, Bounds | None]:
    """Directions that are free where one is held, (P, P - 1), and bounds where these are values."""
    alone = np.abs(direction) > 1.0 - RANK_TOLERANCE
    if not alone.any():
        return null_space(direction[None]), None
    keep = np.flatnonzero(~alone)
    lower, upper = (np.broadcast_to(end, direction.shape) for end in fit.box)
    return np.eye(direction.size)[:, keep], Bounds(lower[keep], upper[keep])


def _room(fit: Fit, logs: np.ndarray, direction: np.ndarray) -> float:
    """Distance up to which the bounds let a value go that is held alone."""
    place = int(np.argmax(np.abs(direction)))
    if abs(direction[place]) < 1.0 - RANK_TOLERANCE:
        return np.inf
    lower, upper = (np.broadcast_to(end, logs.shape)[place] for end in fit.box)
    end = upper if direction[place] > 0.0 else lower
    return float(abs(end - logs[place]))


def _least(fit: Fit, logs: np.ndarray, free: np.ndarray, box: Bounds | None) -> Valley:
    """The least sum of squares of the measurements, from a place and along what is free.

    Args:
      fit: knows the residuals.
      logs: where to begin, (P,).
      free: directions that are free, (P, F).
      box: bounds of these; None where they are no values: then nothing beyond those of the fit is
        asked for.
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
