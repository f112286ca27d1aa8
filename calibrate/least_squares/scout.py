"""The search for all optima of a cheap model, from many points side by side."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jax import Array

from calibrate.least_squares.evaluator import half_square
from calibrate.least_squares.interruptible import stoppable
from calibrate.least_squares.levenberg import Point, minimise
from calibrate.least_squares.optima import Optimum, distinct, optimum
from calibrate.least_squares.programs import (
    Given,
    Programs,
    count_residuals,
    given_with,
    prepared,
    side_by_side,
)
from calibrate.least_squares.unknowns import Unknowns
from mrjax.core.promotion import relaxed_promotion

DRAWN = 128
"""Number of points at which the model is evaluated."""
BEST, FIRST = 16, 31
"""Numbers of points from which an optimum is searched: the best ones, which may all be in one
valley, and the first ones, which cover the whole range."""
AT_ONCE = 32
"""Number of points that are evaluated side by side."""
MOST_STEPS = 40
"""Most steps from a point to its optimum."""
DONE = 1e-3
"""Expected decrease of the sum of squares at which these steps end; a fit goes on from there."""


def scout(
    residuals: Callable[..., Array],
    unknown: Unknowns,
    places: np.ndarray,
    robust: float | None = None,
    data: Any = None,
) -> list[Optimum]:
    """Finds the different optima, from the first points and from the best ones.

    Args:
      residuals, robust, data: as for `fit`.
      unknown: the fitted values.
      places: logarithms of the points, (S, P).

    Returns:
      the optima, best first, not finished; empty if the model gives no prediction.
    """
    programs = prepared(residuals, unknown, data, robust)
    given = given_with(unknown, data)
    with stoppable(), relaxed_promotion():
        count = count_residuals(programs, places[0], given) - len(unknown.with_prior)
        evaluate = _evaluate_in_batches(programs, given)
        points = evaluate(list(places))
        best = sorted(points[1 + FIRST :], key=lambda point: point.loss)[:BEST]
        first_points = [point for point in (*points[: 1 + FIRST], *best) if point.finite]
        ends, _ = minimise(evaluate, first_points, unknown.box, MOST_STEPS, DONE)
        different = distinct(ends, places[0], unknown.box, lambda logs: evaluate([logs])[0])
        return [optimum(end, count, finished=False) for end in different]


def _evaluate_in_batches(
    programs: Programs, given: Given
) -> Callable[[list[np.ndarray]], list[Point]]:
    """A function that gives residuals and slopes at any number of points, in batches."""
    program = side_by_side(programs.linearised)

    def at(places: list[np.ndarray]) -> list[Point]:
        points = []
        for first in range(0, len(places), AT_ONCE):
            batch = places[first : first + AT_ONCE]
            filled = np.stack([*batch, *[batch[-1]] * (AT_ONCE - len(batch))])
            results = map(np.asarray, program(filled, given))
            points += [
                Point(half_square(value), logs, jacobian, value)
                for logs, jacobian, value in zip(batch, *results, strict=False)
            ]
        return points

    return at
