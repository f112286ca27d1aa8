"""All optima of a model that costs next to nothing: from many places, side by side."""

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
"""Places that are looked at."""
BEST, FIRST = 16, 31
"""Places from which an optimum is looked for: the best, which may all be of one valley, and the
first, which are all over."""
AT_ONCE = 32
"""Places that are looked at side by side."""
MOST_STEPS = 40
"""On the way to it."""


def scout(
    residuals: Callable[..., Array],
    unknown: Unknowns,
    places: np.ndarray,
    robust: float | None = None,
    data: Any = None,
) -> list[Optimum]:
    """The different optima that are found from the first places and the best of all.

    Args:
      residuals, robust, data: as for `fit`.
      unknown: what is fitted.
      places: logarithms, (S, P).

    Returns:
      the optima, best first, none of them finished; none where nothing can be predicted.
    """
    programs = prepared(residuals, unknown, data, robust)
    given = given_with(unknown, data)
    with stoppable(), relaxed_promotion():
        count = count_residuals(programs, places[0], given) - len(unknown.with_prior)
        at = _together(programs, given)
        points = at(list(places))
        best = sorted(points[1 + FIRST :], key=lambda point: point.loss)[:BEST]
        first_points = [point for point in (*points[: 1 + FIRST], *best) if point.finite]
        ends, _ = minimise(at, first_points, unknown.box, MOST_STEPS)
        different = distinct(ends, places[0], unknown.box, lambda logs: at([logs])[0])
        return [optimum(end, count, finished=False) for end in different]


def _together(programs: Programs, given: Given) -> Callable[[list[np.ndarray]], list[Point]]:
    """Residuals and slopes at any number of places, by one program for some at a time."""
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
