"""Agreement of readings with the model within their stated errors, and with each other.

Of M readings and K combinations that they determine, near the fit at least, chi-squared is
distributed as that of M - K degrees of freedom, if the model is right and the errors are as stated.
Stated errors are often too small, so that p alone refuses many a good fit: readings contradict the
model where their residuals are large beside the readings themselves, too.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from calibrate.inference.identify import LARGEST_CHI_SQUARED, Identification
from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem

LEAST_P, LARGEST_SHARE = 1e-6, 0.05
"""Beyond the first a fit is a misfit; beyond both, readings contradict the model or each other."""


class Agreement(NamedTuple):
    """Agreement of a fit with its readings."""

    degrees_of_freedom: int
    reduced_chi_squared: float
    p_value: float | None
    """How often chi-squared would be as large by chance; None where nothing is left to compare,
    or where outliers count less."""
    share: float
    """Root mean square of the residuals over the range of the readings of each kind."""
    error_scale: float
    """By what stated errors would have to grow for chi-squared to be as expected; at least 1."""

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
    """Root mean square of residuals over ranges; of one reading its size is the range."""
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
