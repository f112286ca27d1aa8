"""The tube of a fitted sample: its mudline is the predicted one, its clock that of the delay."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment.sample import Point
from calibrate.experiment.suspension import suspension
from calibrate.models import polydisperse
from calibrate.models.column import column
from calibrate.models.tube import TIMES, tube
from calibrate.report.page import write_tubes
from tests.calibrate.models.test_polydisperse import EQUAL, FALL, HEIGHT, SPREAD, sample
from tests.calibrate.models.test_yielding import SAMPLE
from tests.calibrate.models.test_yielding import tube as yielding_suspension

BED, DELAY = 0.5, 0.2 * FALL


def test_a_delay_slows_the_clock_of_all_fields():
    one = sample(EQUAL)
    delayed = suspension(EQUAL, BED, {"delay": DELAY})
    settled = tube(one, delayed, BED)
    times = np.asarray(settled.times)
    assert times[-1] == one.times[-1] and times.size == TIMES
    predicted = column(one, delayed)(delayed, jnp.asarray(times))["mudline"]
    np.testing.assert_allclose(settled.mudline, predicted, rtol=1e-12)
    upright = tube(one, suspension(EQUAL, BED, {}), BED)
    slower = 1.0 - np.exp(-times / DELAY)
    top = np.asarray(settled.settling_velocity).max(axis=1)[1:30]
    falling = float(upright.settling_velocity[0].max())
    np.testing.assert_allclose(top, falling * slower[1:30], rtol=1e-6)


def test_the_fields_of_a_yielding_bed_and_of_classes_have_the_predicted_mudline(monkeypatch):
    bed = yielding_suspension()
    settled = tube(SAMPLE, bed, 0.74)
    predicted = column(SAMPLE, bed)(bed, settled.times)["mudline"]
    np.testing.assert_allclose(settled.mudline, predicted, rtol=1e-9)
    assert settled.solid_stress[-1].max() > 10.0
    monkeypatch.setattr(polydisperse, "CELLS", 30)
    monkeypatch.setattr(polydisperse, "CLASSES", 3)
    fitted = {"geometric_standard_deviation": 1.3, "delay": DELAY}
    for recipe, changes in ((EQUAL, fitted), (SPREAD, {"delay": DELAY})):
        powder, spread = sample(recipe), suspension(recipe, BED, changes)
        settled = tube(powder, spread, BED)
        predicted = column(powder, spread)(spread, settled.times)["mudline"]
        np.testing.assert_allclose(settled.mudline, predicted, rtol=1e-6)
    assert settled.class_velocities.shape == (TIMES, 3, 30)
    assert not settled.class_velocities[0].any()  # at the start of the delay


SHEET = """
name = "tubes"
[[sample]]
name = "A"
recipe = "case2"
height = 0.1
bed_fraction = 0.5
curve = {file = "a.csv"}
[[parameter]]
name = "f_w"
median = 50.0
"""


def test_a_fit_writes_the_fields_of_its_tubes(tmp_path):
    (tmp_path / "a.csv").write_text("time (d),h (mm)\n0,100\n1,92\n2,84.2\n3,75.9\n4,68\n")
    (tmp_path / "one.toml").write_text(SHEET)
    done = calibrate.run(tmp_path / "one.toml", model="column")
    done.write(tmp_path / "out")
    assert {"fields.csv", "fields.npz", "fields.png"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert "![fields](fields.png)" in (tmp_path / "out" / "report.md").read_text("utf-8")
    (settled,) = done.tubes.values()
    with np.load(tmp_path / "out" / "fields.npz") as arrays:
        np.testing.assert_array_equal(arrays["volume_fraction"], settled.volume_fraction)
    axes, _ = calibrate.report.figures.fields_figure(done.problem, done.tubes).axes
    _, measured = axes.lines
    np.testing.assert_allclose(measured.get_ydata(), [0.1, 0.092, 0.0842, 0.0759, 0.068])
    np.testing.assert_allclose(measured.get_xdata(), [0.0, 1.0, 2.0, 3.0, 4.0])
    other = replace(done, options=replace(done.options, model="closed-form"))
    assert other.tubes == {}
    made_by = done.tables()
    write_tubes(tmp_path, {"A": settled, "../b": settled}, made_by)
    names = {path.name for path in tmp_path.iterdir()}
    assert {"fields-A.csv", "fields-2.csv", "fields-A.npz", "fields-2.npz"} <= names


def test_times_are_as_dense_as_the_readings():
    points = (Point(0.05, 8.0, 0.01, 0, "table", "m", "s"),)
    some = replace(sample(EQUAL), times=(1.0, 2.0), points=points, height=HEIGHT)
    times = np.asarray(tube(some, suspension(EQUAL, BED, {}), BED).times)
    assert times[0] == 0.0 and times[-1] == 8.0
    assert np.count_nonzero(times <= 2.0) == pytest.approx(2 * TIMES / 3, abs=1)
    assert isinstance(mrjax.Column, type)
