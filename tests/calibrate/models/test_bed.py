"""The bed of a forward model: what may vary where it is simulated once, and how dense it is."""

from types import SimpleNamespace

import numpy as np
import pytest

import mrjax
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models import bed

RATIO = Measurement("final_ratio", 0.8, 0.1, "1", 1.0)
VELOCITY = Measurement("initial_velocity", 1.0, 1.0, "m/s", 1.0)


def sample_of(recipe, bed_fraction=None, measurement=RATIO):
    return Sample("A", recipe, 0.1, bed_fraction, (measurement,))


def closure(recipe, local):
    return recipe.replace(drag={"f_w": "richardson-zaki", "local": local})


@pytest.mark.parametrize("local", [False, True])
def test_a_closure_changes_the_path_only_where_drag_is_local(case2, local):
    sample = sample_of(closure(case2, local))
    if not local:
        bed.refuse_other_paths(sample, ("f_w.exponent",))
        return
    with pytest.raises(mrjax.InputError, match=r"f_w\.exponent changes the path of particles"):
        bed.refuse_other_paths(sample, ("f_w.exponent",))


def test_what_scales_time_may_vary_and_nothing_else(case2):
    sample = sample_of(case2)
    bed.refuse_other_paths(sample, bed.TIME_SCALES)
    for name in ("friction", "f_r", "radius", "bed_fraction"):
        with pytest.raises(mrjax.InputError, match=f"{name} changes the path"):
            bed.refuse_other_paths(sample, ("f_s", name))


def test_only_readings_of_the_bed_need_one(case2):
    assert bed.needs_a_bed(sample_of(case2))
    assert bed.needs_a_bed(sample_of(case2, None, RATIO._replace(observable="mudline")))
    assert not bed.needs_a_bed(sample_of(case2, None, VELOCITY))
    assert bed.simulated_fraction(sample_of(case2, None, VELOCITY), None, 0, (), None) is None


def test_a_simulated_bed_is_as_dense_as_its_centre_of_mass_says(case2, monkeypatch):
    """Twice the height of the centre of mass, 0.6 of the box at the end of the run."""
    heights = SimpleNamespace(
        sedimentation_ratio=lambda run, method: {"twice-centre-of-mass": [1.0, 0.6]}[method]
    )
    monkeypatch.setattr(bed, "interface", heights)
    monkeypatch.setattr(bed, "to_rest", lambda *_: None)
    monkeypatch.setattr(mrjax, "disperse", lambda *_: None)
    near = suspension(case2, None, {})
    sample = sample_of(case2, "particles")
    found = bed.simulated_fraction(sample, near, 0, ("f_s",), None)
    assert found == pytest.approx(case2.coated_volume_fraction / 0.6, rel=1e-9)
    assert float(bed.final_ratio(near, found)) == pytest.approx(0.6, rel=1e-9)
    with pytest.raises(mrjax.InputError, match="friction changes the path"):
        bed.simulated_fraction(sample, near, 0, ("friction",), None)


@pytest.mark.parametrize("factor, refused", [(0.999, True), (1.001, False)])
def test_a_bed_is_denser_than_its_suspension(case2, factor, refused):
    fraction = factor * case2.coated_volume_fraction
    near = suspension(case2, fraction, {})
    sample = sample_of(case2, fraction)
    if refused:
        with pytest.raises(mrjax.InputError, match="must be above that of its suspension"):
            bed.simulated_fraction(sample, near, 0, (), None)
    else:
        assert bed.simulated_fraction(sample, near, 0, (), None) is None
        ratio = float(bed.final_ratio(near, None))
        assert ratio == pytest.approx(1.0 / factor, rel=1e-9)


def test_without_a_bed_there_is_no_final_ratio(case2):
    assert np.isnan(float(bed.final_ratio(suspension(case2, None, {}), None)))
