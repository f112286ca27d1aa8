"""From measurements to factors: Fang's data, synthetic recovery, experiment files."""

from collections import OrderedDict
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import Experiment, LogNormal, Problem
from calibrate.data import Measurement, Sample
from calibrate.suspension import Suspension, suspension
from mrjax import drag

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12


@pytest.fixture(scope="module")
def fang() -> Experiment:
    return Experiment.load("fang2005")


def check_fang(problem, fit):
    """Needed hindrance: 491.222/8.0 = 61.403 for sample A, 4.8955 of case 3 scaled to 3.6 for B."""
    found = calibrate.identify(fit)
    assert fit.converged
    predicted = np.asarray(problem.predict(fit.theta))
    assert np.all(np.abs(predicted - [8.0, 78.0, 3.6, 90.0]) < [0.1, 1.0, 0.1, 1.0])
    first, second, *beds = found.combinations
    assert (first.expression, second.expression) == ("f_w * f_s", "f_v")
    assert [one.expression for one in beds] == ["bed_fraction[A]", "bed_fraction[B]"]
    # phi_0 / ratio of the coated particles: 0.33724 / 0.78 and 0.31284 1.1^3 / 0.9.
    for one, expected in zip(beds, (0.33724 / 0.78, 0.31284 * 1.331 / 0.9), strict=True):
        assert abs(one.value - expected) < one.standard_error
    assert abs(first.value - 61.403) < first.standard_error
    assert first.standard_error == near(61.4 * 0.1 / 8.0, rel=0.01)
    needed = 48.985 * 1.1 * 1.68 * 4.8955 / 3.6 / 61.403
    assert abs(second.value - needed) < second.standard_error
    assert found.null_directions == ("f_w / f_s",)
    alone = {"f_v", "bed_fraction[A]", "bed_fraction[B]"}
    assert {name for name, known in found.determined.items() if known} == alone
    return fit


def test_fang_2005_by_both_models(fang):
    fits = []
    for model in ("closed-form", "particles"):
        problem = Problem.prepare(fang, model, seed=1)
        fits.append(
            check_fang(
                problem, calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
            )
        )
    # The simulation has forgotten its start to e^-40.
    np.testing.assert_allclose(fits[0].values, fits[1].values, rtol=1e-6)


def test_fang_2005_from_three_times_off(fang):
    problem = Problem.prepare(fang, "closed-form")
    start = OrderedDict((name, 3 * value) for name, value in problem.start.items())
    fit = check_fang(problem, calibrate.fit(problem.residuals, start, priors=problem.priors))
    assert fit.model_runs <= 15


def synthetic(models, truth, fractions):
    """Velocities at three volume fractions, f_w = (1 - phi)^-n; surfactant in the last sample."""
    recipes = [mrjax.Recipe.load("case2")] * 2 + [mrjax.Recipe.load("case3")]

    def velocities(theta):
        predicted = []
        for position, (model, recipe, fraction) in enumerate(
            zip(models, recipes, fractions, strict=True)
        ):
            parameters = recipe.parameters().replace(
                f_w=drag.richardson_zaki(fraction, theta["n"]),
                f_s=theta["f_s"],
                f_v=theta["f_v"] if position == 2 else 1.0,
            )
            suspension = Suspension(parameters, jnp.asarray(fraction), None, None)
            predicted.append(model(suspension)["initial_velocity"])
        return jnp.stack(predicted)

    measured = velocities(OrderedDict((k, jnp.asarray(v)) for k, v in truth.items()))
    return lambda theta: (velocities(theta) / measured - 1.0) / 0.01


def velocity_of(recipe):
    """A sample whose initial velocity was measured."""
    measurement = Measurement("initial_velocity", 1.0, 1.0, "m/s", 1.0)
    return Sample(recipe.name, recipe, recipe.box.height, None, (measurement,))


@pytest.mark.parametrize("name", ["closed-form", "column", "particles"])
def test_synthetic_recovery_where_the_data_separate_the_factors(name):
    """A dilute and a dense sample tell n from f_s; the third tells f_v. Noise-free."""
    truth = OrderedDict(n=5.6, f_s=1.23, f_v=1.9)
    recipes = [mrjax.Recipe.load("case2")] * 2 + [mrjax.Recipe.load("case3")]
    make = calibrate.FORWARD_MODELS[name]
    models = [
        make(velocity_of(recipe), suspension(recipe, None, {"f_w": 5.0})) for recipe in recipes
    ]
    residuals = synthetic(models, truth, (0.02, 0.2, 0.35))
    fit = calibrate.fit(residuals, OrderedDict(n=3.0, f_s=2.0, f_v=1.0))
    assert fit.converged
    np.testing.assert_allclose(fit.values, list(truth.values()), rtol=1e-4)
    assert calibrate.identify(fit).null_directions == ()


def test_a_rheometer_and_a_dilute_sample_separate_all_three(tmp_path):
    """Data that determine f_w, f_s and f_v one by one, each with its own uncertainty."""
    path = tmp_path / "separated.toml"
    dilute = mrjax.Recipe.load("case1")
    (tmp_path / "dilute.toml").write_text(
        f"""
        name = "dilute"
        particle = {{density = 7470, diameter = 4e-6, elastic_modulus = 2e11, poisson_ratio = 0.3}}
        fluid = {{density = {dilute.fluid.density}, viscosity = 0.01}}
        composition = {{particle = 0.01, fluid = 0.99}}
        drag = {{f_w = 1.0}}
        box = {{size = [80e-6, 80e-6, 80e-6]}}
        """
    )
    path.write_text(
        """
        name = "separated"
        [[sample]]
        name = "dilute"
        recipe = "dilute.toml"
        initial_velocity = {value = 5.0, unit = "um/s", standard_deviation = 0.05}
        [[sample]]
        name = "B"
        recipe = "case3"
        initial_velocity = {value = 0.15, unit = "mm/h", standard_deviation = 0.003}
        viscosity_ratio = {value = 1.7, standard_deviation = 0.034}
        [[parameter]]
        name = "f_s"
        median = 1.1
        log_standard_deviation = 1.0
        [[parameter]]
        name = "f_w"
        samples = ["B"]
        median = 40
        log_standard_deviation = 1.0
        [[parameter]]
        name = "f_v"
        samples = ["B"]
        median = 1.5
        log_standard_deviation = 1.0
        """
    )
    experiment = Experiment.load(path)
    problem = Problem.prepare(experiment, "closed-form")
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    found = calibrate.identify(fit)
    assert fit.converged and all(found.determined.values())
    stokes = 2 * (7470 - 950) * 9.81 * (2e-6) ** 2 / (9 * 0.01)
    values = dict(zip(fit.names, fit.values, strict=True))
    # Wide priors shift a value by a part of its error.
    assert values["f_s"] == near(stokes / 5e-6, rel=1e-3)
    assert values["f_v"] == near(1.7, rel=1e-3)
    assert found.standard_errors["f_s"] / values["f_s"] == near(0.01, rel=0.02)


def test_a_value_for_each_sample(fang, tmp_path):
    text = """
        name = "each"
        [[sample]]
        name = "A"
        recipe = "case2"
        initial_velocity = {value = 8.0, unit = "mm/day", standard_deviation = 0.1}
        [[sample]]
        name = "B"
        recipe = "case3"
        initial_velocity = {value = 3.6, unit = "mm/day", standard_deviation = 0.1}
        [[parameter]]
        name = "f_w"
        per_sample = true
        median = 50.0
        log_standard_deviation = 0.5
    """
    path = tmp_path / "each.toml"
    path.write_text(text)
    problem = Problem.prepare(Experiment.load(path), "closed-form")
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    assert fit.names == ("f_w[A]", "f_w[B]")
    np.testing.assert_allclose(fit.values, [61.403 / 1.1, 48.985 * 4.8955 / 3.6], rtol=2e-3)
    assert all(calibrate.identify(fit).determined.values())


GOOD = """
name = "mine"
[[sample]]
name = "A"
recipe = "case2"
initial_velocity = {value = 8.0, unit = "mm/day", standard_deviation = 0.1}
[[parameter]]
name = "f_w"
median = 50.0
log_standard_deviation = 0.5
"""


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"mm/day"', '"mm/week"', ["unit = 'mm/week'", "one of m/s"]),
        ("standard_deviation = 0.1", "standard_deviation = 0.0", ["= 0.0", "above zero"]),
        ("value = 8.0", "value = -8.0", ["value = -8.0", "above zero"]),
        ("value = 8.0", "value = nan", ["value = nan", "finite"]),
        (', unit = "mm/day"', "", ["unit is missing", "mm/day"]),
        ('name = "f_w"', 'name = "f_q"', ["'f_q'", "no such quantity", "f_s, f_v"]),
        ('"case2"', '"case9"', ["sample 'A'", "recipe case9", "no such file"]),
        ("median = 50.0", "median = 50.0\nsamples = ['Z']", ["'Z'", "no such sample", "known: A"]),
        ("median = 50.0", "mediam = 50.0", ["mediam", "did you mean median"]),
        ("initial_velocity = {", "initial_velocit = {", ["did you mean initial_velocity"]),
        ("[[parameter]]", "[parameter]", ["parameter", "[[parameter]]"]),
    ],
)
def test_a_wrong_experiment_gets_one_line(tmp_path, old, new, words):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    Experiment.load(path)
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(mrjax.InputError) as refusal:
        Experiment.load(path)
    message = str(refusal.value)
    assert str(path) in message and "\n" not in message
    for word in words:
        assert word in message


def test_a_prior_can_be_given_in_python(fang):
    problem = Problem.prepare(fang, "closed-form")
    tight = problem.priors | {"f_s": LogNormal(1.5, 1e-4)}
    fit = calibrate.fit(problem.residuals, problem.start, priors=tight)
    assert dict(zip(fit.names, fit.values, strict=True))["f_s"] == near(1.5, rel=1e-3)
