"""A simulator of one's own: the same values and errors as by other codes, and the same report."""

import dataclasses
import json
import re
import subprocess
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import curve_fit

import calibrate
from calibrate import LogNormal, Simulator
from mrjax import InputError
from tests.builders import ROOT
from tests.builders.result_keys import undocumented

TIMES = np.linspace(0.0, 5.0, 12)
READINGS = 3.0 * np.exp(-0.7 * TIMES) + 0.05 * np.cos(7.0 * np.arange(12))
PARAMETERS = {"a": 1.0, "k": 1.0}
BLOCKS = re.findall(
    r"```python\n(.*?)```", (ROOT / "docs/guides/own_simulator.md").read_text("utf-8"), re.S
)


def by_numpy(theta):
    return theta["a"] * np.exp(-theta["k"] * TIMES)


def by_jax(theta):
    return theta["a"] * jnp.exp(-theta["k"] * TIMES)


def simulator(predict=by_numpy, **changes):
    given = {"readings": READINGS, "errors": 0.05, "parameters": PARAMETERS} | changes
    return Simulator(predict, **given)


def curve(times, a, k):
    return a * np.exp(-k * times)


@pytest.fixture(scope="module")
def documented(tmp_path_factory):
    """The names of the page's example of JAX, and of that of numpy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("documented"))
        with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
            first: dict = {}
            exec(BLOCKS[0], first)
            second = dict(first)
            exec(BLOCKS[1], second)
        assert json.loads(Path("results/fit.json").read_text("utf-8"))["model"] == "relaxation"
    return first, second


def test_the_example_of_the_page_is_of_twenty_lines():
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) <= 20


def test_the_examples_of_the_page_agree_with_each_other_and_with_scipy(documented):
    """Gauss-Newton's covariance of both; scipy's own slopes are one-sided, exact to 1e-8."""
    first, _ = documented
    found = [names["calibration"] for names in documented]
    assert [one.problem.traced for one in found] == [True, False]
    times, stress = np.array(first["time"]), first["stress"]

    def relaxed(times, initial, held, tau):
        return held + (initial - held) * np.exp(-times / tau)

    # The page's prior of tau is one more reading.
    def with_prior(times, initial, held, tau):
        return np.append(relaxed(times, initial, held, tau), np.log(tau))

    values, covariance = curve_fit(
        with_prior, times, [*stress, 0.0], p0=[10.0, 1.0, 1.0], sigma=[0.15] * 8 + [1.0],
        absolute_sigma=True,
    )  # fmt: skip
    for one in found:
        assert one.fit.converged
        np.testing.assert_allclose(one.fit.values, values, rtol=1e-6)
        errors = list(one.identification.standard_errors.values())
        np.testing.assert_allclose(errors, np.sqrt(np.diag(covariance)), rtol=1e-5)
    np.testing.assert_allclose(found[1].fit.values, found[0].fit.values, rtol=1e-8)


@pytest.mark.parametrize("predict", [by_numpy, by_jax])
def test_an_estimated_scatter_is_that_of_scipy(predict):
    found = calibrate.run(simulator(predict, errors=None))
    values, covariance = curve_fit(curve, TIMES, READINGS, p0=[1.0, 1.0])
    np.testing.assert_allclose(found.fit.values, values, rtol=1e-6)
    errors = list(found.identification.standard_errors.values())
    np.testing.assert_allclose(errors, np.sqrt(np.diag(covariance)), rtol=2e-3)  # SETTLED
    table = found.tables()
    assert (table["errors"], table["p_value"]) == ("estimated", None)
    assert table["scatter"]["simulator"]["degrees_of_freedom"] == pytest.approx(10.0)
    [runs] = table["runs"]
    assert (runs["sample"], runs["readings"]) == (None, 12)
    # 68 % of Student's distribution with 10 degrees of freedom are 1.05 standard errors.
    low, high = found.profiles[0].intervals["68 %"]
    assert (high - low) / 2.0 == pytest.approx(1.0526 * errors[0], rel=0.01)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    own = simulator(
        quantity="mudline", unit="mm", at=TIMES, axis="time, s", name="mine",
        parameters={"a": {"median": 2.0, "log_standard_deviation": 1.0}, "k": {"start": 1.0}},
    )  # fmt: skip
    calibrate.run(own).write(folder)
    return folder


def test_the_report_has_nothing_of_suspensions(written):
    text = (written / "report.md").read_text("utf-8")
    assert text.startswith("# mine, fitted with the by\\_numpy model") or "by_numpy" in text
    for word in ("sample", "drag", "suspension", "recipe", "Where the model holds", "settl"):
        assert word not in text, word
    assert "| mudline at time 0.454545 s | 2.2" in text
    assert "slopes are central differences with steps of 2.4e-05" in text
    made = {path.name for path in written.iterdir()}
    assert {"readings.png", "residuals.png", "profiles.png", "loss.png", "report.html"} <= made
    said = json.loads((written / "fit.json").read_text("utf-8"))
    assert said["predictions"][1]["at"] == pytest.approx(TIMES[1])
    assert undocumented(said) == set()
    assert (said["validity"], said["lab_sheets"]) == ({}, {})


def test_labelled_predictions_say_what_they_vary_as():
    def predict(theta):
        return jnp.stack([theta["a"] * theta["b"], theta["a"] * theta["b"] ** 2])

    own = Simulator(predict, [6.0, -12.0], {"a": 1.0, "b": 1.0}, [0.1, 9.0], labels=["x", "y"])
    found = calibrate.run(own)
    said = calibrate.report.in_words(found.tables())
    assert any(line.startswith("The x varies as a * b:") for line in said)
    assert set(calibrate.report.figures.figures(
        found.problem, found.fit, found.tables(), (), None
    )) == {"predictions", "residuals", "loss"}  # fmt: skip


def test_values_of_either_sign_are_between_bounds():
    """a - 3 exp(-t) with a of -1: the odds of its bounds are fitted."""

    def predict(theta):
        return theta["a"] + theta["b"] * np.exp(-TIMES)

    parameters = {
        "a": {"bounds": (-5.0, 1.0)},
        "b": {"median": -1.0, "standard_deviation": 2.0, "bounds": [-9.0, 9.0], "start": 2.0},
    }
    own = Simulator(predict, -1.0 - 3.0 * np.exp(-TIMES), parameters, 0.01)
    table = calibrate.run(own).tables()["parameters"]
    assert table["a"]["value"] == pytest.approx(-1.0, abs=1e-3)
    assert table["b"]["value"] == pytest.approx(-3.0, abs=1e-3)  # but for its prior
    # A straight line in exp(-t): the errors are those of linear regression.
    rows = np.stack([np.ones(12), np.exp(-TIMES)], axis=1) / 0.01
    errors = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert table["a"]["standard_error"] == pytest.approx(errors[0], rel=1e-3)
    assert table["b"]["standard_error"] == pytest.approx(errors[1], rel=1e-3)


def test_held_values_are_handed_over():
    own = simulator(parameters={"a": 1.0, "k": {"value": 0.7}})
    found = calibrate.run(own)
    assert found.fit.names == ("a",)
    np.testing.assert_allclose(
        found.fit.values, by_numpy({"a": 1.0, "k": 0.7}) @ READINGS
        / np.sum(np.exp(-0.7 * TIMES) ** 2), rtol=1e-8,
    )  # fmt: skip


def test_another_program_is_a_simulator():
    """awk prints what follows from the values of its command line, with six digits."""

    def predict(theta):
        program = 'BEGIN {for (i = 0; i < 12; i++) printf "%.6g\\n", a * exp(-k * i * 5 / 11)}'
        given = [word for name in "ak" for word in ("-v", f"{name}={theta[name]:.17g}")]
        done = subprocess.run(["awk", *given, program], capture_output=True, text=True, check=True)
        return [float(line) for line in done.stdout.splitlines()]

    found = calibrate.run(simulator(predict))
    alone = calibrate.run(simulator())
    assert found.fit.converged and not found.problem.traced
    # Half a digit of six, 5e-6 of readings whose errors are 0.05, is 1e-4 standard deviations each.
    errors = np.array(list(alone.identification.standard_errors.values()))
    assert (np.abs(found.fit.values - alone.fit.values) < 1e-3 * errors).all()
    assert found.tables()["warnings"] == []


def test_a_simulator_that_diverges_ends_no_fit():
    def predict(theta):
        if theta["a"] > 4.0 or theta["k"] > 1.5:
            raise FloatingPointError("diverged")
        return by_numpy(theta)

    found = calibrate.run(simulator(predict, parameters={"a": 3.9, "k": 0.1}))
    assert found.fit.converged and found.fit.slopes.failures
    assert any("failed" in note for note in found.tables()["notes"])
    np.testing.assert_allclose(found.fit.values, calibrate.run(simulator()).fit.values, rtol=1e-8)


def raises(theta):
    raise RuntimeError("no\nlicence")


def stops_gradients(theta):
    return theta["a"] * jnp.exp(-jax.lax.stop_gradient(theta["k"]) * TIMES)


def remembers(theta):
    """Takes a number from the name of a traced value, as a command line would."""
    text = str(theta["k"])
    return theta["a"] * jnp.exp(-(float(text) if text.replace(".", "").isdigit() else 0.7) * TIMES)


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"predict": lambda theta: by_numpy(theta)[:-1]}, r"gives shape \(11,\) .* \(12,\)"),
        ({"predict": lambda theta: by_jax(theta)[:-1]}, r"gives shape \(11,\) .* \(12,\)"),
        ({"predict": lambda theta: by_numpy(theta) * np.nan}, "prediction 0 is nan at the start"),
        ({"predict": raises}, "raises RuntimeError at the start, a = 1, k = 1: no licence"),
        ({"predict": lambda theta: None}, "gives shape"),
        ({"predict": lambda theta: by_numpy(theta) * 1j}, "give real numbers"),
        ({"predict": 3}, "predict = 3: must be a function"),
        ({"predict": stops_gradients}, "depends on k, .* derivative by JAX is zero"),
        ({"predict": remembers}, "depends on k, .* derivative by JAX is zero|when JAX traces"),
        ({"differentiable": True}, "JAX cannot trace it"),
        ({"parameters": {"a": 1.0, "kk": 1.0}}, "raises KeyError at the start.*'k'"),
        ({"parameters": {"a": -1.0, "k": 1.0}}, "'a'.*median = -1: must be above zero, or give b"),
        ({"parameters": {"a": {"mean": 1.0}}}, "'a'.*mean = 1.0: unknown key; did you mean median"),
        ({"parameters": {"a": {"bounds": (2.0, 1.0)}}}, "must be .lower, upper."),
        ({"parameters": {"a": {"bounds": "ab"}}}, "must be a list"),
        ({"parameters": {"a": LogNormal(1.0, -1.0)}}, "greater than 0"),
        ({"parameters": ["a"]}, "must be a table by name"),
        ({"parameters": {}}, "none is free"),
        ({"parameters": {"a": {"value": 1.0}, "k": {"value": 1.0}}}, "none is free"),
        ({"errors": 0.0}, "errors = 0: must be above zero"),
        ({"errors": [1.0, 2.0]}, r"errors: have shape \(2,\)"),
        ({"readings": [1.0, np.nan]}, r"readings\[1\] = nan"),
        ({"readings": "abc"}, "must be numbers"),
        ({"readings": []}, "are none"),
        ({"labels": ["x"]}, "are 1 for 12 readings"),
        ({"at": TIMES, "labels": ["x"] * 12}, "give one of the two"),
        ({"step": 2.0}, "must be between 0 and 1"),
        ({"readings": READINGS[:2], "errors": None, "predict": lambda theta: by_numpy(theta)[:2]},
         "2 readings are too few"),
    ],
)  # fmt: skip
def test_what_cannot_be_fitted_is_refused_in_one_line(changes, said):
    with pytest.raises(InputError, match=said) as refused:
        calibrate.run(simulator(**changes))
    assert len(str(refused.value)) <= 400 and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "options", [{"model": "column"}, {"leave_one_out": True}, {"begin_with": "closed-form"}]
)
def test_options_of_experiments_are_refused(options):
    with pytest.raises(InputError, match="is for experiments with samples"):
        calibrate.run(simulator(), **options)


def test_a_posterior_needs_no_gradient():
    """The same draws of the same density, with other slopes at its optimum only."""
    for package in ("blackjax", "corner", "arviz_stats"):
        pytest.importorskip(package)
    ours, traced = (calibrate.run(simulator(one), posterior=True) for one in (by_numpy, by_jax))
    assert ours.faults == () and ours.posterior.converged and not ours.problem.traced
    np.testing.assert_allclose(ours.posterior.samples, traced.posterior.samples, rtol=1e-6)
    errors = list(ours.identification.standard_errors.values())
    # Of 500 independent samples or more.
    np.testing.assert_allclose(ours.posterior.samples.std(axis=0), errors, rtol=0.15)


def test_a_simulator_can_be_changed():
    longer = dataclasses.replace(simulator(), predict=by_jax, errors=0.1)
    assert calibrate.run(longer).problem.traced
