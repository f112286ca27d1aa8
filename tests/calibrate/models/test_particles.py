"""The particles as a forward model: contacts where they may meet, times scaled by tube and box."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models import falling, particles
from mrjax.laws import time_scales

WIDE = mrjax.Box((1e-3, 1e-3, 1e-3))
MIDDLE = 0.5e-3


@pytest.fixture
def recipe(case2) -> mrjax.Recipe:
    return case2.model_copy(update={"box": WIDE})


def asked_of(recipe, positions, monkeypatch, measurement, **sample):
    """The forward model of a sample with these particles, and what it asks `simulate` for."""
    state = mrjax.place(np.array(positions))
    calls = []

    def simulate(state, parameters, box, **options):
        calls.append((parameters, options))
        return SimpleNamespace()

    monkeypatch.setattr(mrjax, "disperse", lambda *_: state)
    monkeypatch.setattr(mrjax, "simulate", simulate)
    monkeypatch.setattr(mrjax, "settling_velocity", lambda _: jnp.asarray(1e-9))
    near = suspension(recipe, None, {"friction": 0.3, "restitution": 0.5})
    made = Sample("A", recipe, measurements=(measurement,), **sample)
    return particles.particles(made, near), near, calls


VELOCITY = Measurement("initial_velocity", 1.0, 1.0, "m/s", 1.0)


@pytest.mark.parametrize("share, with_contacts", [(0.0, True), (0.99, True), (1.01, False)])
def test_contacts_count_where_particles_may_meet(recipe, monkeypatch, share, with_contacts):
    """Each may fall ten times as far as expected in the 40 relaxations of a run, and no farther."""
    parameters = recipe.parameters()
    fall = float(mrjax.terminal_velocity(parameters) * time_scales.relaxation_time(parameters))
    separation = recipe.particle.diameter + share * 2.0 * 10.0 * 40.0 * fall
    positions = [[MIDDLE, MIDDLE, MIDDLE], [MIDDLE + separation, MIDDLE, MIDDLE]]
    model, near, calls = asked_of(
        recipe, positions, monkeypatch, VELOCITY, height=0.1, bed_fraction=None
    )
    model(near)
    ((parameters, _),) = calls
    contacts = {name: float(getattr(parameters, name)) for name in falling.WITHOUT_CONTACTS}
    if with_contacts:
        assert (contacts["friction"], contacts["restitution"]) == (0.3, 0.5)
    else:
        assert contacts == falling.WITHOUT_CONTACTS


def test_a_run_takes_one_step_for_each_relaxation(recipe, monkeypatch):
    model, near, calls = asked_of(
        recipe, [[MIDDLE] * 3], monkeypatch, VELOCITY, height=0.1, bed_fraction=None
    )
    model(near)
    ((_, options),) = calls
    assert options["duration"] == pytest.approx(40 * options["time_step"], rel=1e-12)
    relaxation = float(time_scales.relaxation_time(near.parameters))
    assert options["time_step"] == pytest.approx(relaxation, rel=1e-12)


@pytest.mark.parametrize("slower, refused", [(3.9, False), (4.1, True)])
def test_a_run_too_short_for_slower_particles_is_refused(recipe, monkeypatch, slower, refused):
    """A particle relaxes more slowly with less drag; 10 relaxations are the fewest of 40."""
    model, near, _ = asked_of(
        recipe, [[MIDDLE] * 3], monkeypatch, VELOCITY, height=0.1, bed_fraction=None
    )
    lighter = suspension(recipe, None, {"f_s": float(near.parameters.f_s) / slower})
    if refused:
        with pytest.raises(mrjax.InputError, match=r"relax 4.1 times more slowly"):
            model(lighter)
    else:
        model(lighter)


def test_times_scale_with_the_height_of_the_tube_and_the_falling_velocity(recipe, monkeypatch):
    """A tube a hundred times as high as the box takes a hundred times as long, twice the drag two.

    The run in the box falls evenly from 1 to 0.5 in 100 s.
    """
    whole = SimpleNamespace(times=jnp.array([0.0, 100.0]))
    monkeypatch.setattr(particles, "to_rest", lambda *_: whole)
    heights = SimpleNamespace(sedimentation_ratio=lambda _: jnp.array([1.0, 0.5]))
    monkeypatch.setattr(particles, "interface", heights)
    curve = Measurement("mudline", 1.0, 1.0, "m", 1.0, 0)
    times = (1000.0, 2000.0, 4000.0, 1e6)
    model, near, _ = asked_of(
        recipe, [[MIDDLE] * 3], monkeypatch, curve, height=0.1, bed_fraction=None, times=times
    )
    found = model(near)
    np.testing.assert_allclose(found["sedimentation_ratio"], [0.95, 0.9, 0.8, 0.5], rtol=1e-9)
    np.testing.assert_allclose(found["mudline"], 0.1 * found["sedimentation_ratio"], rtol=1e-12)
    assert float(found["final_ratio"]) == 0.5
    slower = model(suspension(recipe, None, {"f_s": 2.0 * float(near.parameters.f_s)}))
    ratio = slower["sedimentation_ratio"]
    np.testing.assert_allclose(ratio, [0.975, 0.95, 0.9, 0.5], rtol=1e-9)
