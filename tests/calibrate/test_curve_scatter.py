"""Curves without a stated error: their scatter is estimated with the fit, or from repeats."""

import json

import numpy as np
import pytest

import calibrate
from calibrate import Experiment
from calibrate.experiment.readings.scatter import LEAST
from calibrate.experiment.repeats import scatter_of_repeats
from calibrate.experiment.sample import Scatter
from calibrate.problem.solve import fit_experiment
from tests.builders.result_keys import undocumented
from tests.calibrate.test_workflow import with_a_curve

NOISE = 0.3
"""Of the readings, mm."""
FREE = """
[[parameter]]
name = "f_s"
median = 1.0
log_standard_deviation = 1.0
[[parameter]]
name = "bed_fraction"
median = 0.5
log_standard_deviation = 0.3
"""


def experiment_of(folder, times, seed=1, noise=NOISE, error=None):
    """A line that falls by 8 mm in a day, to 40 mm, with noise; of case 2."""
    heights = np.maximum(100.0 - 8.0 * np.asarray(times), 40.0)
    heights += noise * np.random.default_rng(seed).standard_normal(len(times))
    rows = [f"{time:g},{height:.6f}" for time, height in zip(times, heights, strict=True)]
    path = with_a_curve(folder, "\n".join(["time (d),h (mm)", *rows]))
    text = path.read_text().split("[[parameter]]")[0]
    if error is not None:
        text = text.replace('file = "a.csv"', f'file = "a.csv", standard_deviation = {error}')
    path.write_text(text.replace("bed_fraction", "# bed_fraction") + FREE)
    return Experiment.load(path)


def test_the_scatter_is_that_of_the_residuals_and_its_uncertainty_is_carried(tmp_path):
    """40 readings less two values that they alone tell."""
    done = calibrate.run(experiment_of(tmp_path, np.linspace(0.0, 12.0, 40)), model="closed-form")
    scatter = done.problem.experiment.samples[0].curve_scatter
    residuals = done.predictions - done.problem.measured
    assert scatter.source == "fit"
    assert scatter.degrees_of_freedom == pytest.approx(38.0, abs=0.01)
    assert scatter.value == pytest.approx((residuals @ residuals / 38.0) ** 0.5, rel=2e-3)
    assert abs(scatter.value - NOISE) < 3.0 * NOISE / (2.0 * scatter.degrees_of_freedom) ** 0.5
    np.testing.assert_allclose(done.problem.errors, scatter.value, rtol=2e-3)
    # Intervals are Student's; a fit with these errors stated has those of the normal distribution.
    stated = experiment_of(tmp_path, np.linspace(0.0, 12.0, 40), error=scatter.value)
    other = calibrate.run(stated, model="closed-form")
    for one, known in zip(done.profiles, other.profiles, strict=True):
        (low, high), (inner, outer) = (of.intervals["95 %"] for of in (one, known))
        assert np.log(high / low) / np.log(outer / inner) == pytest.approx(2.024 / 1.96, rel=5e-3)


def test_it_is_told_in_words_and_in_tables(tmp_path):
    done = calibrate.run(experiment_of(tmp_path, np.linspace(0.0, 12.0, 40)), model="closed-form")
    said = done.write(tmp_path / "out")
    table = json.loads((tmp_path / "out" / "fit.json").read_text("utf-8"))["scatter"]["A, curve"]
    assert (table["source"], table["unit"], table["observable"]) == ("fit", "mm", "mudline")
    assert undocumented(said) == set()
    text = (tmp_path / "out" / "report.md").read_text("utf-8")
    assert "The scatter of the readings of the mudline of sample A, 0." in text
    assert "estimated from their residuals" in text and said["p_value"] is None


def test_repeats_give_the_scatter_whatever_the_model(tmp_path):
    experiment = experiment_of(tmp_path, np.repeat([0.0, 2.0, 4.0, 6.0, 12.0], 4))
    scatter = experiment.samples[0].curve_scatter
    assert (scatter.source, scatter.degrees_of_freedom) == ("repeats", 15.0)
    assert abs(scatter.value - NOISE) < 3.0 * NOISE / (2.0 * scatter.degrees_of_freedom) ** 0.5
    problem, found = fit_experiment(experiment, "closed-form")
    assert found.converged and problem.experiment.samples[0].curve_scatter == scatter


def test_as_many_values_as_readings_leave_the_scatter_of_neighbours(tmp_path):
    experiment = experiment_of(tmp_path, [2.0, 10.0])
    begun = experiment.samples[0].curve_scatter
    done = calibrate.run(experiment, model="closed-form")
    scatter = done.problem.experiment.samples[0].curve_scatter
    assert scatter == begun and scatter.source == "assumed"
    assert "too few degrees of freedom" in "\n".join(calibrate.report.in_words(done.tables()))


def test_readings_without_noise_have_the_least_that_is_believed(tmp_path):
    experiment = experiment_of(tmp_path, np.linspace(0.0, 6.0, 12), noise=0.0)
    problem, _ = fit_experiment(experiment, "closed-form")
    assert problem.experiment.samples[0].curve_scatter.value == pytest.approx(100.0 * LEAST)


def test_the_scatter_of_repeats_is_that_about_their_means():
    """10, 12 and 3, 5, 4: squares of 2 and 2 about two means, with three degrees of freedom."""
    at, values = [0.0, 0.0, 9.0, 9.0, 9.0], [10.0, 12.0, 3.0, 5.0, 4.0]
    scatter = scatter_of_repeats(at, values, relative=False)
    assert scatter == Scatter(pytest.approx((4.0 / 3.0) ** 0.5), 3.0, "repeats")
    shares = scatter_of_repeats(at, values, relative=True)
    assert shares.value == pytest.approx(((2 / 121 + 2 / 16) / 3.0) ** 0.5)
    assert scatter_of_repeats(at[:4], values[:4], relative=False) is None
