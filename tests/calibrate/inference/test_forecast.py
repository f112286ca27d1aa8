"""Forecasts of new recipes: what applies to them, and what is believed of it."""

import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import Experiment, Problem
from calibrate.experiment.sample import Measurement
from calibrate.inference.forecast import Forecast, forecast, leave_out, sample_like

near = pytest.approx

TWO = """
name = "two"
[[sample]]
name = "A"
recipe = "case2"
bed_fraction = 0.5
initial_velocity = {value = 8.0, unit = "mm/day", standard_deviation = 0.1}
[[sample]]
name = "B"
recipe = "case2"
initial_velocity = {value = 4.0, unit = "mm/day", standard_deviation = 0.1}
[[parameter]]
name = "f_w"
median = 50.0
log_standard_deviation = 0.5
[[parameter]]
name = "f_s"
samples = ["A"]
value = 1.5
[[parameter]]
name = "f_v"
samples = ["B"]
value = 3.0
[[parameter]]
name = "viscosity"
per_sample = true
median = 0.01
log_standard_deviation = 0.1
"""


@pytest.fixture
def two(tmp_path) -> Experiment:
    (tmp_path / "two.toml").write_text(TWO)
    return Experiment.load(tmp_path / "two.toml")


def test_a_new_recipe_has_what_its_sample_holds_and_not_what_others_do(two):
    for name, f_s, f_v in (("A", 1.5, 1.0), ("B", 1.1, 3.0)):
        wider, sample = sample_like(two, mrjax.Recipe.load("case2"), name)
        parameters = wider.suspension_of(sample, two.start).parameters
        assert (float(parameters.f_s), float(parameters.f_v)) == (f_s, f_v)
        assert wider.varied(sample) == ("f_w", "viscosity")
        (old,) = [one for one in two.samples if one.name == name]
        known = wider.suspension_of(old, two.start).parameters
        assert (float(known.f_s), float(known.f_v)) == (f_s, f_v)


def test_the_bed_of_a_new_recipe_is_predicted_where_its_sample_has_one(two):
    for name, observables in (
        ("A", ["initial_velocity", "final_ratio"]),
        ("B", ["initial_velocity"]),
    ):
        _, sample = sample_like(two, mrjax.Recipe.load("case2"), name)
        assert [one.observable for one in sample.measurements] == observables
        assert all(np.isnan(one.value) for one in sample.measurements)


def test_what_the_fit_does_not_know_is_believed_as_before(two):
    """Velocity ~ 1 / (f_w viscosity); without B nothing is known of its viscosity but the prior."""
    rest = leave_out(two, "B")
    assert [one.label for one in rest.parameters] == ["f_w", "viscosity[A]"]
    problem = Problem.prepare(rest, "closed-form")
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    (one,) = forecast(two, fit, two.samples[1], "closed-form")
    # f_w viscosity[A] is known to 0.1 / 8; f_w, by priors of 0.5 and 0.1, to 0.1 beside it.
    product = np.linalg.inv([[0.5**-2 + 6400.0, 6400.0], [6400.0, 0.1**-2 + 6400.0]])
    error = np.hypot(np.sqrt(product[0, 0]), 0.1)
    assert one.standard_error / one.predicted == near(error, rel=1e-3)
    # Eight as measured, with B's f_s of 1.1 for 1.5 and its f_v of 3.
    assert one.predicted == near(8.0 * 1.5 / 1.1 / 3.0, rel=1e-2)
    assert one.time is None


def test_a_difference_counts_in_errors_of_both():
    measured = Measurement("initial_velocity", 10.0, 3.0, "mm/day", 1.0)
    assert Forecast("A", measured, 20.0, 4.0).off == near(2.0)
    assert Forecast("A", measured, 5.0, 4.0).off == near(-1.0)
    assert Forecast("A", measured, 5.0, np.inf).off == 0.0


def test_a_point_of_a_curve_has_its_time(tmp_path):
    (tmp_path / "a.csv").write_text("time,mudline\n1,92\n2,84\n")
    curve = 'height = 0.1\ncurve = {file = "a.csv", time_unit = "h", unit = "mm", '
    curve += "standard_deviation = 1.0}\n"
    text = TWO.replace("bed_fraction = 0.5\n", f"bed_fraction = 0.5\n{curve}")
    (tmp_path / "one.toml").write_text(text)
    experiment = Experiment.load(tmp_path / "one.toml")
    problem = Problem.prepare(experiment, "closed-form")
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    found = forecast(experiment, fit, experiment.samples[0], "closed-form")
    assert [one.time for one in found] == [None, 3600.0, 7200.0]
