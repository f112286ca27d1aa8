"""Warnings about a fit, and notes on it."""

from collections.abc import Iterator

import numpy as np

from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem
from calibrate.report.fronts import unresolved_fronts
from mrjax.laws import dimensionless

KINK = (
    "the optimum is where slopes jump, as where a mudline meets its bed at the time of a "
    "measurement: it was found without slopes, and errors and intervals are those of one side"
)

ONE_PLACE = (
    "an optimum was searched from a single start, so that better ones may exist: fit again with "
    "--starts 8, or starts=8 in Python"
)

SURPRISING = 3.0
"""Distance of a value from the median of its prior, in standard deviations, that is a warning."""
FASTER = 2.0
"""Ratio of the fitted speed to that of a single particle above which there is a warning."""


def warnings(
    problem: Problem, fit: Fit, validity_of: dict[str, tuple[dimensionless.Number, ...]]
) -> list[str]:
    """Warnings about a fit: odd readings, invalid models, surprising values, unreliable slopes.

    Args:
      problem: the fitted problem.
      fit: its fit.
      validity_of: dimensionless numbers of each sample, by its name.
    """
    return [
        *problem.experiment.warnings,
        *(
            f"sample {name}: {warning}"
            for name, numbers in validity_of.items()
            for warning in dimensionless.warnings(numbers)
        ),
        *_against_priors(problem, fit),
        *_faster_than_alone(problem, fit),
        *_unreliable_slopes(problem, fit),
    ]


def _against_priors(problem: Problem, fit: Fit) -> Iterator[str]:
    """Warnings about values far from their priors."""
    for place, parameter in enumerate(problem.experiment.parameters):
        prior = problem.priors.get(parameter.variable)
        if prior is None:
            continue
        deviations = np.log(fit.values[place] / prior.median) / prior.log_standard_deviation
        if abs(deviations) > SURPRISING:
            yield (
                f"{parameter.label} = {parameter.value(fit.values[place]):.4g} is "
                f"{abs(deviations):.2g} standard deviations of its prior from its median, "
                f"{parameter.value(prior.median):.4g}: data and prior contradict each other; "
                "check units, the model and the prior"
            )


def fronts(problem: Problem, predicted: np.ndarray) -> list[str]:
    """Warnings about sharp fronts between readings of concentrations."""
    return [
        warning
        for sample, places in problem.experiment.by_sample()
        for warning in unresolved_fronts(sample, list(map(float, predicted[places])))
    ]


def _faster_than_alone(problem: Problem, fit: Fit) -> Iterator[str]:
    """Warnings about samples that fall faster than one of their particles would alone."""
    for sample in problem.experiment.samples:
        parameters = problem.experiment.suspension_of(sample, fit.theta).parameters
        drag = float(np.mean(parameters.f_w * parameters.f_s * parameters.f_v))
        if drag * FASTER < 1.0:
            yield (
                f"sample {sample.name}: as fitted it falls {1.0 / drag:.3g} times faster than one "
                f"of its particles alone, f_w f_s f_v = {drag:.3g}: flocs, or check units, "
                "viscosity and diameter"
            )


def notes(problem: Problem, fit: Fit) -> list[str]:
    """Notes on a fit: assumptions of the recipes, the kind of optimum, values at bounds."""
    of_recipes = [
        f"sample {sample.name}: {note}"
        for sample in problem.experiment.samples
        for note in sample.recipe.notes
    ]
    of_fit = [KINK] * fit.on_a_kink + [ONE_PLACE] * (fit.places == 1)
    return of_recipes + of_fit + _differences(fit) + _at_bounds(problem, fit)


def _differences(fit: Fit) -> list[str]:
    """A note on slopes by finite differences."""
    if fit.slopes is None:
        return []
    least, most = fit.slopes.steps.min(), fit.slopes.steps.max()
    size = f"{least:.2g}" if least == most else f"{least:.2g} to {most:.2g}"
    failed = f", of which {fit.slopes.failures} failed" if fit.slopes.failures else ""
    return [
        f"slopes are central differences with steps of {size} in the logarithms; the function was "
        f"called {fit.slopes.calls} times{failed}"
    ]


def _unreliable_slopes(problem: Problem, fit: Fit) -> Iterator[str]:
    """Warnings about slopes that may be noise."""
    if fit.slopes is None:
        return
    shares = fit.slopes.uncertainty / np.where(fit.slopes.size, fit.slopes.size, 1.0)
    for parameter, share, unreliable in zip(
        problem.experiment.parameters, shares, fit.slopes.unreliable, strict=True
    ):
        if unreliable:
            yield (
                f"slopes with respect to {parameter.label} change by {share:.0%} with the step of "
                "their differences, and so may its error: state another step, or let the "
                "simulator print more digits"
            )


def _at_bounds(problem: Problem, fit: Fit) -> list[str]:
    """Notes on values that end at a physical bound."""
    logs, parameters = np.log(fit.values), problem.experiment.parameters
    lower, upper = np.broadcast_arrays(*fit.box, logs)[:2]
    return [
        f"{parameter.label} ended at {parameter.value(x):.4g}, its physical bound"
        for parameter, x, log, low, high in zip(
            parameters, fit.values, logs, lower, upper, strict=True
        )
        if min(log - low, high - log) < 1e-9
    ]
