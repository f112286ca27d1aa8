"""Predicted curves between readings, and their errors."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement, Sample
from calibrate.inference.curves import predicted_curves
from calibrate.least_squares.fit import fit
from calibrate.problem.fine_times import FEWEST_PARTS, INTERVALS, times_between
from calibrate.problem.problem import Problem


@pytest.mark.parametrize(
    "readings", [[60.0], [0.0, 10.0, 3600.0], [5.0, 5.0, 7.0, 1e6], list(np.arange(0, 5e3, 10.0))]
)
def test_times_of_a_curve_are_those_of_readings_and_others_between(readings):
    times = times_between(readings)
    assert set(readings) <= set(times) and times[0] == 0.0 and times[-1] == max(readings)
    assert (np.diff(times) > 0.0).all()
    assert np.diff(times).max() <= max(readings) / INTERVALS * (1 + 1e-12)
    known = np.unique([0.0, *readings])
    assert np.diff(np.searchsorted(times, known)).min() >= FEWEST_PARTS
    assert times.size <= INTERVALS + FEWEST_PARTS * known.size + 1


@pytest.fixture
def falling(case2):
    """A line in mm that falls as fast as f_s lets it, and a velocity; fitted, with priors."""

    def model(sample, *_):
        def predict(suspension, times=sample.times):
            speed = 1e-4 / suspension.parameters.f_s
            mudline = 0.09 - speed * jnp.asarray(times)
            return {"initial_velocity": speed * suspension.parameters.f_v, "mudline": mudline}

        return predict

    times = tuple(np.linspace(0.0, 100.0, 11))
    readings = [Measurement("mudline", 90.0 - 3 * k, 0.5, "mm", 1e-3, place=5 * k) for k in (1, 2)]
    velocity = Measurement("initial_velocity", 1.0, 1.0, "mm/s", 1e-3)
    sample = Sample("A", case2, 0.1, 0.6, (velocity, *readings), times)
    alone = replace(sample, name="B", measurements=(velocity,), times=())
    free = (
        FreeParameter("f_s", "f_s", ("A",), 1.0, 0.3),
        FreeParameter("f_v", "f_v", ("A", "B"), 1.0, 0.2),
    )
    return Problem.prepare(Experiment("mine", (alone, sample), free), model)


def test_a_curve_has_the_errors_of_the_fit(falling):
    """d(90 - 0.1 t / f_s) / d ln f_s = 0.1 t / f_s, in mm."""
    found = fit(falling.residuals, falling.start, priors=falling.priors)
    (curve,) = predicted_curves(falling, found)
    assert (curve.sample, curve.observable, curve.unit) == ("A", "mudline", "mm")
    assert curve.times.size > INTERVALS and curve.times[-1] == 100.0
    fallen = 0.1 * curve.times / found.theta["f_s"]
    np.testing.assert_allclose(curve.predicted, 90.0 - fallen, rtol=1e-12)
    shape = found.names.index("f_s")
    covariance = np.linalg.inv(found.jacobian.T @ found.jacobian + np.diag(found.prior_precision))
    error = fallen * covariance[shape, shape] ** 0.5
    # A step of 1e-2 in the logarithm to the fourth power, and rounding of 90 over it, are less.
    np.testing.assert_allclose(curve.standard_error, error, rtol=1e-7, atol=1e-9)


def test_errors_have_no_spike_where_a_mudline_meets_its_bed(falling):
    """They fall from those of the line to those of the bed, which are none."""

    def model(sample, *_):
        def predict(suspension, times=sample.times):
            speed = 1e-4 / suspension.parameters.f_s
            line = 0.09 - speed * jnp.asarray(times)
            mudline = jnp.maximum(line, 0.085)
            return {"initial_velocity": speed * suspension.parameters.f_v, "mudline": mudline}

        return predict

    problem = Problem.prepare(falling.experiment, model)
    found = fit(problem.residuals, problem.start, priors=problem.priors, finish_steps=1)
    (curve,) = predicted_curves(problem, found)
    errors, kink = curve.standard_error, int(np.argmax(curve.predicted <= 85.0))
    rate = errors[kink // 2] / curve.times[kink // 2]
    assert (errors <= rate * curve.times * (1.0 + 1e-6)).all()
    assert (np.diff(errors[kink:]) <= 1e-9).all() and errors[-1] < 1e-9 < errors[kink - 1]


def test_without_a_curve_there_is_none():
    problem = Problem.prepare(Experiment.load("fang2005"), "closed-form")
    found = fit(problem.residuals, problem.start, priors=problem.priors, finish_steps=1)
    assert predicted_curves(problem, found) == ()


def test_a_curve_goes_through_the_predictions_of_its_readings():
    problem = Problem.prepare(Experiment.load("synthetic"), "column")
    found = fit(problem.residuals, problem.start, priors=problem.priors, finish_steps=1)
    predicted = np.asarray(problem.predict(found.theta))
    curves = predicted_curves(problem, found)
    assert len(problem.curves) == len(curves) > 0
    for curve in curves:
        of_sample = [
            (sample.times[one.place], value)
            for (sample, one), value in zip(problem.measurements, predicted, strict=True)
            if sample.name == curve.sample and one.place is not None
        ]
        times, values = zip(*of_sample, strict=True)
        places = np.searchsorted(curve.times, times)
        np.testing.assert_allclose(curve.predicted[places], values, rtol=1e-9)


def test_a_model_that_takes_no_times_has_a_curve_at_its_readings(falling):
    def model(sample, *_):
        return lambda suspension: {
            "initial_velocity": 1e-4 / suspension.parameters.f_s,
            "mudline": 0.09 - jnp.asarray(sample.times) * 1e-4 / suspension.parameters.f_s,
        }

    problem = Problem.prepare(falling.experiment, model)
    found = fit(problem.residuals, problem.start, priors=problem.priors, finish_steps=1)
    (curve,) = predicted_curves(problem, found)
    np.testing.assert_array_equal(curve.times, np.linspace(0.0, 100.0, 11))
