"""Columns with closures of flocs and packings: similarity, straight fronts, refusals, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial

import mrjax
from mrjax.continuum import characteristics, kynch
from mrjax.continuum.column import column
from mrjax.laws import drag
from tests.continuum.test_column import EXACT, HEIGHT, SPEED, near, spheres, zaki

FLOCS = Partial(drag.floc_richardson_zaki, floc_volume=10.0, exponent=4.65)
TIMES = np.array([0.0, 0.3, 0.8, 2.0, 100.0]) * HEIGHT / SPEED
tall = jnp.asarray(HEIGHT)


def table(initial, densest, law):
    return kynch.table(spheres(), law, jnp.asarray(initial), jnp.asarray(densest))


def test_flocs_settle_as_spheres_of_their_volume():
    """A column of flocs at phi is one of spheres at C phi: Kynch's equation for C phi."""
    flocs = characteristics.mudline(table(0.02, 0.06, FLOCS), tall, TIMES)
    spheres_alike = characteristics.mudline(table(0.2, 0.6, zaki()), tall, TIMES)
    assert flocs[2] < 0.8 * HEIGHT and flocs[-1] == near(HEIGHT / 3, rel=EXACT)
    np.testing.assert_allclose(flocs, spheres_alike, rtol=EXACT)


@pytest.mark.parametrize(
    "law, initial, densest",
    [
        (Partial(drag.carman_kozeny), 0.25, 0.6),
        (Partial(drag.rigid_network, floc_volume=2.0, size_ratio=0.8), 0.12, 0.4),
    ],
    ids=["Carman-Kozeny", "network"],
)
def test_a_packing_leaves_clear_fluid_behind_one_front(law, initial, densest):
    """The closure is NaN in dilute suspension; the mudline falls at v(phi_0) until it meets a fan.

    The bed grows by waves denser than phi_0, which meet the mudline later than this.
    """
    velocity = SPEED / float(law(initial))
    times = 0.4 * HEIGHT / velocity * np.array([0.25, 0.5, 1.0])
    exact = HEIGHT - velocity * times
    flux = table(initial, densest, law)
    assert np.isnan(law(0.5 * initial * 0.2)) and np.isfinite(flux.flux).all()
    np.testing.assert_allclose(characteristics.mudline(flux, tall, times), exact, rtol=1e-9)
    if law.keywords:
        return  # the scheme takes some seconds to compile
    settled = column(
        spheres(), height=HEIGHT, volume_fraction=initial, bed_fraction=densest, times=times,
        hindrance=law, cells=100,
    )  # fmt: skip
    np.testing.assert_allclose(settled.mudline, exact, atol=0.1 * HEIGHT / 100)
    solid = np.asarray(settled.volume_fraction).mean(1)
    np.testing.assert_allclose(solid, initial, rtol=EXACT)


def test_a_bed_beyond_the_flocs_is_refused():
    """At bed_fraction = 0.11 and C = 10 the flocs would overlap."""
    given = dict(height=HEIGHT, volume_fraction=0.05, bed_fraction=0.11, times=TIMES)
    with pytest.raises(mrjax.InputError, match=r"give a hindrance that holds up to bed_fraction ="):
        column(spheres(), hindrance=FLOCS, **given)
    traced = jax.jit(lambda law: column(spheres(), hindrance=law, steps=100, **given).mudline)
    assert np.isnan(traced(FLOCS)).all()
    assert np.isnan(table(0.1, 0.6, Partial(drag.carman_kozeny)).flux[kynch.INTERVALS])


@pytest.mark.parametrize(
    "law, initial, densest",
    [
        (FLOCS, 0.03, 0.09),
        (Partial(drag.vesilind, rate=30.0), 0.05, 0.2),
        (Partial(drag.rigid_network, floc_volume=2.0, size_ratio=0.8), 0.2, 0.4),
    ],
    ids=["flocs", "Vesilind", "network"],
)
def test_a_mudline_has_gradients_by_every_coefficient(law, initial, densest):
    fall = HEIGHT * float(law(initial)) / SPEED
    times = jnp.array([0.2, 0.5, 0.9]) * fall

    @jax.jit
    def heights(coefficients):
        changed = Partial(law.func, **dict(zip(law.keywords, coefficients, strict=True)))
        return characteristics.mudline(table(initial, densest, changed), tall, times) / HEIGHT

    start = jnp.array(list(law.keywords.values()))
    exact = jax.jacobian(heights)(start)
    assert (np.abs(exact[0]) > 1e-4).all()
    for place, value in enumerate(start):
        step = jnp.zeros_like(start).at[place].set(1e-5 * value)
        central = (heights(start + step) - heights(start - step)) / (2e-5 * value)
        # Third derivatives of logarithms of some hundreds, times 1e-10.
        np.testing.assert_allclose(exact[:, place], central, rtol=1e-6, atol=1e-9)


def test_the_flux_is_constant_where_a_closure_does_not_hold():
    flux = table(0.3, 0.6, Partial(drag.carman_kozeny))
    packed = flux.fraction >= 0.2
    first = int(np.argmax(packed))
    assert 1 < first < kynch.INTERVALS
    np.testing.assert_allclose(flux.flux[1:first], flux.flux[first], rtol=EXACT)
    exact = SPEED * (1 - flux.fraction[first:-1]) ** 3 / 10
    np.testing.assert_allclose(flux.flux[first:-1], exact, rtol=EXACT)
    assert near(0.0) == flux.flux[0]


def infinitely_steep(volume_fraction, coefficient):
    """A closure whose slope is infinite in clear fluid."""
    return 1.0 + coefficient * jnp.sqrt(volume_fraction)


def test_a_closure_that_is_infinitely_steep_in_clear_fluid_has_finite_gradients():
    """By its coefficient and phi_0 together: clear fluid has no flux, whatever the closure."""
    case = dict(height=HEIGHT, bed_fraction=0.6, times=TIMES[:3], cells=20, steps=60)
    along = (1.0, 0.01)

    def mean_mudline(coefficient, initial):
        law = Partial(infinitely_steep, coefficient=coefficient)
        settled = column(spheres(), hindrance=law, volume_fraction=initial, **case)
        return jnp.mean(settled.mudline) / HEIGHT

    @jax.jit
    def with_slope(distance):
        at = tuple(start + distance * part for start, part in zip((3.0, 0.2), along, strict=True))
        return jax.jvp(mean_mudline, at, along)

    slope = float(with_slope(0.0)[1])
    high, low = (float(with_slope(distance)[0]) for distance in (1e-6, -1e-6))
    assert slope > 0.01  # a slower fall
    assert slope == near((high - low) / 2e-6, rel=1e-6)  # rounding: 1e-15 / 1e-6
