"""The closed form and the column as forward models: what is read off a suspension."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models import column
from calibrate.models.closed_form import closed_form
from calibrate.models.prediction import as_measured

MUDLINE = Measurement("mudline", 90.0, 1.0, "mm", 1e-3, 0)


def test_a_mudline_falls_by_its_velocity_until_it_meets_the_bed(case3):
    """In a tube of 0.1 m, whatever the box of the recipe."""
    near = suspension(case3, 0.6, {})
    velocity = float(mrjax.terminal_velocity(near.parameters))
    times = (0.0, 0.01 / velocity, 1e3 / velocity)
    ratio = Measurement("viscosity_ratio", 1.7, 0.1, "1", 1.0)
    speed = Measurement("initial_velocity", 1.0, 1.0, "mm/day", 1e-3 / 86400)
    measured = (MUDLINE, MUDLINE._replace(place=1), MUDLINE._replace(place=2), ratio, speed)
    sample = Sample("A", case3, 0.1, 0.6, measured, times)
    prediction = closed_form(sample, near)(near)
    bed = float(near.volume_fraction) / 0.6
    np.testing.assert_allclose(prediction["sedimentation_ratio"], [1.0, 0.9, bed], rtol=1e-12)
    assert float(prediction["final_ratio"]) == pytest.approx(bed)
    said = as_measured(sample, prediction)
    expected = [100.0, 90.0, 100.0 * bed, float(near.parameters.f_v), 86400e3 * velocity]
    np.testing.assert_allclose(said, expected, rtol=1e-12)
    assert float(near.parameters.f_v) != float(near.parameters.f_s)


def test_a_traced_column_has_four_times_the_steps_of_where_it_is_prepared(case2, monkeypatch):
    steps_of = []

    def counted(parameters, **_):
        return 100

    def solved(parameters, *, steps, times, **_):
        steps_of.append(steps)
        return SimpleNamespace(mudline=0.1 * jnp.ones_like(times))

    monkeypatch.setattr(mrjax, "column_steps", counted)
    monkeypatch.setattr(mrjax, "column", solved)
    near = suspension(case2, 0.6, {})
    sample = Sample("A", case2, 0.1, 0.6, (MUDLINE,), (1e4,))
    model = column.column(sample, near)
    asked = jax.jit(lambda f_s: model(suspension(case2, 0.6, {"f_s": f_s})))
    prediction = asked(near.parameters.f_s / 3.0)
    assert steps_of == [400]
    assert float(prediction["mudline"][0]) == pytest.approx(0.1)


def test_a_column_asked_plainly_takes_the_steps_that_it_needs(case2, monkeypatch):
    monkeypatch.setattr(mrjax, "column_steps", lambda parameters, **_: 1000.0 / parameters.f_s)
    monkeypatch.setattr(
        mrjax, "column", lambda *_, steps, times, **__: SimpleNamespace(mudline=steps * times)
    )
    sample = Sample("A", case2, 0.1, 0.6, (MUDLINE,), (1.0,))
    near = suspension(case2, 0.6, {"f_s": 1.0})
    model = column.column(sample, near)
    for f_s, steps in ((1.0, 4000.0), (0.5, 4000.0), (0.2, 5000.0)):
        found = model(suspension(case2, 0.6, {"f_s": f_s}))
        assert float(found["mudline"][0]) == pytest.approx(steps)
