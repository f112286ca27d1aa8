"""The evidence of data for a fitted model: deviance, BIC, and readings left out.

deviance = chi^2 + SUM (ln x - ln m)^2 / s^2,  BIC = deviance + P ln N

P is the number of fitted values, N that of readings (Schwarz 1978). The sum is over the values of
the plain model with a prior of median m and standard deviation s. The priors of an effect keep its
fit in bounds; they say nothing for or against it. Readings of a file without
stated errors have a standard deviation of their own, whose most likely value leaves
N ln(sum r^2 / N) in place of chi^2. Stated errors are scaled if they are too small for every model.

A reading that is left out is predicted from all others, to first order: its residual is
r / (1 - h), with the leverage h of the reading (Hoaglin & Welsch 1978).
"""

from typing import NamedTuple

import numpy as np

from calibrate.comparison.effects import EFFECTS
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.leverage import leverages
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import groups_of_scatter

LARGEST_LEVERAGE = 0.999
"""A reading with more leverage is fitted by itself; leaving it out says nothing to first order."""


class Evidence(NamedTuple):
    """The evidence for one fitted model."""

    chi_squared: float
    """Chi-squared of the readings, in their stated or estimated errors."""
    deviance: float
    """Twice the negative logarithm of likelihood and priors, up to a constant of the data; 1."""
    parameters: int
    """Number P of fitted values."""
    bic: float
    """Deviance + P ln N."""
    left_out: np.ndarray
    """Deviance of each reading when it is left out, (N,)."""


def evidence(problem: Problem, fit: Fit, error_scale: float = 1.0) -> Evidence:
    """The evidence for a fitted model.

    Args:
      problem: the fitted problem.
      fit: its fit.
      error_scale: factor on the stated errors.
    """
    estimated = groups_of_scatter(problem.experiment)
    variance = np.full(fit.residuals.size, error_scale**2)
    deviance = _of_priors(problem, fit)
    stated = np.ones(fit.residuals.size, bool)
    for places, scatter in estimated:
        squares = np.mean(fit.residuals[places] ** 2)
        variance[places] = squares
        deviance += len(places) * np.log(squares * scatter.value**2)
        stated[places] = False
    deviance += np.sum(fit.residuals[stated] ** 2) / error_scale**2
    leverage = np.minimum(leverages(fit.jacobian, fit.prior_precision), LARGEST_LEVERAGE)
    left_out = (fit.residuals / (1.0 - leverage)) ** 2 / variance
    for places, scatter in estimated:
        left_out[places] += np.log(variance[places] * scatter.value**2)
    count = fit.residuals.size
    return Evidence(
        fit.chi_squared,
        float(deviance),
        len(fit.names),
        float(deviance + len(fit.names) * np.log(count)),
        left_out,
    )


def _of_priors(problem: Problem, fit: Fit) -> float:
    """Deviance of the priors of values that the plain model has, too."""
    of_effects = {name for effect in EFFECTS for name in effect.quantities}
    return sum(
        (np.log(x / parameter.prior.median) / parameter.prior.log_standard_deviation) ** 2
        for parameter, x in zip(problem.experiment.parameters, fit.values, strict=True)
        if parameter.prior is not None and parameter.name not in of_effects
    )


def reduced_chi_squared(problem: Problem, fit: Fit) -> float:
    """Chi-squared of the readings with stated errors, for each degree of freedom; 0 without any."""
    stated = np.ones(fit.residuals.size, bool)
    for places, _ in groups_of_scatter(problem.experiment):
        stated[places] = False
    free = int(stated.sum()) - len(fit.names)
    if free < 1:
        return 0.0
    return float(np.sum(fit.residuals[stated] ** 2)) / free
