"""The second-order finish of a fit, and the test of its convergence."""

import numpy as np

from calibrate.least_squares import levenberg
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.evaluator import Evaluator
from calibrate.least_squares.levenberg import Point

CONVERGED_BELOW = 1e-4
"""Expected gain in chi-squared of one more Gauss-Newton step at which a fit counts as converged:
0.01 standard deviations. A smooth model ends far below it, one with kinks may not."""

SETTLED_BELOW = 0.1
"""Expected gain below which an end is an optimum, to be reported beside a better one: 0.3 standard
deviations."""


def is_settled(end: Point, box: Bounds) -> bool:
    """True if another Gauss-Newton step would gain too little to matter."""
    return abs(levenberg.step(end, box)[1]) < SETTLED_BELOW


def is_converged(end: Point, box: Bounds) -> bool:
    """True if another Gauss-Newton step would gain nothing measurable."""
    return abs(levenberg.step(end, box)[1]) < CONVERGED_BELOW


def finish(evaluator: Evaluator, logs: np.ndarray, most_steps: int) -> tuple[Point, int]:
    """Runs Levenberg-Marquardt from logarithms, (P,).

    Returns:
      its end, and the number of model runs.
    """
    first = evaluator.at(logs)
    best = first.loss

    def at(places: list[np.ndarray]) -> list[Point]:
        nonlocal best
        points = [evaluator.at(logs) for logs in places]
        best = min([best, *(point.loss for point in points)])
        evaluator.tell("finish", best)
        return points

    (end,), runs = levenberg.minimise(at, [first], evaluator.box, most_steps)
    return end, runs + 1
