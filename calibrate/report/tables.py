"""What a fit found, as plain tables: the contents of `fit.json`."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from calibrate.experiment.free_parameters import FreeParameter
from calibrate.inference.curvature import covariance, information
from calibrate.inference.forecast import Forecast
from calibrate.inference.identify import Identification
from calibrate.inference.misfit import Agreement, agreement
from calibrate.inference.posterior import Posterior
from calibrate.inference.products import expression
from calibrate.inference.profile import Profile
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.programs import pseudo_huber
from calibrate.problem.problem import Problem
from calibrate.report.words import SAID
from mrjax import Parameters, terminal_velocity
from mrjax.laws import dimensionless

KINK = (
    "the optimum is where slopes jump, as where a mudline meets its bed at the time of a "
    "measurement: it was found without slopes, and errors and intervals are those of one side"
)

FASTER = 2.0
"""How many times faster than one of its particles alone a suspension may fall as fitted."""


def summary(
    problem: Problem,
    fit: Fit,
    found: Identification,
    predicted: np.ndarray,
    profiles: tuple[Profile, ...] = (),
    samples: Posterior | None = None,
) -> dict[str, Any]:
    """Everything a fit found, as plain tables. `predicted` is `problem.predict`, (M,)."""
    agreed = agreement(problem, fit, found, predicted)
    validity_of = {
        sample.name: _validity(problem.experiment.suspension_of(sample, fit.theta).parameters)
        for sample in problem.experiment.samples
    }
    return {
        "converged": fit.converged,
        "on_a_kink": fit.on_a_kink,
        "parameters": _parameters(problem, fit, found, profiles, samples),
        **_what_is_determined(problem, fit, found),
        "predictions": _predictions(problem, fit, predicted),
        "validity": {
            name: {one.name: {"value": one.value, "holds": one.holds} for one in numbers}
            for name, numbers in validity_of.items()
        },
        "warnings": _warnings(problem, fit, validity_of),
        "notes": _notes(problem, fit),
        "chi_squared": fit.chi_squared,
        **_agreement(agreed),
        "robust": fit.robust,
        "singular_values": found.singular_values,
        "model_runs": fit.model_runs,
        "other_optima": [
            {"half_sum_of_squares": loss, "values": dict(zip(fit.names, values, strict=True))}
            for loss, values in fit.other_optima
        ],
        "posterior": None if samples is None else _posterior(samples),
    }


def _what_is_determined(problem: Problem, fit: Fit, found: Identification) -> dict[str, Any]:
    """Combinations that the data determine, and values that they leave open."""
    labels = {one.variable: one.label for one in problem.experiment.parameters}
    open_values: dict[str, list[str]] = {key: [] for key in SAID}
    for name in fit.names:
        if not found.determined[name]:
            open_values[_why_open(found, name)].append(labels[name])
    return {
        "determined_combinations": [
            {
                "expression": one.expression,
                "value": one.value,
                "standard_error": one.standard_error,
                "exponents": one.exponents,
            }
            for one in found.combinations
        ],
        "null_directions": list(found.null_directions),
        "weak_combinations": list(found.weak_combinations),
        **open_values,
    }


def _why_open(found: Identification, name: str) -> str:
    """Of a value that is not determined: which of `SAID` is said of it."""
    if found.status[name] == "informed":
        return "informed_by_data"
    if not np.isfinite(found.standard_errors[name]):
        return "undetermined"
    by_data_alone = found.status[name] == "free" and np.isfinite(found.data_standard_errors[name])
    return "loosely_bounded" if by_data_alone else "carried_by_priors_alone"


def _warnings(
    problem: Problem, fit: Fit, validity_of: dict[str, tuple[dimensionless.Number, ...]]
) -> list[str]:
    return [
        *problem.experiment.warnings,
        *(
            f"sample {name}: {warning}"
            for name, numbers in validity_of.items()
            for warning in dimensionless.warnings(numbers)
        ),
        *_too_fast(problem, fit),
    ]


def _too_fast(problem: Problem, fit: Fit) -> Iterator[str]:
    """Of samples that fall faster as fitted than one of their particles would alone."""
    for sample in problem.experiment.samples:
        parameters = problem.experiment.suspension_of(sample, fit.theta).parameters
        drag = float(np.mean(parameters.f_w * parameters.f_s * parameters.f_v))
        if drag * FASTER < 1.0:
            yield (
                f"sample {sample.name}: as fitted it falls {1.0 / drag:.3g} times faster than one "
                f"of its particles alone, f_w f_s f_v = {drag:.3g}: flocs, or check units, "
                "viscosity and diameter"
            )


def _notes(problem: Problem, fit: Fit) -> list[str]:
    notes = [
        f"sample {sample.name}: {note}"
        for sample in problem.experiment.samples
        for note in sample.recipe.notes
    ]
    return notes + [KINK] * fit.on_a_kink + _at_bounds(problem, fit)


def _at_bounds(problem: Problem, fit: Fit) -> list[str]:
    """Of values that end where they would lose their meaning."""
    logs, labels = np.log(fit.values), problem.experiment.parameters
    lower, upper = np.broadcast_arrays(*fit.box, logs)[:2]
    return [
        f"{one.label} ended at {one.value(x):.4g}, the last value that has a meaning"
        for one, x, log, low, high in zip(labels, fit.values, logs, lower, upper, strict=True)
        if min(log - low, high - log) < 1e-9
    ]


def _validity(parameters: Parameters) -> tuple[dimensionless.Number, ...]:
    """Of a suspension that falls as fitted."""
    return dimensionless.numbers(parameters, terminal_velocity(parameters))


def _agreement(agreed: Agreement) -> dict[str, Any]:
    return {
        "degrees_of_freedom": agreed.degrees_of_freedom,
        "reduced_chi_squared": agreed.reduced_chi_squared,
        "p_value": agreed.p_value,
        "residuals_over_range": agreed.share,
        "misfit": agreed.misfit,
        "contradicts": agreed.contradicts,
        "errors": "stated",
        "error_scale": agreed.error_scale,
    }


def _posterior(samples: Posterior) -> dict[str, Any]:
    return {
        "converged": samples.converged,
        "r_hat": samples.r_hat.max(),
        "effective_samples": samples.effective.min(),
        "divergences": samples.divergences,
    }


def _parameters(
    problem: Problem,
    fit: Fit,
    found: Identification,
    profiles: tuple[Profile, ...],
    samples: Posterior | None,
) -> dict[str, dict[str, Any]]:
    """Of every fitted value, in its own unit, by label."""
    profile_of = {one.name: one for one in profiles}
    table = {}
    for place, one in enumerate(problem.experiment.parameters):
        x = fit.values[place]
        row = {
            "value": one.value(x),
            "standard_error": found.standard_errors[one.variable] * one.per_log(x) / x,
            "determined": found.determined[one.variable],
            "status": found.status[one.variable],
            "data_standard_error": found.data_standard_errors[one.variable],
            "samples": list(one.samples),
            "prior_median": one.median,
            "prior_log_standard_deviation": one.log_standard_deviation,
            "bounds": one.bounds,
            "profile": None,
            "posterior": None,
        }
        if one.variable in profile_of:
            row["profile"] = {
                coverage: [_end_of_interval(one, end) for end in ends]
                for coverage, ends in profile_of[one.variable].intervals.items()
            }
        if samples is not None:
            drawn = one.value(samples.samples[:, place])
            row["posterior"] = {
                "median": np.median(drawn),
                "standard_deviation": drawn.std(),
                **{f"{q:g} %": np.percentile(drawn, q) for q in (2.5, 16, 84, 97.5)},
            }
        table[one.label] = row
    return table


def _end_of_interval(one: FreeParameter, x: float) -> float:
    if np.isfinite(x):
        return float(one.value(x))
    return one.bounds[1] if one.bounds else np.inf


def _predictions(problem: Problem, fit: Fit, predicted: np.ndarray) -> list[dict[str, Any]]:
    """A line for each measurement, both in its unit."""
    spreads = np.array([one.standard_deviation for _, one in problem.measurements])
    exponents = fit.jacobian * (spreads / predicted)[:, None]
    known, _ = covariance(information(fit))
    slopes = fit.jacobian
    if (longest := fit.robust) is not None:  # back from how residuals count to what they are
        of = jnp.asarray((predicted - problem.measured) / spreads)
        counts = jax.vmap(jax.grad(lambda one: pseudo_huber(one, longest)))(of)
        slopes = slopes / np.asarray(counts)[:, None]
    errors = spreads * np.sqrt(np.einsum("mp,pq,mq->m", slopes, known, slopes))
    return [
        {
            "sample": sample.name,
            "observable": one.observable,
            "measured": one.value,
            "sigma": one.standard_deviation,
            "predicted": value,
            "predicted_error": error,
            "unit": one.unit,
            **({} if one.place is None else {"time_s": sample.times[one.place]}),
            **(
                {"varies_as": expression(fit.names, np.round(row, 6))}
                if one.place is None and fit.robust is None
                else {}
            ),
        }
        for (sample, one), value, error, row in zip(
            problem.measurements, predicted, errors, exponents, strict=True
        )
    ]


def forecasts(found: list[Forecast]) -> list[dict[str, Any]]:
    """Predictions of samples that were not fitted, as plain tables."""
    return [
        {
            "sample": one.sample,
            "observable": one.measurement.observable,
            "measured": one.measurement.value,
            "sigma": one.measurement.standard_deviation,
            "predicted": one.predicted,
            "predicted_error": one.standard_error,
            "unit": one.measurement.unit,
            "difference_over_both_errors": one.off,
            **({} if one.time is None else {"time_s": one.time}),
        }
        for one in found
    ]
