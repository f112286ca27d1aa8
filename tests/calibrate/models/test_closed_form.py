"""The closed form and the column as forward models: what is read off a suspension."""

from dataclasses import replace

import numpy as np
import pytest
from jax.tree_util import Partial

import mrjax
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models import column
from calibrate.models.closed_form import closed_form
from calibrate.models.prediction import as_measured
from mrjax.laws import drag

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


def test_a_column_whose_particles_would_rise_somewhere_is_refused_or_not_a_number(case2):
    """Haberman and Sayre's drag is negative at a volume fraction of 0.7."""
    sample = Sample("A", case2, 0.1, None, (MUDLINE,), (1e5,))
    near = replace(suspension(case2, 0.5, {}), hindrance=Partial(drag.haberman_sayre))
    model = column.column(sample, near)
    assert np.isfinite(model(near)["mudline"]).all()
    denser = replace(near, bed_fraction=0.72)
    assert np.isnan(model(denser)["mudline"]).all()
    with pytest.raises(mrjax.InputError, match="the particles would settle at -"):
        column.column(sample, denser)
