"""A fit as plain tables: the contents of `fit.json`."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement, Sample, Scatter
from calibrate.experiment.simulator import SimulatedExperiment
from calibrate.experiment.units import RATIO_UNITS
from calibrate.inference.advice import advice, stand_out
from calibrate.inference.curvature import covariance, information
from calibrate.inference.curves import PredictedCurve
from calibrate.inference.forecast import Forecast
from calibrate.inference.identify import Combination, Identification, widened_errors
from calibrate.inference.misfit import Agreement, agreement
from calibrate.inference.posterior import Posterior
from calibrate.inference.products import expression
from calibrate.inference.profile import Profile
from calibrate.inference.runs import runs_tests
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.programs import pseudo_huber
from calibrate.problem.problem import Problem
from calibrate.report import remarks
from calibrate.report.formatting import place_of_point
from calibrate.report.words import SAID
from mrjax import Parameters, terminal_velocity
from mrjax.laws import dimensionless


def summary(
    problem: Problem,
    fit: Fit,
    identification: Identification,
    predicted: np.ndarray,
    profiles: tuple[Profile, ...] = (),
    samples: Posterior | None = None,
    unchanged: tuple[str, ...] = (),
    curves: tuple[PredictedCurve, ...] = (),
) -> dict[str, Any]:
    """A fit as plain tables. `predicted` is `problem.predict`, (M,)."""
    agreed = agreement(problem, fit, identification, predicted)
    errors = problem.experiment.errors
    if errors == "estimated":
        agreed = agreed._replace(p_value=None)  # they follow from the residuals that p would test
    scale = agreed.error_scale if agreed.misfit else 1.0
    validity_of = {
        sample.name: _validity(
            problem.experiment.suspension_of(sample, fit.theta).parameters,
            sample.recipe.temperature,
        )
        for sample in problem.experiment.samples
    }
    return {
        "converged": fit.converged,
        "on_a_kink": fit.on_a_kink,
        "parameters": _parameters(problem, fit, identification, profiles, samples, scale),
        **_determination(problem, fit, identification),
        "unchanged_at_a_distance": list(unchanged),
        "data_as_understood": {
            name: file.table() for name, file in problem.experiment.data_as_understood.items()
        },
        "scatter": _scatter(problem),
        "runs": [test._asdict() for test in runs_tests(problem, fit)],
        "predictions": _predictions(problem, fit, predicted),
        "curves": {curve.sample: _curve(curve) for curve in curves},
        "validity": {
            name: {
                number.name: {"value": number.value, "holds": number.holds} for number in numbers
            }
            for name, numbers in validity_of.items()
        },
        "warnings": remarks.warnings(problem, fit, validity_of)
        + remarks.fronts(problem, predicted),
        "notes": remarks.notes(problem, fit),
        "chi_squared": fit.chi_squared,
        **_agreement(agreed, errors),
        "robust": fit.robust,
        "singular_values": identification.singular_values,
        "model_runs": fit.model_runs,
        "other_optima": [
            {"half_sum_of_squares": loss, "values": dict(zip(fit.names, values, strict=True))}
            for loss, values in fit.other_optima
        ],
        "optima": _optima(problem, fit),
        "stands_out": stand_out(fit.residuals) if agreed.misfit else [],
        "advice": advice(problem, fit, predicted) if agreed.misfit else [],
        "posterior": None if samples is None else _posterior(samples),
    }


def _optima(problem: Problem, fit: Fit) -> list[dict[str, Any]]:
    """All optima, this fit first, with their values by label, each in its own unit."""
    parameters = problem.experiment.parameters
    return [
        {
            "values": {
                parameter.label: parameter.value(x)
                for parameter, x in zip(parameters, optimum.values, strict=True)
            },
            "chi_squared": optimum.chi_squared,
            "half_sum_of_squares": optimum.loss,
            "finished": optimum.finished,
        }
        for optimum in fit.optima
    ]


def _determination(problem: Problem, fit: Fit, identification: Identification) -> dict[str, Any]:
    """Combinations that the data determine, and values that they leave open."""
    labels = {parameter.variable: parameter.label for parameter in problem.experiment.parameters}
    open_values: dict[str, list[str]] = {key: [] for key in SAID}
    for place, name in enumerate(fit.names):
        if not identification.determined[name]:
            open_values[_why_open(identification, name, place)].append(labels[name])
    return {
        "determined_combinations": _combinations(identification.combinations),
        "near_combinations": _combinations(identification.near_combinations),
        "null_directions": list(identification.null_directions),
        "weak_combinations": list(identification.weak_combinations),
        **open_values,
    }


def _combinations(combinations: tuple[Combination, ...]) -> list[dict[str, Any]]:
    return [
        {
            "expression": combination.expression,
            "value": combination.value,
            "standard_error": combination.standard_error,
            "exponents": combination.exponents,
        }
        for combination in combinations
    ]


def _why_open(identification: Identification, name: str, place: int) -> str:
    """The key of `SAID` for a value that is not determined."""
    if identification.status[name] == "informed":
        return "informed_by_data"
    if not np.isfinite(identification.standard_errors[name]):
        return "undetermined"
    bounded_by_data = np.isfinite(identification.data_standard_errors[name])
    if identification.status[name] == "free" and bounded_by_data:
        return "loosely_bounded"
    near = (combination.exponents for combination in identification.near_combinations)
    if any(name in exponents and len(exponents) > 1 for exponents in near):
        return "told_together"
    if not bounded_by_data and not identification.null_exponents[:, place].any():
        return "bounded_on_one_side"
    return "carried_by_priors_alone"


def _validity(parameters: Parameters, temperature: float) -> tuple[dimensionless.Number, ...]:
    """Dimensionless numbers of a suspension that falls as fitted, at its temperature in K."""
    return dimensionless.numbers(parameters, terminal_velocity(parameters), temperature)


def _agreement(agreed: Agreement, errors: str) -> dict[str, Any]:
    return {
        "degrees_of_freedom": agreed.degrees_of_freedom,
        "reduced_chi_squared": agreed.reduced_chi_squared,
        "p_value": agreed.p_value,
        "residuals_over_range": agreed.share,
        "misfit": agreed.misfit,
        "contradicts": agreed.contradicts,
        "errors": errors,
        "error_scale": agreed.error_scale,
    }


def _posterior(samples: Posterior) -> dict[str, Any]:
    return {
        "converged": samples.converged,
        "r_hat": samples.r_hat.max(),
        "effective_samples": samples.effective.min(),
        "divergences": samples.divergences,
        "method": samples.method,
        "pareto_k": samples.pareto_k,
        "faults": list(samples.faults),
    }


def _parameters(
    problem: Problem,
    fit: Fit,
    identification: Identification,
    profiles: tuple[Profile, ...],
    samples: Posterior | None,
    error_scale: float = 1.0,
) -> dict[str, dict[str, Any]]:
    """The rows of the fitted values, each in its own unit, by label.

    `error_scale`: factor on the errors of the measurements, for the scaled errors of the values.
    """
    profile_of = {parameter.name: parameter for parameter in profiles}
    scaled = widened_errors(fit, identification.widening, error_scale)
    table = {}
    for place, parameter in enumerate(problem.experiment.parameters):
        x = fit.values[place]
        error = identification.standard_errors[parameter.variable]
        row = {
            "value": parameter.value(x),
            "standard_error": error * parameter.per_log(x) / x,
            "scaled_standard_error": scaled[parameter.variable] * parameter.per_log(x) / x,
            "determined": identification.determined[parameter.variable],
            "status": identification.status[parameter.variable],
            "data_standard_error": identification.data_standard_errors[parameter.variable],
            "samples": list(parameter.samples),
            "prior_median": parameter.median,
            "prior_log_standard_deviation": parameter.log_standard_deviation,
            "bounds": parameter.bounds,
            "profile": None,
            "profile_within": None,
            "posterior": None,
        }
        if parameter.variable in profile_of:
            row["profile"] = {
                coverage: [_end_of_interval(parameter, end) for end in ends]
                for coverage, ends in profile_of[parameter.variable].intervals.items()
            }
            searched = profile_of[parameter.variable].values[[0, -1]]
            row["profile_within"] = [float(parameter.value(end)) for end in searched]
        if samples is not None:
            sampled = parameter.value(samples.samples[:, place])
            row["posterior"] = {
                "median": np.median(sampled),
                "standard_deviation": sampled.std(),
                **{f"{q:g} %": np.percentile(sampled, q) for q in (2.5, 16, 84, 97.5)},
            }
        table[parameter.label] = row
    return table


def _end_of_interval(parameter: FreeParameter, x: float) -> float:
    if np.isfinite(x):
        return float(parameter.value(x))
    return parameter.bounds[1] if parameter.bounds else np.inf


def _predictions(problem: Problem, fit: Fit, predicted: np.ndarray) -> list[dict[str, Any]]:
    """A row for each measurement, with its prediction in the same unit."""
    spreads = np.array([measurement.standard_deviation for _, measurement in problem.measurements])
    with np.errstate(divide="ignore", invalid="ignore"):
        exponents = fit.jacobian * (spreads / predicted)[:, None]
    spread, _ = covariance(information(fit))
    slopes = fit.jacobian
    if (longest := fit.robust) is not None:  # without the reduction by a robust fit
        scaled = jnp.asarray((predicted - problem.measured) / spreads)
        counts = jax.vmap(jax.grad(lambda residual: pseudo_huber(residual, longest)))(scaled)
        slopes = slopes / np.asarray(counts)[:, None]
    errors = spreads * np.sqrt(np.einsum("mp,pq,mq->m", slopes, spread, slopes))
    return [
        {
            "sample": None if sample is None else sample.name,
            "observable": measurement.observable,
            "measured": measurement.value,
            "sigma": measurement.standard_deviation,
            "predicted": value,
            "predicted_error": error,
            "unit": measurement.unit,
            "row": None if sample is None else measurement.row,
            **(where := _position_in_problem(problem, sample, measurement)),
            **(
                {"varies_as": expression(fit.names, np.round(row, 6))}
                if not where and fit.robust is None and np.isfinite(row).all()
                else {}
            ),
        }
        for (sample, measurement), value, error, row in zip(
            problem.measurements, predicted, errors, exponents, strict=True
        )
    ]


def _curve(curve: PredictedCurve) -> dict[str, Any]:
    """A predicted curve, at the readings and between them."""
    return {
        "observable": curve.observable,
        "unit": curve.unit,
        "time_s": list(curve.times),
        "predicted": list(curve.predicted),
        "standard_error": list(curve.standard_error),
    }


def _position_in_problem(
    problem: Problem, sample: Sample | None, measurement: Measurement
) -> dict[str, Any]:
    """Position of a measurement; empty if it was made on the sample as it is."""
    if isinstance(problem.experiment, SimulatedExperiment):
        return problem.experiment.simulator.place(measurement.row or 0)
    if sample is None or measurement.place is None:
        return _position(measurement, None)
    return _position(measurement, sample.times[measurement.place], sample.time_unit)


def _position(measurement: Measurement, time: float | None, unit: str = "s") -> dict[str, Any]:
    """Position of a measurement: its time, its concentration, or its height and time."""
    if measurement.point is not None:
        return place_of_point(measurement.point)
    if time is not None:
        return {"time_s": time, "time_unit": unit}
    if measurement.concentration is None:
        return {}
    return {
        "concentration": measurement.concentration.value,
        "concentration_kind": measurement.concentration.kind,
        "volume_fraction": measurement.concentration.volume_fraction,
    }


def _scatter(problem: Problem) -> dict[str, dict[str, Any]]:
    """Scatters of readings without a stated error, by sample, table or simulator.

    The scatter of velocities is relative; any other has a unit.
    """
    experiment = problem.experiment
    if isinstance(experiment, SimulatedExperiment):
        if experiment.scatter is None:
            return {}
        unit = {"unit": experiment.simulator.unit}
        return {experiment.name: _table_of_scatter(experiment.scatter) | unit}
    scatters = {}
    for sample in experiment.samples:
        if sample.scatter is not None:
            scatters[sample.name] = _table_of_scatter(sample.scatter)
        if (of_curve := sample.curve_scatter) is not None:
            first_reading = sample.readings_of_curve[0]
            where = {
                "sample": sample.name,
                "observable": first_reading.observable,
                "unit": first_reading.unit,
            }
            scatters[f"{sample.name}, curve"] = _table_of_scatter(of_curve) | where
        for table in sample.concentrations:
            if table.scatter is not None:
                name = f"{sample.name}, {table.name}"
                scatters[name] = _table_of_scatter(table.scatter) | {
                    "sample": sample.name,
                    "observable": "volume_fraction",
                    "unit": table.unit,
                    "table": table.name,
                    "of_initial": table.scatter.value
                    * RATIO_UNITS[table.unit]
                    / sample.recipe.volume_fraction,
                }
    return scatters


def _table_of_scatter(scatter: Scatter) -> dict[str, Any]:
    return {
        "value": scatter.value,
        "standard_error": scatter.standard_error,
        "degrees_of_freedom": scatter.degrees_of_freedom,
        "source": scatter.source,
    }


def forecasts(predictions: list[Forecast]) -> list[dict[str, Any]]:
    """Predictions of samples that were not fitted, as plain tables."""
    return [
        {
            "sample": forecast.sample,
            "observable": forecast.measurement.observable,
            "measured": forecast.measurement.value,
            "sigma": forecast.measurement.standard_deviation,
            "predicted": forecast.predicted,
            "predicted_error": forecast.standard_error,
            "unit": forecast.measurement.unit,
            "difference_over_both_errors": forecast.off,
            **_position(forecast.measurement, forecast.time, forecast.time_unit),
        }
        for forecast in predictions
    ]
