"""A tilted tube in fits: its predictions, a fit of the tilt, and what an experiment states."""

from collections import OrderedDict

import jax
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.physical_bounds import bounds
from calibrate.experiment.sample import Point, Sample
from calibrate.experiment.suspension import suspension
from calibrate.inference.forecast import sample_like
from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from calibrate.models.particles import particles

HEIGHT, DIAMETER, BED, TILT = 0.3, 0.03, 0.3, 3.0
GAP = np.pi / 4 * DIAMETER


def slurry(local=True, **particle):
    return mrjax.Recipe(
        name="slurry",
        particle={"density": 2700.0, "diameter": 3e-6} | particle,
        fluid={"density": 998.0, "viscosity": 1e-3},
        composition={"volume_fraction": 0.1},
        drag={"f_w": "richardson-zaki", "local": local},
    )


def sampled(recipe, shares, bed=BED, **fields):
    near = suspension(recipe, bed, {})
    fall = HEIGHT / float(np.mean(mrjax.terminal_velocity(near.parameters)))
    return Sample("A", recipe, HEIGHT, bed, (), tuple(fall * np.asarray(shares)), gap=GAP, **fields)


def test_closed_form_and_column_agree_without_local_drag():
    """In mudline, concentrations, the initial velocity, and at rest."""
    recipe = slurry(local=False)
    time = 0.3 * sampled(recipe, [1.0]).times[0]
    points = tuple(Point(z, time, 0.1, place, "t", "m", "s") for place, z in enumerate((0.05, 0.2)))
    sample = sampled(recipe, np.linspace(0.05, 0.8, 12), points=points)
    near = suspension(recipe, BED, {"tilt": TILT})
    closed, exact = (make(sample, near)(near) for make in (closed_form, column))
    upright = closed_form(sample, near)(suspension(recipe, BED, {}))
    for name in ("mudline", "concentrations", "initial_velocity"):
        np.testing.assert_allclose(closed[name], exact[name], rtol=1e-6, atol=1e-9)
        assert np.max(np.abs(closed[name] / upright[name] - 1.0)) > 0.1
    rate = np.cos(np.deg2rad(TILT)) + HEIGHT / GAP * np.sin(np.deg2rad(TILT))
    ratio = float(closed["initial_velocity"] / upright["initial_velocity"])
    assert ratio == pytest.approx(rate, rel=1e-12)
    assert float(closed["mudline"][-1]) == pytest.approx(HEIGHT * 0.1 / BED, rel=1e-12)


def test_the_closed_form_needs_no_bed_for_an_initial_velocity():
    recipe = slurry(local=False)
    near = suspension(recipe, None, {"tilt": TILT})
    prediction = closed_form(sampled(recipe, [], bed=None), near)(near)
    upright = float(mrjax.terminal_velocity(near.parameters))
    rate = np.cos(np.deg2rad(TILT)) + HEIGHT / GAP * np.sin(np.deg2rad(TILT))
    assert float(prediction["initial_velocity"]) == pytest.approx(rate * upright, rel=1e-12)


def test_a_fit_finds_the_tilt_of_a_synthetic_mudline():
    recipe = slurry()
    sample = sampled(recipe, np.linspace(0.05, 1.0, 12))
    predict = column(sample, suspension(recipe, BED, {"tilt": 1.0}))

    def mudline(theta):
        return predict(suspension(recipe, BED, theta))["mudline"]

    truth = {"tilt": TILT, "f_s": 1.2}
    readings = mudline(truth)
    fitted = calibrate.fit(
        lambda theta: (mudline(theta) - readings) / (1e-3 * HEIGHT),
        OrderedDict(tilt=1.0, f_s=1.0),
    )
    assert fitted.converged and dict(fitted.theta) == pytest.approx(truth, rel=1e-5)


@pytest.mark.parametrize("kind", ["yielding bed", "two sizes"])
def test_a_delay_and_a_tilt_act_one_after_the_other(kind):
    """The tilted tube with a delay is the tilted one at the delayed times; slopes are exact."""
    sizes = {"diameter": {"values": [2.5e-6, 4e-6], "fractions": [0.5, 0.5]}}
    recipe = slurry(**(sizes if kind == "two sizes" else {}))
    bed = {} if kind == "two sizes" else {
        "compression.gel_fraction": 0.15, "compression.stress": 30.0, "compression.exponent": 3.0,
    }  # fmt: skip
    sample = sampled(recipe, [0.2, 0.5])
    times, delay = np.array(sample.times), 0.2 * sample.times[0]

    def at(tilt, **changes):
        return suspension(recipe, BED, {**bed, **changes, "tilt": tilt})

    predict = column(sample, at(TILT))
    slow, later = at(TILT, delay=delay), mrjax.delayed_times(times, delay)
    slope = jax.jit(lambda tilt: jax.jvp(
        lambda tilt: predict(at(tilt, delay=delay))["mudline"], (tilt,), (1.0,)
    ))  # fmt: skip
    mudline, exact = slope(TILT)
    step = 1e-4
    central = (slope(TILT + step)[0] - slope(TILT - step)[0]) / (2 * step)
    np.testing.assert_allclose(exact, central, rtol=1e-3)
    assert (np.abs(exact) > 1e-3 * HEIGHT).all()
    np.testing.assert_allclose(predict(slow)["mudline"], mudline, rtol=1e-12)
    np.testing.assert_allclose(predict(at(TILT), later)["mudline"], mudline, rtol=1e-3)


SHEET = """
name = "slurry"
particle = {density = 2700.0, diameter = 3e-6}
fluid = {density = 998.0, viscosity = 1e-3}
composition = {volume_fraction = 0.1}
"""
EXPERIMENT = """
name = "tube"
[[sample]]
name = "A"
recipe = "recipe.toml"
%s
initial_velocity = {value = 3.0, unit = "mm/h", standard_deviation = 0.1}
[[parameter]]
name = "%s"
median = 2.0
log_standard_deviation = 1.0
"""


def experiment(folder, keys, name="f_s"):
    (folder / "recipe.toml").write_text(SHEET, "utf-8")
    (folder / "tube.toml").write_text(EXPERIMENT % (keys, name), "utf-8")
    return Experiment.load(folder / "tube.toml")


def test_an_experiment_states_or_fits_a_tilt(tmp_path):
    stated = experiment(tmp_path, "height = 0.3\ntube = {tilt = 2.5, gap = 0.02}")
    sample = stated.samples[0]
    assert sample.tube == {"tilt": 2.5} and sample.gap == 0.02
    of_sample = stated.suspension_of(sample, stated.start)
    assert float(of_sample.tilt) == 2.5
    with pytest.raises(mrjax.InputError, match="the model particles has no tilt"):
        particles(sample, of_sample)
    fitted = experiment(tmp_path, "height = 0.3\ntube_diameter = 0.03", "tilt")
    assert fitted.samples[0].gap == pytest.approx(GAP)
    assert bounds(fitted, fitted.parameters[0]) == (1e-3, 60.0) and not fitted.warnings
    # A recipe that is predicted has no tube.
    joined, new = sample_like(fitted, slurry(local=False), "A")
    near = joined.suspension_of(new, joined.start)
    velocity = closed_form(new, near)(near)["initial_velocity"]
    assert velocity == pytest.approx(float(mrjax.terminal_velocity(near.parameters)), rel=1e-9)


def test_a_tall_narrow_tube_is_warned_of(tmp_path):
    warnings = experiment(tmp_path, "height = 0.3\ntube_diameter = 0.03").warnings
    assert len(warnings) == 1 and "sample 'A': the suspension is 13 times as tall" in warnings[0]
    assert not experiment(tmp_path, "height = 0.1\ntube_diameter = 0.03").warnings


@pytest.mark.parametrize(
    "keys, name, message",
    [
        ("height = 0.3", "tilt", "a tilt needs the gap of the tube; state gap"),
        ("tube = {tilt = 2.0, gap = 0.02}", "f_s", "height is missing"),
        ("height = 0.3\ntube = {tilt = 2.0, gap = 0.02}", "tilt", "has tilt = 2 of its own"),
        ("height = 0.3\ntube = {tilt = 61.0, gap = 0.02}", "f_s", "tilt.*from 0 to 60"),
        ("height = 0.3\ntube = {tilt = 2.0, gap = 0.0}", "f_s", "gap.*above zero"),
    ],
)
def test_refused_in_one_line(tmp_path, keys, name, message):
    with pytest.raises(mrjax.InputError, match=message) as refusal:
        experiment(tmp_path, keys, name)
    assert "\n" not in str(refusal.value)
