"""The second-order finish of a fit, and whether it has converged."""

import numpy as np

from calibrate.least_squares import levenberg
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.evaluator import Evaluator
from calibrate.least_squares.levenberg import Point

CONVERGED_BELOW = 1e-4
"""Expected gain in chi-squared of one more Gauss-Newton step at which a fit counts as converged:
0.01 standard deviations. A smooth model ends far below it, one with kinks may not."""


def is_converged(end: Point, box: Bounds) -> bool:
    """True if another Gauss-Newton step promises nothing measurable."""
    return abs(levenberg.step(end, box)[1]) < CONVERGED_BELOW


def finish(evaluator: Evaluator, logs: np.ndarray, most_steps: int) -> tuple[Point, int]:
    """Levenberg-Marquardt from logarithms, (P,); the end and the runs."""
    first = evaluator.at(logs)
    best = first.loss

    def at(logs: np.ndarray) -> Point:
        nonlocal best
        point = evaluator.at(logs)
        best = min(best, point.loss)
        evaluator.tell("finish", best)
        return point

    end, runs = levenberg.minimise(at, first, evaluator.box, most_steps)
    return end, runs + 1
