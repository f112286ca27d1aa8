"""The scatter of readings without a stated error, estimated together with the fit.

The standard deviation of a height or of a local concentration is its scatter s. That of a velocity
is s times its value p as predicted by the fit before. The residuals r = m - p, or (m - p) / p for
velocities, give s^2 = sum r^2 / nu. The degrees of freedom nu are a sum over the readings of one
minus the leverage. The leverage is the share of a fitted value that comes from its own reading; so
other measurements and priors count as well. The fit is repeated with the new errors until these no
longer change.
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
"""Least degrees of freedom from which a scatter is estimated."""
MOST_ROUNDS = 20
"""Most fits, each with the errors that follow from the fit before."""
SETTLED = 1e-3
"""Relative change of the errors below which they have converged."""


class WithErrors(Protocol):
    """A problem with standard deviations of its measurements."""

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
    """Repeats a fit until the estimated errors no longer change.

    Args:
      problem: problem with a first guess of its scatter.
      fit_errors: function that fits a problem with its errors; it also takes the number of fits
        before.
      with_scatter: function that gives the problem with the scatter of a fit's residuals.
      with_freedom: function that gives the first problem with its own errors, and with the degrees
        of freedom of the second.

    Returns:
      the problem with the errors of the last fit, and that fit. It is not converged if the errors
      still change after `MOST_ROUNDS` fits.
    """
    runs = 0
    for number in range(MOST_ROUNDS):
        fit = fit_errors(problem, number)
        runs += fit.model_runs
        estimated = with_scatter(problem, fit)
        if not fit.converged or _errors_converged(problem, estimated):
            return with_freedom(problem, estimated), replace(fit, model_runs=runs)
        problem = estimated
    return problem, replace(fit, converged=False, model_runs=runs)


def _errors_converged(before: WithErrors, after: WithErrors) -> bool:
    """True if no error changes any more."""
    return bool(np.all(np.abs(after.errors / before.errors - 1.0) < SETTLED))


def with_scatter(problem: Problem, fit: Fit) -> Problem:
    """The problem with the scatter estimated from the residuals of a fit."""
    return replace(problem, experiment=_experiment_with_scatter(problem, fit))


def with_freedom(problem: Problem, estimated: Problem) -> Problem:
    """The fitted problem with the scatter of the final residuals; its errors stay as they are."""
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


def _experiment_with_scatter(problem: Problem, fit: Fit) -> Experiment:
    """The experiment with the scatter estimated from the residuals of a fit."""
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


def groups_of_scatter(experiment: Experiment) -> list[tuple[np.ndarray, Scatter]]:
    """Indices of the measurements of each scatter that is estimated from the residuals."""
    groups = []
    for sample, place in experiment.by_sample():
        chosen = [
            (_in_velocity_table(sample), sample.scatter),
            (_in_curve(sample), sample.curve_scatter),
            *((_in_local_table(sample, table), table.scatter) for table in sample.concentrations),
        ]
        groups += [
            (place.start + np.flatnonzero(is_in_group), scatter)
            for is_in_group, scatter in chosen
            if scatter is not None and scatter.source == "fit"
        ]
    return groups


def places_of_scatter(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Indices of the measurements of each scatter that was estimated from the residuals.

    Robust fits have none, and a scatter at its lower limit is left out.
    """
    groups = groups_of_scatter(problem.experiment)
    of_simulator = getattr(problem.experiment, "scatter", None)
    if isinstance(of_simulator, Scatter) and of_simulator.source == "fit":
        groups.append((np.arange(fit.residuals.size), of_simulator))
    return [
        places
        for places, scatter in groups
        if fit.robust is None
        and np.sum(fit.residuals[places] ** 2) > 0.9 * scatter.degrees_of_freedom
    ]


def uncapped(fit: Fit) -> np.ndarray:
    """Residuals in standard deviations, (M,), without the reduction by a robust fit."""
    if fit.robust is None:
        return fit.residuals
    half = 0.5 * (fit.residuals / fit.robust) ** 2
    return np.asarray(np.sign(fit.residuals) * fit.robust * np.sqrt((1.0 + half) ** 2 - 1.0))


def _in_velocity_table(sample: Sample) -> np.ndarray:
    """True for velocities of a table, (M,)."""
    return np.array(
        [measurement.concentration is not None for measurement in sample.measurements], bool
    )


def _in_curve(sample: Sample) -> np.ndarray:
    """True for readings of a curve, (M,)."""
    return np.array([measurement.place is not None for measurement in sample.measurements], bool)


def _in_local_table(sample: Sample, table: LocalTable) -> np.ndarray:
    """True for readings of a table of local concentrations, (M,)."""
    names = [measurement.point and measurement.point.table for measurement in sample.measurements]
    return np.array([name == table.name for name in names], bool)


def _with_scatter_of_velocities(
    sample: Sample, residuals: np.ndarray, predicted: np.ndarray, freedom: np.ndarray, robust: bool
) -> Sample:
    """The sample with the relative scatter of its velocities, if it is estimated with the fit.

    Args:
      sample: sample with M measurements.
      residuals, predicted: residuals and predictions, each in its unit, (M,).
      freedom: degrees of freedom of each measurement, (M,).
      robust: True to take the median in place of the mean square, so that outliers count less.
    """
    if sample.scatter is None or sample.scatter.source == "repeats":
        return sample
    tabled = _in_velocity_table(sample)
    relative = residuals[tabled] / predicted[tabled]
    assumed = Scatter(BEFORE_THE_FIT, 0.0, "assumed")
    scatter = _estimate(relative, float(freedom[tabled].sum()), robust, LEAST_SCATTER, assumed)
    errors = scatter.value * np.abs(predicted)
    return replace(sample, measurements=_with_errors(sample, tabled, errors), scatter=scatter)


def _with_scatter_of_curve(
    sample: Sample, residuals: np.ndarray, predicted: np.ndarray, freedom: np.ndarray, robust: bool
) -> Sample:
    """The sample with the scatter of its curve, if it is estimated; arguments as for velocities."""
    if sample.curve_scatter is None or sample.curve_scatter.source == "repeats":
        return sample
    in_curve, first_reading = _in_curve(sample), sample.readings_of_curve[0]
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
    """The sample with the scatter of its local concentrations; arguments as for velocities."""
    for place, table in enumerate(sample.concentrations):
        if table.scatter is None or table.scatter.source == "repeats":
            continue
        tabled = _in_local_table(sample, table)
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
    """The scatter of residuals, or the assumed one if there are too few degrees of freedom."""
    if freedom < FEWEST_FREE - 1e-9:
        return assumed
    return Scatter(max(scale_of(residuals, freedom, robust), least), freedom, "fit")


def _with_errors(sample: Sample, chosen: np.ndarray, errors: np.ndarray) -> tuple[Measurement, ...]:
    """The measurements, (M,), with new errors for the chosen ones."""
    triples = zip(sample.measurements, chosen, errors, strict=True)
    return tuple(
        measurement._replace(standard_deviation=float(error)) if takes else measurement
        for measurement, takes, error in triples
    )


def scale_of(relative: np.ndarray, freedom: float, robust: bool) -> float:
    """Standard deviation of residuals, (M,), by their mean square, or their median if robust."""
    if not robust:
        return float(np.sqrt(np.sum(relative**2) / freedom))
    deviation = np.median(np.abs(relative)) / MEDIAN_OF_NORMAL
    return float(deviation * np.sqrt(relative.size / freedom))
