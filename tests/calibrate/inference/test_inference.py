"""What a fit says beyond its optimum: profiles, samples, forecasts; bounds, outliers, restarts."""

import dataclasses
from collections import OrderedDict
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import Experiment, LogNormal, Problem, report
from calibrate import fit as fitted_to
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.inference.forecast import forecast, leave_one_out, sample_like
from calibrate.inference.posterior import posterior
from calibrate.inference.profile import profiles
from tests.builders.valleys import BENT, bent
from tests.studies.recovery import coverage, page

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12


def ridge(theta, data):
    """a b and c are measured to 2 %; a by itself is not."""
    return (jnp.stack([theta["a"] * theta["b"], theta["c"]]) / data - 1.0) / 0.02


PRIORS = {"a": LogNormal(2.0, 0.5), "b": LogNormal(3.0, 0.5)}


@pytest.fixture(scope="module")
def on_a_ridge():
    start = OrderedDict(a=4.0, b=2.0, c=5.0)
    return fitted_to(ridge, start, priors=PRIORS, data=np.array([6.0, 2.0]))


def test_profiles_of_a_ridge_and_of_a_measured_value(on_a_ridge):
    """ln a: from the priors of a and b and their known sum, variance 0.5^2 / 2, and a little."""
    of = {one.name: one for one in profiles(on_a_ridge)}
    low, high = of["a"].intervals["68 %"]
    spread = np.sqrt(0.5 * 0.5**2 + 0.25 * 0.02**2)
    np.testing.assert_allclose(np.log([low / 2, high / 2]), [-spread, spread], rtol=2e-3)
    low, high = of["a"].intervals["95 %"]
    np.testing.assert_allclose(np.log([low / 2, high / 2]), [-1.96 * spread, 1.96 * spread], 2e-3)
    # c itself is measured: its interval is straight in c, not in ln c. Interpolated: 2e-3 of it.
    np.testing.assert_allclose(of["c"].intervals["68 %"], [1.96, 2.04], atol=1e-4)
    np.testing.assert_allclose(of["c"].intervals["95 %"], 2 + 0.04 * np.array([-1.96, 1.96]), 1e-4)


def test_a_value_that_nothing_bounds_has_no_profile_and_no_posterior():
    fit = fitted_to(ridge, OrderedDict(a=4.0, b=2.0, c=5.0), data=np.array([6.0, 2.0]))
    assert [one.name for one in profiles(fit)] == ["c"]
    with pytest.raises(mrjax.InputError, match="posterior of a, b has no end"):
        posterior(fit)


@pytest.mark.slow
def test_samples_of_a_ridge(on_a_ridge):
    """Spreads of a Gaussian in logarithms, within four of their sampling errors."""
    drawn = posterior(on_a_ridge, seed=1)
    assert drawn.converged and drawn.divergences == 0
    logs = np.log(drawn.samples)
    few = 4.0 / np.sqrt(2.0 * drawn.effective.min())
    spread = np.sqrt(0.5 * 0.5**2 + 0.25 * 0.02**2)
    assert logs[:, 0].std() == near(spread, rel=few)
    assert (logs[:, 0] + logs[:, 1]).std() == near(0.02, rel=few + 0.01)
    assert logs[:, 2].std() == near(0.02, rel=few + 0.01)
    again = posterior(on_a_ridge, seed=1)
    np.testing.assert_array_equal(drawn.samples, again.samples)


def line(theta, data):
    """Slope and level of a line at five places, with errors of 0.1."""
    return (theta["slope"] * jnp.arange(5.0) + theta["level"] - data) / 0.1


def test_a_robust_fit_is_hardly_moved_by_an_outlier():
    data = 2.0 * np.arange(5.0) + 3.0
    wild = data + np.array([0.0, 0.0, 0.0, 0.0, 5.0])
    start = OrderedDict(slope=1.0, level=2.0)
    plain, robust = (fitted_to(line, start, data=wild, robust=each) for each in (None, 1.0))
    assert plain.values[0] == near(3.0, rel=1e-6)  # least squares: 2 + 5 x 2 / 10
    assert abs(robust.values[0] - 2.0) < 0.1
    clean = fitted_to(line, start, data=data, robust=1.0)
    np.testing.assert_allclose(clean.values, [2.0, 3.0], rtol=1e-6)


def two_valleys(theta):
    """(ln a)^2 = 1 with a weak pull towards ln a = -1: a worse optimum at e, the best at 1/e."""
    log = jnp.log(theta["a"])
    return jnp.stack([10.0 * (log**2 - 1.0), 3.0 * (log + 1.0)])


def test_several_starts_find_the_better_valley_and_tell_of_the_other():
    alone = fitted_to(two_valleys, {"a": 2.5})
    assert alone.values[0] > 1.0
    prior = {"a": LogNormal(1.0, 3.0)}  # from which the other starts are drawn
    many = fitted_to(two_valleys, {"a": 2.5}, priors=prior, starts=8)
    assert many.values[0] == near(np.exp(-1.0), rel=1e-2)
    assert any(values[0] > 1.0 for _, values in many.other_optima)
    assert all(loss > 0.5 for loss, _ in many.other_optima)


def test_the_search_ends_where_gauss_newton_is_to_be_trusted():
    """It is left out where residuals are straight in the logarithms, however far the start."""
    start, data = OrderedDict(a=400.0, b=0.02, c=500.0), np.array([6.0, 2.0])
    found = fitted_to(ridge, start, priors=PRIORS, data=data)
    assert len(found.loss) == 2 and found.model_runs <= 15
    assert len(fitted_to(bent, BENT).loss) > 4


def kinked(theta, data):
    """Two lines that meet at ln a = 0, where the best fit to its data is; one more value."""
    log = jnp.log(theta["a"])
    bend = jnp.where(log < 0.0, -2.0 * log, 0.5 * log)
    return jnp.stack([bend + 1.0, jnp.log(theta["b"]) - data])


def test_an_optimum_on_a_kink_is_found_and_called_so():
    found = fitted_to(kinked, OrderedDict(a=3.0, b=5.0), data=jnp.asarray(0.3))
    assert found.converged and found.on_a_kink
    np.testing.assert_allclose(np.log(found.values), [0.0, 0.3], atol=0.02)


@pytest.mark.parametrize("sharp, steps", [(10.0, 20), (30.0, 20), (300.0, 300)])
def test_a_bent_valley_is_no_kink(sharp, steps):
    """Levenberg and Marquardt may need a second go, from where a simplex led, or more steps."""

    def residuals(theta, sharp):
        return bent(theta) * jnp.stack([0.1 * sharp, jnp.ones(())])

    assert not fitted_to(residuals, BENT, data=jnp.asarray(sharp)).on_a_kink
    smooth = fitted_to(residuals, BENT, data=jnp.asarray(sharp), finish_steps=steps)
    assert smooth.converged and not smooth.on_a_kink
    np.testing.assert_allclose(np.log(smooth.values), [1.0, 1.0], atol=0.01)  # of an error of 1


def cliff(theta):
    """Nothing can be predicted beyond ln a = 1; the optimum is at 0.9."""
    log = jnp.log(theta["a"])
    bowl = 5.0 * (log - 0.9) * (1.0 + 0.5 * log**2)
    return jnp.atleast_1d(jnp.where(log < 1.0, bowl, jnp.nan))


def test_a_search_over_a_cliff_comes_back():
    for start in (0.01, 1.0, 2.7):
        found = fitted_to(cliff, {"a": start})
        assert found.converged, start
        assert np.log(found.values[0]) == near(0.9, rel=1e-4)
    assert not fitted_to(cliff, {"a": 5.0}).converged  # nothing to come back to
    # And one lost start of several keeps the others from nothing.
    many = fitted_to(cliff, {"a": 5.0}, priors={"a": LogNormal(1.0, 2.0)}, starts=8)
    assert many.converged and many.model_runs < 400


@pytest.fixture(scope="module")
def fang() -> Experiment:
    return Experiment.load("fang2005")


def test_each_of_fangs_samples_from_the_other(fang):
    """B from A with f_v = 1.68 and f_r = 1.1: 4.3 mm/day against 3.6 measured; its error is that
    of the prior of f_v, 20 %, and of A's velocity."""
    found = {
        (one.sample, one.measurement.observable): one for one in leave_one_out(fang, "closed-form")
    }
    b = found["B", "initial_velocity"]
    assert b.predicted == near(4.8955 * 8.0 / 9.1164, rel=2e-3)
    assert b.standard_error / b.predicted == near(np.hypot(0.2, 0.1 / 8.0), rel=2e-2)
    assert b.off == near((b.predicted - 3.6) / np.hypot(b.standard_error, 0.1))
    assert abs(b.off) < 1.0
    # Nothing is known of B's bed but its prior.
    bed = found["B", "final_ratio"]
    assert bed.predicted == near(100 * 0.31284 * 1.331 / 0.5, rel=1e-4)
    assert bed.standard_error / bed.predicted == near(0.2)


def test_nothing_is_predicted_from_a_fit_that_did_not_converge(fang, monkeypatch):
    def stuck(*arguments, **keywords):
        return dataclasses.replace(fitted_to(*arguments, **keywords), converged=False)

    monkeypatch.setattr("calibrate.problem.solve.fit", stuck)
    with pytest.raises(mrjax.SimulationError, match="the fit without sample A did not converge"):
        leave_one_out(fang, "closed-form")


def test_a_new_recipe_with_the_uncertainty_of_the_fit(fang):
    """Sample A again is predicted with the error that its own measurements leave."""
    problem = Problem.prepare(fang, "closed-form")
    fit = fitted_to(problem.residuals, problem.start, priors=problem.priors)
    wider, sample = sample_like(fang, mrjax.Recipe.load("case2"), "A")
    velocity, ratio = forecast(wider, fit, sample, "closed-form")
    assert velocity.predicted == near(7.995, rel=1e-3)
    assert velocity.standard_error == near(0.1, rel=0.02)
    assert 100 * ratio.predicted == near(77.95, rel=1e-3)
    assert 100 * ratio.standard_error == near(1.0, rel=0.02)
    with pytest.raises(mrjax.InputError, match="'Z': no such sample; fang2005 has A, B"):
        sample_like(fang, mrjax.Recipe.load("case2"), "Z")


def test_a_prediction_along_a_direction_that_nothing_bounds_is_open(fang):
    free = Experiment(
        fang.name,
        fang.samples[:1],
        tuple(
            FreeParameter(one.label, one.name, ("A",), one.median, None)
            for one in fang.parameters
            if one.name in ("f_w", "f_s")
        )
        + fang.parameters[3:4],
    )
    problem = Problem.prepare(free, "closed-form")
    fit = fitted_to(problem.residuals, problem.start, priors=problem.priors)
    wider, sample = sample_like(free, mrjax.Recipe.load("case2"), "A")
    closed = forecast(wider, fit, sample, "closed-form")
    assert np.isfinite(closed[0].standard_error)  # only their product is needed
    only_f_w = Experiment(
        free.name,
        free.samples,
        (wider.parameters[0], free.parameters[1], wider.parameters[2]),
    )
    assert np.isinf(forecast(only_f_w, fit, sample, "closed-form")[0].standard_error)


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    """The closed form, all of it; the limits are those of chance, one in a hundred."""
    rows = coverage.measured("fang2005", "closed-form", coverage.PROFILE, range(200))
    for one in coverage.held(rows).values():
        assert one["converged"] == one["sets"] == 200
        for level in ("68 %", "95 %"):
            low, high = coverage.limits(one["sets"], level)
            assert low <= one[level] <= high


def test_a_recipe_of_another_closure_is_like_no_sample(fang, tmp_path):
    synthetic = Experiment.load("synthetic")
    with pytest.raises(mrjax.InputError, match=r"f_w.exponent was fitted in the closure of thin"):
        sample_like(synthetic, mrjax.Recipe.load("case2"), "thin")
    wider, sample = sample_like(fang, fang.samples[0].recipe.model_copy(update={"name": "B"}), "A")
    assert sample.name == "B (new)"
    assert "f_v" not in wider.varied(sample) and "f_v" in wider.varied(fang.samples[1])


def test_the_page_of_recovery_shows_what_was_measured():
    assert page.text() == page.PAGE.read_text("utf-8")
    measured = coverage.held(coverage.known())
    assert {key[:3] for key in measured} == set(coverage.SETS)
    for key, one in measured.items():
        assert one["sets"] == coverage.SETS[key[:3]]
        # Of a column's mudline, whose slopes jump, a few may not converge, and say so.
        few = 0.02 * one["sets"] if key[1] == "column" else 0
        assert one["converged"] >= one["sets"] - few
        for level in ("68 %", "95 %"):
            low, high = coverage.limits(one["sets"], level)
            assert low <= one[level] <= high


@pytest.mark.slow
def test_curves_of_tubes_by_the_column():
    """The synthetic experiment: truth within three standard errors of the fit."""
    problem = Problem.prepare(Experiment.load("synthetic"), "column")
    fit = fitted_to(problem.residuals, problem.start, priors=problem.priors)
    assert fit.converged
    found = calibrate.identify(fit)
    truth = {"f_w.exponent": 5.3, "f_s": 1.25, "f_v": 1.9, "odds(bed_fraction)": 0.13 / 0.16}
    for name, value in zip(fit.names, fit.values, strict=True):
        assert abs(value - truth[name]) < 3 * found.standard_errors[name]
    assert 0.5 < fit.chi_squared / (73 - 4) < 1.5
    predicted = np.asarray(problem.predict(fit.theta))
    said = report.in_words(report.summary(problem, fit, found, predicted))
    assert (
        "`odds(bed_fraction)` is (bed_fraction - 0.45) / (0.74 - bed_fraction), "
        "which runs from 0 to infinity." in said
    )
