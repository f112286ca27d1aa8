"""Columns in a carrier with a yield stress: at rest to machine zero, slower, and ageing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.continuum import characteristics, kynch
from mrjax.continuum.column import column
from mrjax.continuum.sizes import masliyah
from mrjax.laws import yield_stress
from tests.continuum.test_column import EXACT, HEIGHT, SPEED, near, spheres, zaki

CRITICAL = float(yield_stress.critical_yield_stress(spheres()))
TIMES = np.array([0.2, 0.6, 1.5]) * HEIGHT / SPEED
TUBE = dict(height=HEIGHT, volume_fraction=0.2, bed_fraction=0.6, hindrance=zaki())
tall = jnp.asarray(HEIGHT)


def mudline(parameters, times):
    flux = kynch.table(parameters, zaki(), jnp.asarray(0.2), jnp.asarray(0.6))
    effective = yield_stress.effective_times(parameters, jnp.asarray(times))
    return characteristics.mudline(flux, tall, effective)


def test_a_column_above_the_threshold_stands_still_to_machine_zero():
    """Profiles, mudline and floor, and the mudline by characteristics, with their derivatives."""

    def heights(stress):
        parameters = spheres(yield_stress=stress)
        settled = column(parameters, times=TIMES * 1e4, cells=40, steps=40, **TUBE)
        return settled, mudline(parameters, TIMES * 1e4)

    (settled, exact), slopes = jax.jvp(heights, (1.01 * CRITICAL,), (1.0,))
    assert (settled.mudline == settled.mudline[0]).all() and (settled.bed_front == 0.0).all()
    assert settled.mudline[0] == near(HEIGHT, rel=1e-15)  # the sum of 40 cells
    assert (settled.volume_fraction == 0.2).all()
    assert np.ptp(exact) == 0.0 and exact[0] == near(HEIGHT, rel=EXACT)
    for slope in (slopes[0].mudline, slopes[0].volume_fraction, slopes[1]):
        assert (slope == 0.0).all()


def test_below_the_threshold_it_is_the_newtonian_column_at_other_times():
    """One factor on every velocity: z of a single particle."""
    held = spheres(yield_stress=0.4 * CRITICAL)
    factor = float(yield_stress.velocity_factor(held))
    assert 0.05 < factor < 0.3
    np.testing.assert_allclose(mudline(held, TIMES / factor), mudline(spheres(), TIMES), rtol=EXACT)


def test_an_ageing_column_stops_as_the_mudline_of_characteristics_does():
    """The mudline falls in a straight line of v_0 and the effective time, then stands still."""
    growth = 0.6 * CRITICAL / (0.5 * HEIGHT / SPEED)
    ageing = spheres(yield_stress=0.1 * CRITICAL, yield_growth=growth)
    stop = 0.9 * CRITICAL / growth
    times = stop * np.array([0.3, 1.0, 1.7])
    settled = column(ageing, times=times, cells=60, **TUBE)
    effective = yield_stress.effective_times(ageing, times)
    velocity = float(mrjax.terminal_velocity(ageing)) * 0.8**4.65
    exact = HEIGHT - velocity * np.asarray(effective)
    assert HEIGHT / 3 < exact[-1] < 0.97 * HEIGHT
    np.testing.assert_allclose(settled.mudline, exact, atol=0.2 * HEIGHT / 60)
    np.testing.assert_allclose(mudline(ageing, times), exact, rtol=1e-9)
    assert settled.mudline[1] == settled.mudline[2]
    assert (settled.times == times).all()


def test_a_yielding_bed_does_not_age():
    ageing = spheres(yield_stress=0.0, yield_growth=1e-9)
    yielding = mrjax.Compression(gel_fraction=0.3, stress=100.0, exponent=4.0)
    with pytest.raises(mrjax.InputError, match=r"leave out yield_growth or compression"):
        column(ageing, times=TIMES, compression=yielding, **TUBE)


def test_a_mudline_has_gradients_by_the_yield_stress():
    times = jnp.asarray(TIMES) * 4

    @jax.jit
    def heights(changes):
        return mudline(spheres(**changes), times) / HEIGHT

    start = {"yield_stress": jnp.asarray(0.3 * CRITICAL), "yield_growth": jnp.asarray(1e-8)}
    exact = jax.jacobian(heights)(start)
    for name, value in start.items():
        above, below = (heights(start | {name: value * (1 + h)}) for h in (1e-5, -1e-5))
        np.testing.assert_allclose(exact[name], (above - below) / (2e-5 * value), rtol=1e-5)
        assert np.abs(exact[name] * value).max() > 1e-3


def test_one_class_of_several_sizes_has_the_flux_of_one_size():
    """And classes that the yield stress holds have none, relative to the fluid."""
    held = spheres(yield_stress=0.4 * CRITICAL)
    phi = jnp.array([0.05, 0.3])
    one = masliyah.fluxes(masliyah.classes(held, zaki()), phi[None], jnp.asarray(0.6))[0]
    f_w = zaki()(phi)
    exact = phi * mrjax.terminal_velocity(held.replace(f_w=f_w))
    np.testing.assert_allclose(one, exact, rtol=EXACT)
    two_sizes = held.replace(radius=jnp.array([0.3, 1.0]) * held.radius)
    law = masliyah.classes(two_sizes, zaki())
    assert law.mobility[0] == 0.0 < law.mobility[1]
    ageing = two_sizes.replace(yield_growth=jnp.asarray(1e-9))
    with pytest.raises(mrjax.InputError, match=r"leave out yield_growth, or give one size"):
        mrjax.polydisperse_column(
            ageing, height=HEIGHT, volume_fraction=[0.1, 0.1], bed_fraction=0.6, times=TIMES
        )
