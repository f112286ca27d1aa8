"""What is said where data and model disagree: each cause by the shape or size that it gives."""

from types import SimpleNamespace

import numpy as np
import pytest

import calibrate
from calibrate import report
from calibrate.experiment.sample import Measurement
from calibrate.inference import advice
from calibrate.inference.misfit import Agreement
from tests.calibrate.inference.test_misfit import fitted

TIMES = np.arange(11.0)
STRAIGHT = np.maximum(100.0 - 12.0 * TIMES, 40.0)


def said(measured, predicted=STRAIGHT, error=1.0, times=TIMES):
    curve = advice._Curve(times, measured, predicted, np.full(times.size, error), 100.0)
    return " ".join(advice._shape_causes(curve))


def test_readings_that_fall_on_are_a_bed_that_yields():
    falling_on = STRAIGHT - np.maximum(TIMES - 5.0, 0.0) * 2.0
    assert "a bed that yields" in said(falling_on)
    assert said(falling_on, error=5.0) == ""


def test_first_readings_that_wait_are_a_delay():
    waited = np.maximum(100.0 - 18.0 * np.maximum(TIMES - 1.5, 0.0), 40.0)
    assert "a delay" in said(waited)
    assert "a delay" in said(waited[1:], STRAIGHT[1:], times=TIMES[1:])
    assert "a delay" not in said(np.maximum(100.0 - 9.0 * TIMES, 40.0))


def test_residuals_that_go_on_are_another_closure():
    """The model's chord through a curve that bends."""
    bent = 40.0 + 60.0 * (1.0 - TIMES / 10.0) ** 2
    chord = 95.0 - 6.0 * TIMES
    assert "another closure or exponent" in said(bent, chord)


def test_noise_is_no_shape():
    noise = np.array([0.3, -0.8, 1.1, -0.2, 0.9, -1.3, 0.4, 0.6, -0.7, 0.2, -0.5])
    assert said(STRAIGHT + noise) == ""


def test_repeats_count_as_their_mean():
    """Two tubes of six times each, 2 mm apart, in mm."""
    readings = [
        Measurement("mudline", 100.0 - place + apart, 0.5, "mm", 1e-3, place)
        for apart in (-1.0, 1.0)
        for place in range(6)
    ]
    sample = SimpleNamespace(times=tuple(range(6)), height=0.1, measurements=readings)
    curve = advice._curve(sample, np.arange(12.0))
    np.testing.assert_allclose(curve.measured, 100.0 - np.arange(6.0))
    np.testing.assert_allclose(curve.predicted, 3.0 + np.arange(6.0))
    np.testing.assert_allclose(curve.errors, 0.5 / np.sqrt(2.0))
    assert curve.top == pytest.approx(100.0)
    few = SimpleNamespace(times=tuple(range(5)), height=0.1, measurements=readings[:5])
    assert advice._curve(few, np.arange(5.0)) is None


@pytest.mark.parametrize(
    "ratio, spread, expected",
    [
        (60.0, 0.5, "times in min, not s, would make that 1"),
        (3000.0, 1.0, "times in h, not s, would make that 0.83"),
        (1e-4, 1.0, "wrong by a factor of 10000, 1"),
        (12.0, 1.0, "wrong by a factor of 10, 1.2"),
        (12.0, 2.0, None),
        (3.0, 0.1, None),
    ],
)
def test_a_factor_that_explains_a_speed_is_named(ratio, spread, expected):
    units = {"s": 1.0, "min": 60.0, "h": 3600.0}
    [*lines] = advice._unit_sentences("A", ratio, spread, "times", "s", units)
    assert len(lines) == (expected is not None)
    assert expected is None or expected in lines[0]


CURVE = """
name = "read"
[[sample]]
name = "A"
recipe = "case2"
height = 0.1
curve = {file = "a.csv", time_unit = "UNIT", unit = "mm", standard_deviation = 0.5}
[[parameter]]
name = "f_w"
median = 50.0
log_standard_deviation = 0.3
[[parameter]]
name = "bed_fraction"
median = 0.6
log_standard_deviation = 0.1
"""


def test_a_misfit_names_readings_and_causes(tmp_path):
    """Days that are stated as hours; one reading is 8 mm off."""
    rows = ["time,mudline", *(f"{day},{100.0 - 8.1 * day + 8.0 * (day == 3)}" for day in range(5))]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    (tmp_path / "e.toml").write_text(CURVE.replace("UNIT", "h"))
    done = calibrate.run(tmp_path / "e.toml", model="closed-form")
    table = done.tables()
    lines = report.in_words(table)
    assert table["misfit"] and "p < 1e-12" in lines[0]
    assert lines[1].startswith("Farthest off: sample A, mudline at ") and "h, line " in lines[1]
    assert len(table["stands_out"]) == 3
    assert any("times in day, not h, would make that" in line for line in lines)
    done.write(tmp_path / "out")
    page = (tmp_path / "out" / "report.md").read_text("utf-8")
    first = page.splitlines()[2]
    assert first.startswith("**The data do not agree with the model, or with each other")
    assert page.count("Farthest off") == 1


def test_the_farthest_readings_are_named_first():
    assert advice.stand_out(np.array([0.1, -9.0, 4.0, 2.9, 5.0, 3.5])) == [1, 4, 2]
    assert advice.stand_out(np.array([0.1, -2.9])) == []


def test_what_chance_does_not_bring_is_a_misfit():
    """Many readings whose residuals are 1.5 standard deviations."""
    assert Agreement(200, 2.25, 1e-20, 0.01, 1.5).misfit
    assert not Agreement(20, 2.25, 1e-3, 0.01, 1.5).misfit


def test_as_many_values_as_numbers_prove_nothing(tmp_path):
    done = calibrate.run("fang2005", model="closed-form")
    first = "5 values fitted to 4 numbers: their agreement proves nothing."
    assert report.in_words(done.tables())[0] == first
    done.write(tmp_path)
    assert (tmp_path / "report.md").read_text("utf-8").splitlines()[2] == f"**{first}**"


def test_a_velocity_in_another_unit_is_named(tmp_path):
    """Two of one recipe, of which one is in mm/h."""
    problem, fit, _, predicted = fitted(tmp_path, [(8.0, 0.1), (8.0 / 24.0, 0.1)])
    spread = [one.log_standard_deviation for one in problem.experiment.parameters]
    assert spread == [None]  # with a prior of nothing no unit is doubted
    assert advice.advice(problem, fit, predicted) == []
