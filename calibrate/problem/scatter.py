"""The scatter of readings without a stated error, estimated with the fit.

The standard deviation of a height or local concentration is its scatter s, that of a velocity s
times its predicted value p, where the fit ended before. The residuals r = m - p, or (m - p) / p,
then give s^2 = sum r^2 / nu. Of nu degrees of freedom each reading has one less its leverage, the
share of a fitted value that is taken from it; so that other measurements and priors count. The fit
is repeated with the new errors until they stay.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.readings.scatter import LEAST, MEDIAN_OF_NORMAL
from calibrate.experiment.repeats import BEFORE_THE_FIT, LEAST_SCATTER
from calibrate.experiment.sample import LocalTable, Measurement, Sample, Scatter
from calibrate.experiment.units import RATIO_UNITS
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.leverage import leverages
from calibrate.problem.problem import Problem

FEWEST_FREE = 1.0
"""Degrees of freedom below which residuals tell no scatter."""
MOST_ROUNDS = 20
"""Fits with errors that follow from the one before."""
SETTLED = 1e-3
"""Relative change of every error at which they stay."""


class WithErrors(Protocol):
    """A problem as far as its errors are concerned."""

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations of the measured values, (M,)."""


ProblemType = TypeVar("ProblemType", bound=WithErrors)


def fit_with_scatter(
    problem: ProblemType,
    fit_errors: Callable[[ProblemType, int], Fit],
    with_scatter: Callable[[ProblemType, Fit], ProblemType],
    with_freedom: Callable[[ProblemType, ProblemType], ProblemType],
) -> tuple[ProblemType, Fit]:
    """The fit, and the problem with the errors of which it is; not converged where they go on.

    Args:
      problem: it has a scatter to begin with.
      fit_errors: fits a problem like it with its errors; the number of fits before.
      with_scatter: the problem with the scatter that the residuals of a fit give.
      with_freedom: the problem with its own errors, and the degrees of freedom of another.
    """
    runs = 0
    for number in range(MOST_ROUNDS):
        fit = fit_errors(problem, number)
        runs += fit.model_runs
        estimated = with_scatter(problem, fit)
        if not fit.converged or _settled(problem, estimated):
            return with_freedom(problem, estimated), replace(fit, model_runs=runs)
        problem = estimated
    return problem, replace(fit, converged=False, model_runs=runs)


def _settled(before: WithErrors, after: WithErrors) -> bool:
    """True if no error changes any more."""
    return bool(np.all(np.abs(after.errors / before.errors - 1.0) < SETTLED))


def with_scatter(problem: Problem, fit: Fit) -> Problem:
    """The problem with the scatter that the residuals of a fit give."""
    return replace(problem, experiment=_estimated(problem, fit))


def with_freedom(problem: Problem, estimated: Problem) -> Problem:
    """The problem of the fit, with the degrees of freedom of its scatter, which the end tells."""
    pairs = zip(problem.experiment.samples, estimated.experiment.samples, strict=True)
    samples = tuple(
        replace(
            sample,
            scatter=other.scatter,
            curve_scatter=other.curve_scatter,
            concentrations=other.concentrations,
        )
        for sample, other in pairs
    )
    return replace(problem, experiment=replace(problem.experiment, samples=samples))


def _estimated(problem: Problem, fit: Fit) -> Experiment:
    """The experiment with the scatter that the residuals of a fit give."""
    freedom = 1.0 - leverages(fit.jacobian, fit.prior_precision)
    residuals = uncapped(fit) * problem.errors
    predicted = problem.measured + residuals
    robust = fit.robust is not None
    samples = []
    for sample, place in problem.experiment.by_sample():
        of_sample = residuals[place], predicted[place], freedom[place], robust
        sample = _with_scatter_of_velocities(sample, *of_sample)
        sample = _with_scatter_of_curve(sample, *of_sample)
        samples.append(_with_scatter_of_concentrations(sample, *of_sample))
    return replace(problem.experiment, samples=tuple(samples))


def places_of_scatter(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Places of the measurements of each scatter that is what the residuals of a fit give.

    None of a robust fit, and none of a scatter that is the least there can be.
    """
    experiment, groups = problem.experiment, []
    for sample, place in experiment.by_sample():
        chosen = [
            (_of_table(sample), sample.scatter),
            (_of_curve(sample), sample.curve_scatter),
            *((_of_local_table(sample, table), table.scatter) for table in sample.concentrations),
        ]
        groups += [
            (place.start + np.flatnonzero(is_in_group), scatter) for is_in_group, scatter in chosen
        ]
    if isinstance(scatter := getattr(experiment, "scatter", None), Scatter):  # of a simulator
        groups.append((np.arange(fit.residuals.size), scatter))
    return [
        places
        for places, scatter in groups
        if fit.robust is None
        and scatter is not None
        and scatter.source == "fit"
        and np.sum(fit.residuals[places] ** 2) > 0.9 * scatter.degrees_of_freedom
    ]


def uncapped(fit: Fit) -> np.ndarray:
    """Residuals in standard deviations, (M,), of a robust fit as they are and not as they count."""
    if fit.robust is None:
        return fit.residuals
    half = 0.5 * (fit.residuals / fit.robust) ** 2
    return np.asarray(np.sign(fit.residuals) * fit.robust * np.sqrt((1.0 + half) ** 2 - 1.0))


def _of_table(sample: Sample) -> np.ndarray:
    """True for velocities of a table, (M,)."""
    return np.array(
        [measurement.concentration is not None for measurement in sample.measurements], bool
    )


def _of_curve(sample: Sample) -> np.ndarray:
    """True for readings of a curve, (M,)."""
    return np.array([measurement.place is not None for measurement in sample.measurements], bool)


def _of_local_table(sample: Sample, table: LocalTable) -> np.ndarray:
    """True for readings of a table of local concentrations, (M,)."""
    names = [measurement.point and measurement.point.table for measurement in sample.measurements]
    return np.array([name == table.name for name in names], bool)


def _with_scatter_of_velocities(
    sample: Sample, residuals: np.ndarray, predicted: np.ndarray, freedom: np.ndarray, robust: bool
) -> Sample:
    """A sample with the relative scatter of its velocities, where it is to be fitted.

    Args:
      sample: of M measurements.
      residuals, predicted: each in its unit, (M,).
      freedom: degrees of freedom of each, (M,).
      robust: whether outliers are to count less: the median is taken and not the mean square.
    """
    if sample.scatter is None or sample.scatter.source == "repeats":
        return sample
    tabled = _of_table(sample)
    relative = residuals[tabled] / predicted[tabled]
    assumed = Scatter(BEFORE_THE_FIT, 0.0, "assumed")
    scatter = _estimate(relative, float(freedom[tabled].sum()), robust, LEAST_SCATTER, assumed)
    errors = scatter.value * np.abs(predicted)
    return replace(sample, measurements=_with_errors(sample, tabled, errors), scatter=scatter)


def _with_scatter_of_curve(
    sample: Sample, residuals: np.ndarray, predicted: np.ndarray, freedom: np.ndarray, robust: bool
) -> Sample:
    """A sample with the scatter of its curve, where it is to be fitted; as for velocities."""
    if sample.curve_scatter is None or sample.curve_scatter.source == "repeats":
        return sample
    in_curve, first_reading = _of_curve(sample), sample.readings_of_curve[0]
    full_height = 1.0 if first_reading.observable == "sedimentation_ratio" else sample.height
    least, free = LEAST * full_height / first_reading.si, float(freedom[in_curve].sum())
    assumed = sample.curve_scatter._replace(degrees_of_freedom=0.0, source="assumed")
    scatter = _estimate(residuals[in_curve], free, robust, least, assumed)
    errors = np.full(predicted.shape, scatter.value)
    return replace(
        sample, measurements=_with_errors(sample, in_curve, errors), curve_scatter=scatter
    )


def _with_scatter_of_concentrations(
    sample: Sample, residuals: np.ndarray, predicted: np.ndarray, freedom: np.ndarray, robust: bool
) -> Sample:
    """A sample with the scatter of its local concentrations; as for velocities."""
    for place, table in enumerate(sample.concentrations):
        if table.scatter is None or table.scatter.source == "repeats":
            continue
        tabled = _of_local_table(sample, table)
        size = sample.recipe.volume_fraction / RATIO_UNITS[table.unit]
        assumed = Scatter(BEFORE_THE_FIT * size, 0.0, "assumed")
        free = float(freedom[tabled].sum())
        scatter = _estimate(residuals[tabled], free, robust, LEAST_SCATTER * size, assumed)
        errors = np.full(predicted.shape, scatter.value)
        tables = list(sample.concentrations)
        tables[place] = table._replace(scatter=scatter)
        measured = _with_errors(sample, tabled, errors)
        sample = replace(sample, measurements=measured, concentrations=tuple(tables))
    return sample


def _estimate(
    residuals: np.ndarray, freedom: float, robust: bool, least: float, assumed: Scatter
) -> Scatter:
    """The scatter of residuals; the assumed one where too few are free to tell it."""
    if freedom < FEWEST_FREE - 1e-9:
        return assumed
    return Scatter(max(scale_of(residuals, freedom, robust), least), freedom, "fit")


def _with_errors(sample: Sample, chosen: np.ndarray, errors: np.ndarray) -> tuple[Measurement, ...]:
    """The measurements, (M,), the chosen ones with these errors."""
    triples = zip(sample.measurements, chosen, errors, strict=True)
    return tuple(
        measurement._replace(standard_deviation=float(error)) if takes else measurement
        for measurement, takes, error in triples
    )


def scale_of(relative: np.ndarray, freedom: float, robust: bool) -> float:
    """Standard deviation of residuals, (M,), with so many degrees of freedom."""
    if not robust:
        return float(np.sqrt(np.sum(relative**2) / freedom))
    deviation = np.median(np.abs(relative)) / MEDIAN_OF_NORMAL
    return float(deviation * np.sqrt(relative.size / freedom))
