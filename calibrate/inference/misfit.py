"""Agreement of the readings with the model, and with each other, within their errors.

Let M readings determine K combinations of the parameters near the fit. If the model is right and
the errors are as stated, chi-squared is distributed with M - K degrees of freedom. Stated errors
are often too small, so the p-value alone would reject many good fits. Readings therefore contradict
the model only if their residuals are also large in comparison with the range of the readings.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from calibrate.inference.identify import LARGEST_CHI_SQUARED, Identification
from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem

LEAST_P, LARGEST_SHARE = 1e-6, 0.05
"""Limits of the p-value, and of residuals over range. Beyond the first a fit is a misfit; beyond
both the readings contradict the model or each other."""


class Agreement(NamedTuple):
    """Agreement of a fit with its readings."""

    degrees_of_freedom: int
    reduced_chi_squared: float
    p_value: float | None
    """Probability of a chi-squared at least as large; None without degrees of freedom, and for a
    robust fit."""
    share: float
    """Root mean square of the residuals, each over the range of the readings of its kind."""
    error_scale: float
    """Factor on the errors that would bring chi-squared to its expectation; at least 1."""

    @property
    def misfit(self) -> bool:
        """True if the errors do not cover the residuals."""
        by_chance = self.p_value is None or self.p_value >= LEAST_P
        return self.reduced_chi_squared > LARGEST_CHI_SQUARED or not by_chance

    @property
    def contradicts(self) -> bool:
        """True if no plausible error covers the residuals."""
        return self.p_value is not None and self.p_value < LEAST_P and self.share > LARGEST_SHARE


def agreement(
    problem: Problem, fit: Fit, identification: Identification, predicted: np.ndarray
) -> Agreement:
    """The agreement of predictions, (M,), with the readings of a problem."""
    known = len(identification.combinations) + len(identification.near_combinations)
    free = len(predicted) - known
    reduced = fit.chi_squared / max(1, free)
    testable = free > 0 and fit.robust is None
    return Agreement(
        free,
        reduced,
        float(chi2.sf(fit.chi_squared, free)) if testable else None,
        _share(problem, predicted),
        max(1.0, reduced**0.5),
    )


def _share(problem: Problem, predicted: np.ndarray) -> float:
    """Root mean square of residuals over ranges; a single reading counts its size as its range."""
    kinds = [
        (measurement.observable, measurement.value * measurement.si)
        for _, measurement in problem.measurements
    ]
    range_of = {}
    for kind in {kind for kind, _ in kinds}:
        values = [value for other, value in kinds if other == kind]
        range_of[kind] = (max(values) - min(values)) or max(map(abs, values)) or 1.0
    si = np.array([measurement.si for _, measurement in problem.measurements])
    ranges = np.array([range_of[kind] for kind, _ in kinds])
    with np.errstate(invalid="ignore"):
        return float(np.sqrt(np.mean(((predicted - problem.measured) * si / ranges) ** 2)))
