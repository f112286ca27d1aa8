"""Optima on kinks, where slopes jump: found by a simplex, and distinguished from smooth optima."""

from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from calibrate.least_squares import levenberg
from calibrate.least_squares.evaluator import Evaluator, finite, half_square
from calibrate.least_squares.finish import finish, is_converged
from calibrate.least_squares.levenberg import Point

FOUND_AGAIN_WITHIN = 1e-2
"""Largest gain in chi-squared of a second simplex at an optimum on a kink: 0.1 standard
deviations."""

SIMPLEX, SIMPLEX_ENDS = 0.5, 0.03
"""Size of a simplex at its start and at its end, in standard errors."""

MOST_FOR_EACH = 50
"""Most model runs of a simplex, for each value."""

AGAIN = 10
"""Most steps of Levenberg-Marquardt after a simplex; few are needed near a smooth optimum."""

ASIDE = 0.3, 0.1
"""Distances at which slopes are compared, in standard errors. Slopes of a smooth model differ by a
third as much at a third of the distance."""

JUMPS_FROM = 0.6
"""Ratio of the change of slopes over the shorter distance to that over the longer one, above which
there is a kink."""

LONGEST_ERROR = 7.0
"""Largest size of a simplex, in logarithms."""


def without_slopes(evaluator: Evaluator, end: Point) -> tuple[Point, bool, int]:
    """Runs Nelder & Mead's simplex (scipy) from an end that slopes do not improve.

    An optimum is on a kink if a second simplex finds nothing better, slopes lead nowhere from it,
    and slopes differ between its sides.

    Returns:
      the end, True if it is an optimum on a kink, and the number of model runs.
    """
    runs, agree = 0, False
    for number, size in enumerate((SIMPLEX, -SIMPLEX, SIMPLEX)):
        result, logs = _simplex(evaluator, end, size)
        resolved = result.success and np.finfo(float).eps * result.fun < FOUND_AGAIN_WITHIN
        agree = bool(number and resolved and 2.0 * end.loss - result.fun < FOUND_AGAIN_WITHIN)
        end, more_runs = finish(evaluator, logs, AGAIN)
        if not 2.0 * end.loss <= result.fun:
            end = evaluator.at(logs)
        runs += result.nfev + more_runs + 1
        if is_converged(end, evaluator.box) or not finite(end.jacobian):
            return end, False, runs
        if agree:
            break
    kink, more_runs = _jumps(evaluator, end)
    return end, agree and kink, runs + more_runs


def _simplex(evaluator: Evaluator, end: Point, size: float) -> tuple[OptimizeResult, np.ndarray]:
    """The result of scipy's simplex about an end, and the logarithms of its best point, (P,)."""
    to_logs = _standard_error_steps(end)
    best = end.loss

    def at(errors: np.ndarray) -> np.ndarray:
        return evaluator.box.clip(end.logs + to_logs @ errors)

    def chi_squared(errors: np.ndarray) -> float:
        nonlocal best
        loss = half_square(np.asarray(evaluator.programs.everything(at(errors), evaluator.given)))
        best = min(best, loss)
        evaluator.tell("simplex", best)
        return 2.0 * loss

    corners = size * np.vstack([np.zeros(to_logs.shape[1]), np.eye(to_logs.shape[1])])
    most = MOST_FOR_EACH * corners.shape[1]
    options: Any = dict(
        initial_simplex=corners, xatol=SIMPLEX_ENDS, fatol=SIMPLEX_ENDS**2, maxfev=most
    )
    result = minimize(chi_squared, corners[0], method="Nelder-Mead", options=options)
    return result, at(result.x)


def _standard_error_steps(end: Point) -> np.ndarray:
    """Steps of one standard error along all directions that data or priors determine, (P, K).

    No step is longer than a factor of a thousand: an error may be almost infinite.
    """
    _, size, directions = np.linalg.svd(end.jacobian, full_matrices=False)
    seen = size > levenberg.resolved(end.jacobian) * size[0]
    return directions[seen].T * np.minimum(1.0 / size[seen], LONGEST_ERROR)


def _jumps(evaluator: Evaluator, end: Point) -> tuple[bool, int]:
    """True if slopes jump near an end, and the number of model runs.

    A jump is as large over a shorter distance; a smooth change is smaller.
    """
    errors, changes = _standard_error_steps(end), []
    for step in ASIDE:
        sides = [
            [
                evaluator.at(end.logs + sign * step * direction).jacobian @ errors
                for direction in errors.T
            ]
            for sign in (1.0, -1.0)
        ]
        after, before = map(np.array, sides)
        changes.append(float(np.abs(after - before).max()))
    far, near = changes
    return near > JUMPS_FROM * far, 4 * errors.shape[1]
