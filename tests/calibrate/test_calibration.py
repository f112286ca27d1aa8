"""From measurements to factors: Fang's data, synthetic recovery, experiment files."""

import re
from collections import OrderedDict
from functools import partial
from importlib import resources

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import Experiment, LogNormal, Problem, report
from calibrate.experiment.free_parameters import ParameterSheet, free_parameters
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import Suspension, suspension
from calibrate.problem.beginnings import Beginnings
from calibrate.problem.solve import fit_experiment
from calibrate.report import formatting
from mrjax.laws import drag
from tests.builders.coarse_column import coarse_column

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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    "name", ["closed-form", "column", pytest.param("particles", marks=pytest.mark.slow)]
)
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
        ('"mm/day"', '"mm/fortnight"', ["unit = 'mm/fortnight'", "such as m/s"]),
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


TUBE = """
name = "tube"
[[sample]]
name = "A"
recipe = "local.toml"
height = 0.1
curve = {file = "a.csv", time_unit = "h", unit = "mm", standard_deviation = 0.5}
final_ratio = {value = 60.0, standard_deviation = 1.0, unit = "%"}
[[parameter]]
name = "f_w.exponent"
median = 4.65
log_standard_deviation = 0.2
[[parameter]]
name = "bed_fraction"
median = 0.6
bounds = [0.5, 0.7]
standard_deviation = 0.05
[[parameter]]
name = "f_s"
value = 1.1
"""


@pytest.fixture
def tube(tmp_path):
    """An experiment with a curve, a coefficient, bounds and a held value."""
    recipe = (resources.files("mrjax.recipe.bundled") / "case2.toml").read_text("utf-8")
    recipe = recipe.replace('f_w = "son2018"', 'f_w = "richardson-zaki"\nlocal = true')
    (tmp_path / "local.toml").write_text(recipe)
    (tmp_path / "a.csv").write_text("time,mudline\n1,99\n2,97\n24,80\n")
    path = tmp_path / "tube.toml"
    path.write_text(TUBE)
    return path


def test_an_experiment_with_a_curve(tube):
    experiment = Experiment.load(tube)
    (sample,) = experiment.samples
    assert sample.height == 0.1
    assert [sample.times[one.place] for one in sample.readings_of_curve] == [3600, 7200, 86400]
    assert [one.observable for one in sample.measurements] == ["final_ratio"] + 3 * ["mudline"]
    exponent, bed = experiment.parameters
    assert bed.value(bed.start) == near(0.6) and bed.start == near(1.0)
    # d value / d ln x at the middle of the bounds is a quarter of their distance.
    assert bed.per_log(bed.start) == near(0.05)
    assert bed.prior.log_standard_deviation == near(1.0)
    start = {exponent.variable: 5.0, bed.variable: 3.0}
    suspension = experiment.suspension_of(sample, start)
    fraction = sample.recipe.coated_volume_fraction
    assert float(suspension.parameters.f_w) == near((1 - fraction) ** -5.0)
    assert float(suspension.parameters.f_s) == 1.1
    assert float(suspension.bed_fraction) == near(0.5 + 0.2 * 0.75)
    assert float(suspension.hindrance(0.2)) == near(0.8**-5.0)


def test_the_models_agree_where_all_of_them_apply(tube):
    """Before the tube's bed is felt at its mudline: a straight line, whatever the model."""
    experiment = Experiment.load(tube)
    start = {one.variable: one.start for one in experiment.parameters}
    closed, column = (
        np.asarray(Problem.prepare(experiment, name).predict(start))
        for name in ("closed-form", "column")
    )
    np.testing.assert_allclose(column[:3], closed[:3], rtol=1e-6)


@pytest.mark.slow
def test_particles_scale_the_times_of_one_run(case2):
    """Without inertia a curve knows of time only t / f: the same run at twice the drag."""
    recipe = case2.model_copy(update={"box": mrjax.Box((10e-6, 10e-6, 20e-6))})
    measured = Measurement("sedimentation_ratio", 1.0, 1.0, "1", 1.0, 0)
    sample = Sample("A", recipe, 1.0, None, (measured,), (2e4, 1e5, 1e9))
    near_by = suspension(recipe, None, {})
    predict = calibrate.FORWARD_MODELS["particles"](sample, near_by, 0, ("f_s",))
    found = predict(near_by)
    slower = predict(suspension(recipe, None, {"f_s": 1.01 * recipe.f_s}))
    # A tube of 1 m, 50,000 boxes high: its top falls freely for a day.
    fallen = float(mrjax.terminal_velocity(near_by.parameters)) * 8e4
    ratio, later = found["sedimentation_ratio"], slower["sedimentation_ratio"]
    # But for half of the first step, which is lost within the first frame: 3e-4.
    assert float(ratio[0] - ratio[1]) == near(fallen, rel=1e-3)
    assert float(later[0] - later[1]) == near(fallen / 1.01, rel=1e-3)
    assert float((ratio[0] - ratio[1]) / (later[0] - later[1])) == near(1.01, rel=5e-4)
    assert float(found["final_ratio"]) == near(float(found["sedimentation_ratio"][2]))
    with pytest.raises(mrjax.InputError, match="friction changes the path of particles"):
        calibrate.FORWARD_MODELS["particles"](sample, near_by, 0, ("friction",))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("height = 0.1\n", "", ["sample 'A'", "height is missing"]),
        ('"a.csv"', '"b.csv"', ["b.csv: no such file"]),
        ('"h"', '"month"', ["time_unit = 'month'", "one of s, min"]),
        ('unit = "mm", s', 'unit = "kg", s', ["unit = 'kg'", "one of m, dm, cm"]),
        ("value = 60.0", "value = 160.0", ["100"]),
        (', unit = "%"', "", ["final_ratio.value = 60", 'unit = "%"']),
        ("f_w.exponent", "f_w.power", ["f_w.power", "no such coefficient", "f_w.exponent"]),
        ("f_w.exponent", "f_w", ["local drag", "f_w.exponent"]),
        ("bounds = [0.5, 0.7]", "bounds = [0.65, 0.7]", ["bounds", "either side of the median"]),
        ("bounds = [0.5, 0.7]\n", "", ["standard_deviation = 0.05", "log_standard_deviation"]),
        ("value = 1.1", "", ["parameter 'f_s'", "median", "value"]),
        ("value = 1.1", "value = 1.1\nmedian = 1.2", ["parameter 'f_s'", "either"]),
        ("height = 0.1", "height = 0.1\nbed_fraction = 0.6", ["bed_fraction = 0.6", "of its own"]),
        (
            "median = 0.6\nbounds = [0.5, 0.7]\nstandard_deviation = 0.05",
            "median = 60.0",
            ["bed_fraction", "60", "between 0 and 1"],
        ),
        ("value = 1.1", "median = 1.1\nsamples = []", ["samples"]),
        ("height = 0.1", "height = 0.1\nbed_fraction = 60.0", ["bed_fraction = 60", "0 and 1"]),
    ],
)
def test_a_wrong_tube_gets_one_line(tube, old, new, words):
    assert old in TUBE
    tube.write_text(TUBE.replace(old, new))
    with pytest.raises(mrjax.InputError) as refusal:
        Experiment.load(tube)
    message = str(refusal.value)
    assert "\n" not in message
    for word in words:
        assert word in message


PRIOR_OF_EXPONENT = "log_standard_deviation = 0.2\n"
FREE_SHAPE = 'name = "f_s"\nmedian = {}'


@pytest.mark.slow
def test_a_model_is_prepared_again_where_the_fit_leads(tube):
    """From a median from which the column has too few steps: the same end."""
    ends = []
    for median in (1.1, 40.0):
        shape = FREE_SHAPE.format(median)
        tube.write_text(TUBE.replace('name = "f_s"\nvalue = 1.1', shape))
        problem, found = fit_experiment(Experiment.load(tube), coarse_column)
        assert found.converged and problem.holds_at(found.theta)
        assert not problem.holds_at({**found.theta, "f_s": 16.0 * found.theta["f_s"]})
        ends.append(found.theta["f_s"])
    # A fit has converged at 0.01 of its error, which is 40 % here: the exponent's prior is in it.
    assert float(ends[1]) == near(float(ends[0]), rel=0.02)
    _, begun = fit_experiment(Experiment.load(tube), coarse_column, begin_with="closed-form")
    assert float(begun.theta["f_s"]) == near(float(ends[1]), rel=0.02)


def test_a_fit_that_leads_far_from_where_its_model_holds_has_not_converged(tube, monkeypatch):
    """However well it ends by itself: particles so slow that the column has steps enough."""
    monkeypatch.setattr("calibrate.problem.solve.MOST_PREPARED", 1)
    monkeypatch.setattr(
        "calibrate.problem.solve.beginnings",
        lambda experiment, *_: Beginnings([experiment.start], [], 0),
    )
    tube.write_text(TUBE.replace('name = "f_s"\nvalue = 1.1', FREE_SHAPE.format(0.5)))
    problem, found = fit_experiment(Experiment.load(tube), coarse_column)
    assert not problem.holds_at(found.theta) and not found.converged
    by_itself = calibrate.fit(problem.residuals, problem.near, priors=problem.priors)
    assert by_itself.converged


def test_where_nothing_is_felt_there_is_no_optimum(tube):
    """Every reading after the bed is met, by a median a thousand times too fast."""
    lines = TUBE.split("[[parameter]]")[0].replace("final_ratio", "# final_ratio")
    bed = '[[parameter]]\nname = "bed_fraction"\nvalue = 0.6\n'
    tube.write_text(f"{lines}{bed}[[parameter]]\n{FREE_SHAPE.format(1e-3)}")
    problem = Problem.prepare(Experiment.load(tube), "closed-form")
    assert not calibrate.fit(problem.residuals, problem.start).converged
    # What the curve falls by before it is read first says enough to begin with.
    _, found = fit_experiment(problem.experiment, "closed-form")
    assert found.theta["f_s"] > 1.0


def test_what_another_prior_bounds_is_not_called_undetermined(tube):
    """f_s has no prior; its product with what the exponent makes is measured, and that has one."""
    shape = FREE_SHAPE.format(1.1)
    text = TUBE.replace('name = "f_s"\nvalue = 1.1', shape)
    ends = {}
    for name in ("bounded", "open"):
        tube.write_text(text if name == "bounded" else text.replace(PRIOR_OF_EXPONENT, ""))
        problem, found = fit_experiment(Experiment.load(tube), "closed-form")
        predicted = np.asarray(problem.predict(found.theta))
        result = report.summary(problem, found, calibrate.identify(found), predicted)
        ends[name] = result["told_together"], result["undetermined"]
        said = "\n".join(report.in_words(result))
        page = report.markdown("tube", "closed-form", result | {"wall_seconds": 0.0}, {})
        assert ("Neither data nor a prior determine" in said) == (name == "open")
        (row,) = [line for line in page.splitlines() if line.startswith("| `f_s`")]
        assert ("no, prior only" in row) == (name == "bounded")
    # The final ratio tells of the bed.
    assert ends["bounded"] == (["f_w.exponent", "f_s"], [])
    assert ends["open"] == ([], ["f_w.exponent", "f_s"])


def test_a_fit_warns_where_the_model_ends(tube):
    """Grains of 2 mm in oil that fall at 20 mm/s, whatever is fitted."""
    coarse = tube.parent / "coarse.toml"
    sheet = resources.files("mrjax.recipe.bundled").joinpath("case2.toml").read_text("utf-8")
    coarse.write_text(
        sheet.replace("4e-6", "2e-3").replace("25e-6", "0.0125").replace("50e-6", "0.025")
    )
    sample = '[[sample]]\nname = "G"\nrecipe = "coarse.toml"\n'
    velocity = 'initial_velocity = {value = 20.0, unit = "mm/s", standard_deviation = 1.0}\n'
    tube.write_text(f'name = "g"\n{sample}{velocity}[[parameter]]\nname = "f_s"\nmedian = 1.0\n')
    problem, found = fit_experiment(Experiment.load(tube), "closed-form")
    predicted = np.asarray(problem.predict(found.theta))
    result = report.summary(problem, found, calibrate.identify(found), predicted)
    reynolds = 950.0 * 20e-3 * 2e-3 / 0.01
    assert result["validity"]["G"]["Reynolds"] == {"value": near(reynolds), "holds": "below 0.1"}
    [warning] = result["warnings"]
    assert warning.startswith("sample G: Reynolds number 3.8 is above 0.1")
    page = report.markdown("g", "closed-form", result | {"wall_seconds": 0.0}, {})
    assert f"**Warning:** {warning}." in page


@pytest.mark.parametrize(
    "error, words", [(0.5, "10.00 ± 0.50"), (0.0, "10"), (np.inf, "10 (error unbounded)")]
)
def test_an_error_may_be_none_or_unbounded(error, words):
    assert formatting.with_error(10.0, error) == words


def test_parameters_of_one_name_have_labels_of_their_own():
    sheet = ParameterSheet(name="f_s", median=1.1, samples=["A"])
    assert [one.label for one in free_parameters(sheet, ["A", "B"], once=False)] == ["f_s[A]"]
    assert [one.label for one in free_parameters(sheet, ["A", "B"])] == ["f_s"]


def test_a_model_may_be_given_as_such(tube):
    """One that takes the tube by finite volumes: exact where the suspension falls, and at rest."""
    experiment = Experiment.load(tube)
    of_own, of_column = (Problem.prepare(experiment, model) for model in (coarse_column, "column"))
    predicted, exact = (problem.predict(problem.start) for problem in (of_own, of_column))
    np.testing.assert_allclose(predicted[1:], exact[1:], rtol=1e-9)
    assert of_column.everywhere and not of_own.everywhere


def test_a_column_of_several_sizes_has_the_threshold_of_its_sample(tube):
    recipe = (tube.parent / "local.toml").read_text()
    recipe = re.sub(r"diameter = 4e-6", "diameter = {values = [3e-6, 5e-6]}", recipe)
    (tube.parent / "local.toml").write_text(recipe)
    text = tube.read_text()
    predicted = []
    for threshold in ("", "mudline_threshold = 0.05\n"):
        tube.write_text(text.replace("[[sample]]\n", f"[[sample]]\n{threshold}", 1))
        problem = Problem.prepare(Experiment.load(tube), "column")
        assert problem.everywhere
        predicted.append(np.asarray(problem.predict(problem.start)))
    assert np.isfinite(predicted).all()
    assert (predicted[1] >= predicted[0] - 1e-9).all() and (predicted[1] > predicted[0]).any()
    tube.write_text(text.replace("[[sample]]\n", "[[sample]]\nmudline_threshold = 1.0\n", 1))
    with pytest.raises(mrjax.InputError, match="mudline_threshold"):
        Experiment.load(tube)


def test_a_bed_nobody_told_of_is_refused(tube):
    lines = TUBE.split('[[parameter]]\nname = "bed_fraction"')
    rest = lines[1].split("[[parameter]]")[1]
    tube.write_text(f"{lines[0]}[[parameter]]{rest}")
    experiment = Experiment.load(tube)
    for name in ("closed-form", "column"):
        with pytest.raises(mrjax.InputError, match="the volume fraction of its bed is not known"):
            Problem.prepare(experiment, name)


def test_a_prior_can_be_given_in_python(fang):
    problem = Problem.prepare(fang, "closed-form")
    tight = problem.priors | {"f_s": LogNormal(1.5, 1e-4)}
    fit = calibrate.fit(problem.residuals, problem.start, priors=tight)
    assert dict(zip(fit.names, fit.values, strict=True))["f_s"] == near(1.5, rel=1e-3)
