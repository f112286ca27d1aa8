"""The column without a grid: conservation, Kynch's fan, and the scheme that converges to it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax.continuum.case import Case
from mrjax.continuum.column import column
from mrjax.continuum.exact import exact_column
from mrjax.continuum.tilt import Tilt
from tests.continuum.test_column import HEIGHT, near, solid, spheres, zaki
from tests.continuum.test_fields import DENSEST, FALL, INITIAL

TIMES = np.array([0.0, 0.3, 0.8, 1.4, 3.0, 100.0]) * FALL
GIVEN = dict(height=HEIGHT, volume_fraction=INITIAL, bed_fraction=DENSEST, times=TIMES)


def exact(parameters, tilt=None, cells=50, **given):
    given = GIVEN | given
    case = Case(parameters, hindrance=zaki(), compression=None, tilt=tilt, **given)
    return exact_column(case.as_arrays().astype(float), cells=cells)


@pytest.mark.parametrize("tilt", [None, Tilt(angle=5.0, gap=0.02)], ids=["upright", "tilted"])
def test_the_scheme_converges_to_it(tilt):
    """Fronts within a cell of the scheme, all means but those at fronts to a hundredth."""
    settled = exact(spheres(), tilt)
    scheme = column(spheres(), hindrance=zaki(), tilt=tilt, cells=200, **GIVEN)
    assert np.abs(settled.mudline - scheme.mudline).max() < HEIGHT / 200
    assert np.abs(settled.bed_front - scheme.bed_front).max() < 3 * HEIGHT / 200
    assert solid(settled) == near(np.full(6, INITIAL * HEIGHT), rel=1e-12)
    for field, scale in (
        ("volume_fraction", 1.0),
        ("settling_velocity", float(settled.settling_velocity.max())),
        ("solid_stress", float(settled.solid_stress.max())),
    ):
        means = np.asarray(getattr(scheme, field)).reshape(6, 50, 4).mean(axis=2)
        difference = np.abs(np.asarray(getattr(settled, field)) - means) / scale
        assert np.quantile(difference, 0.9) < 0.01, field
    assert settled.steps == 0 and float(settled.courant) == 0.0


def test_what_creams_is_the_mirror_image_and_what_cannot_be_is_not_a_number():
    light = spheres().replace(particle_density=1000.0, fluid_density=7000.0)
    sinking, rising = exact(spheres()), exact(light)
    assert rising.mudline == near(HEIGHT - np.asarray(sinking.mudline), rel=1e-9, abs=1e-15)
    turned = np.asarray(sinking.volume_fraction)[:, ::-1]
    np.testing.assert_allclose(rising.volume_fraction, turned, atol=1e-12)
    assert np.isnan(exact(spheres(), bed_fraction=0.2).mudline).all()


def test_its_gradients_are_those_of_differences():
    @jax.jit
    def fields(factor):
        tube = exact(spheres().replace(f_s=factor), times=TIMES[1:4])
        return jnp.stack([tube.volume_fraction, tube.solid_stress / tube.solid_stress.max()])

    step = 1e-6
    slopes = np.asarray(jax.jacfwd(fields)(jnp.asarray(1.0)))
    central = np.asarray(fields(1.0 + step) - fields(1.0 - step)) / (2.0 * step)
    assert np.abs(slopes - central).max() < 1e-6 * np.abs(slopes).max() and slopes.any()
