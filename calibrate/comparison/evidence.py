"""The evidence of data for a fitted model: deviance, BIC, and readings left out.

deviance = chi^2 + SUM (ln x - ln m)^2 / s^2,  BIC = deviance + P ln N

P is the number of fitted values, N that of readings (Schwarz 1978). The sum is over the values of
the plain model with a prior of median m and standard deviation s. The priors of an effect keep its
fit in bounds; they say nothing for or against it. Readings of a file without
stated errors have a standard deviation of their own, whose most likely value leaves
N ln(sum r^2 / N) in place of chi^2. Stated errors are scaled if they are too small for every model.

A reading that is left out is predicted from all others. To first order its residual is then
r / (1 - h), with the leverage h of the reading (Hoaglin & Welsch 1978). Where a reading has most of
the say in its own prediction, h > 1/2, the model is fitted again without it.
"""

from typing import NamedTuple

import numpy as np

from calibrate.comparison.effects import EFFECTS
from calibrate.least_squares import levenberg
from calibrate.least_squares.evaluator import half_square
from calibrate.least_squares.finish import SETTLED_BELOW
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.levenberg import Point
from calibrate.least_squares.leverage import leverages
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import groups_of_scatter

LINEAR_BELOW = 0.5
"""Leverage of a reading above which the model is fitted again without it."""
PARTS = (1.0, 0.3, 0.1, 0.03, 0.01)
"""Parts of a Gauss-Newton step that are tried where it promises a decrease."""
MOST_STEPS = 10
"""Most steps of such a fit, which begins at the values of all readings."""


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
    left_out_residuals: np.ndarray
    """Residual of each reading when it is left out, in stated standard deviations, (N,)."""
    unsettled: float
    """Decrease of chi-squared that one more Gauss-Newton step brings; near 0 at an optimum."""


def evidence(
    problem: Problem, fit: Fit, error_scale: float = 1.0, known: Evidence | None = None
) -> Evidence:
    """The evidence for a fitted model.

    Args:
      problem: the fitted problem.
      fit: its fit.
      error_scale: factor on the stated errors.
      known: evidence of the same fit with other errors, which spares further runs of the model.
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
    residuals = _left_out_residuals(fit) if known is None else known.left_out_residuals
    unsettled = _unsettled(fit) if known is None else known.unsettled
    left_out = residuals**2 / variance
    for places, scatter in estimated:
        left_out[places] += np.log(variance[places] * scatter.value**2)
    count = fit.residuals.size
    return Evidence(
        fit.chi_squared,
        float(deviance),
        len(fit.names),
        float(deviance + len(fit.names) * np.log(count)),
        left_out,
        residuals,
        unsettled,
    )


def _unsettled(fit: Fit) -> float:
    """Decrease by a whole step as expected, or the largest by parts of it if that is much.

    Slopes of a rough model promise more than any step brings.
    """
    here = fit.at(np.log(fit.values))
    change, expected = levenberg.step(here, fit.box)
    if not SETTLED_BELOW < abs(expected) < np.inf:
        return abs(expected)
    losses = [fit.at(here.logs + part * change).loss for part in PARTS]
    return 2.0 * max(here.loss - min(losses), 0.0)


def _left_out_residuals(fit: Fit) -> np.ndarray:
    """Residual of each reading in the fit of all others, in standard deviations, (N,)."""
    leverage = leverages(fit.jacobian, fit.prior_precision)
    linear = leverage < LINEAR_BELOW
    residuals = fit.residuals / (1.0 - np.where(linear, leverage, 0.0))
    for place in np.flatnonzero(~linear):
        residuals[place] = _fitted_without(fit, int(place))
    return residuals


def _fitted_without(fit: Fit, place: int) -> float:
    """Residual of one reading after a fit of all others, in standard deviations."""

    def others(logs: np.ndarray) -> Point:
        point = fit.at(logs)
        counts = np.arange(point.value.size) != place
        return Point(
            half_square(point.value[counts]), logs, point.jacobian[counts], point.value[counts]
        )

    def at(places: list[np.ndarray]) -> list[Point]:
        return list(map(others, places))

    first = others(np.log(fit.values))
    (end,), _ = levenberg.minimise(at, [first], fit.box, MOST_STEPS)
    return float(fit.at(end.logs).value[place])


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
