"""Numbers of a report: bounded values, robust fits, samples, by hand."""

from collections import OrderedDict
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate import LogNormal
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement
from calibrate.inference.posterior import Posterior
from calibrate.inference.profile import Profile
from calibrate.report import tables

BOUNDED = FreeParameter("share", "share", ("A",), 0.6, None, (0.5, 0.7))
POSITIVE = FreeParameter("f_s", "f_s", ("A",), 1.1, 0.2)


def problem_of(parameters, measured, errors=()):
    """As much of a problem as tables read: velocities of one sample, in mm/day."""
    sample = SimpleNamespace(name="A", times=(), recipe=SimpleNamespace(notes=()))
    errors = errors or [0.1] * len(measured)
    measurements = [
        (sample, Measurement("initial_velocity", value, error, "mm/day", 1.0))
        for value, error in zip(measured, errors, strict=True)
    ]
    return SimpleNamespace(
        experiment=SimpleNamespace(parameters=parameters),
        measurements=measurements,
        measured=np.array(measured, float),
    )


def both(theta):
    """ln of the odds is 0.8 +- 0.1, and ln f_s is 0 +- 0.02."""
    odds, f_s = theta.values()
    return jnp.stack([(jnp.log(odds) - 0.8) / 0.1, jnp.log(f_s) / 0.02])


@pytest.fixture(scope="module")
def bounded():
    start = OrderedDict([("odds(share)", 1.0), ("f_s", 1.1)])
    fit = calibrate.fit(both, start)
    return problem_of((BOUNDED, POSITIVE), [1.0, 1.0]), fit, calibrate.identify(fit)


def test_the_error_of_a_bounded_value_is_in_its_own_unit(bounded):
    """d value = (b - a) x / (1 + x)^2 d ln x, with x = e^0.8 and d ln x = 0.1."""
    table = tables._parameters(*bounded, (), None)
    x = np.exp(0.8)
    assert table["share"]["value"] == pytest.approx(0.5 + 0.2 * x / (1.0 + x), rel=1e-9)
    assert table["share"]["standard_error"] == pytest.approx(0.1 * 0.2 * x / (1 + x) ** 2, rel=1e-6)
    assert table["share"]["data_standard_error"] == pytest.approx(0.1, rel=1e-6)
    assert table["share"]["bounds"] == (0.5, 0.7)
    assert table["f_s"]["standard_error"] == pytest.approx(0.02, rel=1e-6)
    assert (table["f_s"]["prior_median"], table["f_s"]["bounds"]) == (1.1, None)


def test_a_profile_of_a_bounded_value_ends_at_its_bounds(bounded):
    values = np.array([1.0, 2.0, 3.0])
    ends = {"68 %": (1.0, 3.0), "95 %": (0.0, np.inf)}
    held = (
        Profile("odds(share)", values, np.zeros(3), ends),
        Profile("f_s", values, np.zeros(3), ends),
    )
    table = tables._parameters(*bounded, held, None)
    assert table["share"]["profile"]["68 %"] == pytest.approx([0.6, 0.65])
    assert table["share"]["profile"]["95 %"] == [0.5, 0.7]
    assert table["f_s"]["profile"]["95 %"] == [0.0, np.inf]


def test_samples_of_a_posterior_are_summed_up_in_the_unit_of_the_value(bounded):
    """Odds whose values are 0.5001 to 0.6999, evenly; the percentiles are read off."""
    values = np.linspace(0.5001, 0.6999, 2000)
    odds = (values - 0.5) / (0.7 - values)
    f_s = np.exp(np.linspace(-1.0, 1.0, 2000))
    ones = np.ones(2)
    samples = Posterior(("odds(share)", "f_s"), np.stack([odds, f_s], 1), ones, 1e3 * ones, 0)
    table = tables._parameters(*bounded, (), samples)
    drawn = table["share"]["posterior"]
    assert drawn["median"] == pytest.approx(0.6, rel=1e-6)
    assert drawn["standard_deviation"] == pytest.approx(0.1998 / np.sqrt(12), rel=1e-3)
    for label, share in {"2.5 %": 0.025, "16 %": 0.16, "84 %": 0.84, "97.5 %": 0.975}.items():
        assert drawn[label] == pytest.approx(0.5001 + 0.1998 * share, rel=1e-9), label
        assert np.log(table["f_s"]["posterior"][label]) == pytest.approx(2 * share - 1, abs=1e-3)
    assert set(drawn) == {"median", "standard_deviation", "2.5 %", "16 %", "84 %", "97.5 %"}


def test_a_summary_tells_the_worst_of_all_samples():
    """The largest R-hat and the fewest effective samples, whichever value they are of."""
    r_hat, effective = np.array([1.002, 1.008]), np.array([900.0, 500.0])
    samples = Posterior(("a", "b"), np.ones((2000, 2)), r_hat, effective, 3)
    told = tables._posterior(samples)
    assert (told["r_hat"], told["effective_samples"], told["divergences"]) == (1.008, 500.0, 3)
    assert told["converged"] is False


LEVEL, OUTLIER = 8.0, 12.0


def levels(theta, data):
    """Readings of one level, with errors of 0.1."""
    return (theta["level"] - data) / 0.1


@pytest.mark.parametrize("robust", [None, 1.5])
def test_the_error_of_a_prediction_is_that_of_its_value(robust):
    """All readings have one prediction, so one error, that of the level: of the outlier, too.

    Of a robust fit each residual r counts with the slope of d sqrt(2 (sqrt(1 + (r / d)^2) - 1)).
    """
    data = np.array([LEVEL - 0.1, LEVEL, LEVEL + 0.1, OUTLIER])
    fit = calibrate.fit(levels, {"level": 5.0}, data=data, robust=robust)
    problem = problem_of((FreeParameter("level", "level", ("A",), 5.0, None),), list(data))
    predicted = np.full(4, fit.values[0])
    rows = tables._predictions(problem, fit, predicted)
    r = (fit.values[0] - data) / 0.1
    slopes = np.ones(4)
    if robust is not None:
        size = np.sqrt(1.0 + (r / robust) ** 2)
        slopes = r / (size * robust * np.sqrt(2.0 * (size - 1.0)))
    error = 0.1 / np.sqrt(np.sum(slopes**2))
    for row in rows:
        assert row["predicted_error"] == pytest.approx(error, rel=1e-6)
        assert ("varies_as" in row) == (robust is None)


def test_the_error_of_a_prediction_has_that_of_the_prior_in_it():
    """ln a is 0 +- 0.2 before and 0 +- 0.1 as measured: 0.2 / sqrt(5) together."""
    prior = {"a": LogNormal(1.0, 0.2)}
    fit = calibrate.fit(lambda theta: (theta["a"] - 1.0)[None] / 0.1, {"a": 1.2}, priors=prior)
    problem = problem_of((FreeParameter("a", "a", ("A",), 1.0, 0.2),), [1.0])
    (row,) = tables._predictions(problem, fit, fit.values)
    assert row["predicted_error"] == pytest.approx(0.2 / np.sqrt(5.0), rel=1e-6)
    assert row["varies_as"] == "a"
