"""Optima where slopes jump: found by a simplex, and told from smooth ones."""

from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from calibrate.least_squares import levenberg
from calibrate.least_squares.evaluator import Evaluator, finite, half_square
from calibrate.least_squares.finish import finish, is_converged
from calibrate.least_squares.levenberg import Point

FOUND_AGAIN_WITHIN = 1e-2
"""What a second simplex may gain in chi-squared where the optimum is on a kink: 0.1 standard
deviations."""

SIMPLEX, SIMPLEX_ENDS = 0.5, 0.03
"""Size of a simplex at first, and where it has found an optimum; standard errors."""

MOST_FOR_EACH = 50
"""Most runs of a simplex, for each value."""

AGAIN = 10
"""Most steps of Levenberg-Marquardt from where a simplex led: few from near a smooth optimum."""

ASIDE = 0.3, 0.1
"""Where slopes are compared; standard errors. Of a smooth model they differ by a third at a third
of the distance."""

JUMPS_FROM = 0.6
"""Part of the change of slopes over the longer distance that is left over the shorter on a kink."""

LONGEST_ERROR = 7.0
"""Size of a simplex in logarithms, at most."""


def without_slopes(evaluator: Evaluator, end: Point) -> tuple[Point, bool, int]:
    """Nelder & Mead's simplex (scipy) in standard errors, from where slopes led no further.

    Returns: the end; whether it is an optimum on a kink: a second simplex finds no better, slopes
    lead nowhere from it, and differ to either side; and the runs.
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
    """Steps of one standard error along all that the data or priors determine, (P, K).

    None is longer than a factor of a thousand: one of which next to nothing is known has an error
    without end.
    """
    _, size, directions = np.linalg.svd(end.jacobian, full_matrices=False)
    seen = size > levenberg.resolved(end.jacobian) * size[0]
    return directions[seen].T * np.minimum(1.0 / size[seen], LONGEST_ERROR)


def _jumps(evaluator: Evaluator, end: Point) -> tuple[bool, int]:
    """True if slopes jump near an end: a jump is as large over a shorter distance."""
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
