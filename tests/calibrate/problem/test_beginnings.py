"""Where fits begin: chalk, whose curve has several optima, from starts three decades apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from calibrate.experiment.experiment import Experiment
from calibrate.inference.identify import identify
from calibrate.least_squares.unknowns import unknowns
from calibrate.problem.beginnings import beginnings
from calibrate.problem.initial_slope import initial_slope, with_initial_slopes
from calibrate.problem.problem import Problem
from calibrate.problem.solve import fit_experiment
from mrjax import InputError, terminal_velocity
from tests.builders import ROOT

CHALK = """
name = "chalk"
[particle]
density = 2150.0
diameter = 20e-6
elastic_modulus = 70e9
poisson_ratio = 0.25
[fluid]
density = 1000.0
viscosity = 0.001
[composition]
particle = 0.085
fluid = 0.915
[drag]
f_w = {closure = "richardson-zaki", exponent = 4.65}
local = true
[contact]
friction = 0.2
[box]
size = [120e-6, 120e-6, 240e-6]
periodic = [true, true, false]
"""
TUBE = """
name = "chalk"
[[sample]]
name = "A"
recipe = "chalk.toml"
height = 0.76
curve = {file = "chalk.csv", time_unit = "min", unit = "mm", standard_deviation = 3}
[[parameter]]
name = "f_w.exponent"
median = 65
log_standard_deviation = 1.0
[[parameter]]
name = "f_s"
median = 0.03
log_standard_deviation = 1.0
[[parameter]]
name = "bed_fraction"
median = 0.13
log_standard_deviation = 0.3
"""
OTHER_MEDIANS = [("median = 65", "median = 30"), ("median = 0.03", "median = 1.0")]
BETTER = 110.0
"""Chi-squared below which is the better valley alone."""


@pytest.fixture
def chalk(tmp_path):
    """Loads the experiment, with parts of its text in the place of others."""
    (tmp_path / "chalk.toml").write_text(CHALK)
    (tmp_path / "chalk.csv").write_text((ROOT / "notebooks/chalk/chalk.csv").read_text("utf-8"))

    def loaded(*changes):
        text = TUBE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "tube.toml").write_text(text)
        return Experiment.load(tmp_path / "tube.toml")

    return loaded


def start_of(name, value):
    """A change of the text: where the search for a parameter begins."""
    return f'name = "{name}"\n', f'name = "{name}"\nstart = {value}\n'


def test_the_start_of_a_search_changes_neither_its_end_nor_the_prior(chalk):
    """Ten starts over three decades, and one optimum of the cheap model."""
    ends = []
    for factor in np.geomspace(10**-1.5, 10**1.5, 10):
        experiment = chalk(
            start_of("f_s", 0.03 * factor), start_of("f_w.exponent", 65 * factor ** (1 / 3))
        )
        assert experiment.parameters[1].prior.median == 0.03
        begun = beginnings(experiment, "column", 0, None)
        problem = Problem.prepare(experiment, "column")
        ends.append(problem_loss(problem, begun.promising[0]))
        assert all(other.finished for other in begun.others)
    assert max(ends) < BETTER
    assert np.ptp(ends) < 0.1


def problem_loss(problem, theta):
    """Sum of squares, priors included."""
    residuals = np.asarray(problem.residuals(theta))
    of_priors = [
        np.log(theta[name] / prior.median) / prior.log_standard_deviation
        for name, prior in problem.priors.items()
    ]
    return float(residuals @ residuals + np.square(of_priors).sum())


@pytest.mark.slow
@pytest.mark.parametrize("changes", [[], OTHER_MEDIANS], ids=["near medians", "other medians"])
def test_a_column_ends_in_the_better_valley_and_tells_of_the_other(chalk, changes):
    _, fit = fit_experiment(chalk(*changes), "column")
    assert fit.converged and fit.chi_squared < BETTER
    assert fit.model_runs < 20
    assert len(fit.optima) > 1
    # A bed that no reading has met is as good, beside such a misfit: chi-squared 104.3 of 89.7.
    said = identify(fit)
    assert not said.determined["bed_fraction"] and said.determined["f_w.exponent"]
    assert said.data_standard_errors["bed_fraction"] > 0.2
    if changes:
        assert any(other.chi_squared == pytest.approx(409.3, abs=0.1) for other in fit.optima)


def test_a_model_of_one_s_own_begins_at_the_start_with_the_drag_of_the_curve(chalk):
    def own(*_):
        raise AssertionError("a model of one's own may take hours: it is not asked for places")

    experiment = chalk(start_of("f_s", 3.0))
    begun = beginnings(experiment, own, 0, None)
    ((theta,), others, places) = begun
    assert (others, places) == ([], 0)
    suspension = experiment.suspension_of(experiment.samples[0], theta)
    falls = float(np.mean(terminal_velocity(suspension.parameters)))
    assert falls == pytest.approx(initial_slope(experiment.samples[0]), rel=1e-3)
    # The bed has no part in it, and both of the others have, by priors of equal width.
    assert theta["bed_fraction"] == pytest.approx(0.13, rel=1e-9)
    assert theta["f_s"] < 3.0 and theta["f_w.exponent"] < 65.0


def sample_of(points, height=1.0, observable="mudline"):
    measurements = [
        SimpleNamespace(observable=observable, value=value, si=1.0, place=place)
        for place, (_, value) in enumerate(points)
    ]
    times = tuple(time for time, _ in points)
    return SimpleNamespace(measurements=measurements, times=times, height=height)


@pytest.mark.parametrize(
    "points, height, observable, slope",
    [
        ([(1, 0.9), (2, 0.8), (3, 0.7), (9, 0.1), (20, 0.1)], 1.0, "mudline", 0.1),
        ([(1, 1.8), (2, 1.6), (20, 0.8)], 2.0, "mudline", 0.2),
        ([(1, 0.9), (2, 0.8), (20, 0.4)], 2.0, "sedimentation_ratio", 0.2),
        ([(0, 1.0), (10, 0.2)], 1.0, "mudline", 0.08),
        ([(0, 1.0), (10, 1.0)], 1.0, "mudline", None),
        ([], 1.0, "mudline", None),
    ],
)
def test_the_initial_slope_is_that_of_the_first_third(points, height, observable, slope):
    found = initial_slope(sample_of(points, height, observable))
    assert found is None if slope is None else found == pytest.approx(slope, rel=1e-9)


def test_what_no_curve_tells_of_is_not_moved(chalk):
    """Without a curve nothing is; and nothing where all that is fitted has no part in the speed."""
    experiment = chalk()
    problem = Problem.prepare(experiment, "column")
    unknown = unknowns(problem.start, problem.priors, problem.bounds)
    places = unknown.starts(5, 0)
    moved = with_initial_slopes(experiment, unknown, places)
    np.testing.assert_array_equal(moved[:, 2], places[:, 2])
    assert (moved[:, :2] != places[:, :2]).all()
    fang = Experiment.load("fang2005")
    of_fang = unknowns(fang.start, {}, {})
    places = of_fang.starts(3, 0)
    assert with_initial_slopes(fang, of_fang, places) is places


@pytest.mark.parametrize(
    "change, words",
    [
        (("median = 65\n", "median = 65\nstart = 0\n"), "start = 0: must be greater than 0"),
        (("median = 0.13\n", "median = 0.13\nstart = 3\n"), "3 is no volume fraction"),
        (("median = 65\nlog_standard_deviation = 1.0", "value = 65\nstart = 3"), "leave out prior"),
        (
            ("median = 65\nlog_standard_deviation = 1.0", "median = 65\nbounds = [9, 99]\nstart=5"),
            "start = 5: must be between its bounds, 9 and 99",
        ),
    ],
)
def test_a_start_that_cannot_be_gets_one_line(chalk, change, words):
    with pytest.raises(InputError) as refusal:
        chalk(change)
    assert words in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_bounded_parameter_begins_at_its_start_and_believes_its_median(chalk):
    bounded = "median = 0.13\nbounds = [0.1, 0.2]\nstandard_deviation = 0.01\nstart = 0.16"
    experiment = chalk(("median = 0.13\nlog_standard_deviation = 0.3", bounded))
    bed = experiment.parameters[2]
    assert bed.value(bed.start) == pytest.approx(0.16, rel=1e-12)
    assert bed.value(bed.prior.median) == pytest.approx(0.13, rel=1e-12)
    assert experiment.medians[bed.variable] == bed.middle != bed.start


def test_a_bed_no_thinner_than_its_suspension_holds_during_a_fit(chalk):
    """f_r makes the suspension denser: beyond its bed a fit turns back."""
    experiment = chalk(('name = "f_s"\nmedian = 0.03', 'name = "f_r"\nmedian = 1.1'))
    problem = Problem.prepare(experiment, "closed-form")
    (sample,) = experiment.samples
    full = (0.13 / sample.recipe.volume_fraction) ** (1 / 3)
    for factor, there in ((0.99, True), (1.01, False)):
        residuals = problem.residuals({**problem.start, "f_r": full * factor})
        assert bool(np.isfinite(np.asarray(residuals)).all()) == there
