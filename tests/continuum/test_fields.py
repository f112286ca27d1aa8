"""Fields of a column: velocities and solid stress against closed forms and conservation."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.continuum.column import column
from mrjax.laws import yield_stress
from tests.continuum.test_column import EXACT, HEIGHT, SPEED, near, speed, spheres, zaki
from tests.continuum.test_consolidation import LATE, SETTLING, SOFT, WEIGHT

DENSEST, INITIAL = 0.6, 0.25
FALL = HEIGHT / SPEED
RIGID = dict(height=HEIGHT, volume_fraction=INITIAL, bed_fraction=DENSEST, hindrance=zaki())
TIMES = np.array([0.0, 0.5, 1.0, 100.0]) * FALL


def test_of_a_rigid_bed():
    """v(phi_0) between both fronts; in the bed no velocity, and the weight of what is above."""
    settled = column(spheres(), times=TIMES, **RIGID)
    velocity, stress = np.asarray(settled.settling_velocity), np.asarray(settled.solid_stress)
    levels, fraction = np.asarray(settled.levels), np.asarray(settled.volume_fraction)
    falling = speed(INITIAL, zaki())
    assert velocity[0] == near(np.full(200, falling), rel=1e-9) and not stress[0].any()
    bed, mudline = np.asarray(settled.bed_front)[1], np.asarray(settled.mudline)[1]
    cell = HEIGHT / 200
    inside = (levels > bed + 40 * cell) & (levels < mudline - 20 * cell)
    assert inside.sum() > 20 and velocity[1, inside] == near(falling, rel=1e-9)
    assert not velocity[1, (levels < bed) | (levels > mudline)].any()
    assert stress[1] == near(WEIGHT * DENSEST * np.maximum(bed - levels, 0.0), rel=EXACT)
    below = np.cumsum(fraction[-1]) * cell - 0.5 * cell * fraction[-1]
    at_rest = levels < HEIGHT * INITIAL / DENSEST - cell
    weight = WEIGHT * (INITIAL * HEIGHT - below)
    assert stress[-1, at_rest] == near(weight[at_rest], rel=1e-7) and not velocity[-1].any()


def test_a_creaming_column_is_the_mirror_image():
    light = spheres().replace(particle_density=1000.0, fluid_density=7000.0)
    stiff = mrjax.Compression(gel_fraction=0.3, stress=40.0, exponent=7.0)
    # Numbers of times are those of other tests, with which the compiled programs are shared.
    for options in ({"times": TIMES}, {"times": FALL * np.arange(6.0), "compression": stiff}):
        sinking, rising = (column(one, **RIGID | options) for one in (spheres(), light))
        one, other = (np.asarray(tube.settling_velocity) for tube in (sinking, rising))
        assert one[0].any() and other == near(-one[:, ::-1], rel=1e-9)
        one, other = (np.asarray(tube.solid_stress) for tube in (sinking, rising))
        assert one[1].any() and other == near(one[:, ::-1], rel=1e-9)


def test_in_an_ageing_carrier_the_velocity_is_that_of_the_age():
    critical = float(yield_stress.critical_yield_stress(spheres()))
    growth = 0.5 * critical / FALL
    ageing = spheres(yield_stress=jnp.asarray(0.1 * critical), yield_growth=jnp.asarray(growth))
    times = np.array([0.0, 0.4, 2.5]) * FALL  # it stops at 1.8 of that
    settled = column(ageing, times=times, **RIGID | {"cells": 50})
    aged = ageing.replace(yield_stress=jnp.asarray(0.3 * critical), yield_growth=None)
    falling = [
        float(mrjax.terminal_velocity(one.replace(f_w=zaki()(jnp.asarray(INITIAL)))))
        for one in (ageing.replace(yield_growth=None), aged)
    ]
    middle = np.asarray(settled.settling_velocity)[:, 25]
    assert middle == near([*falling, 0.0], rel=1e-6)


def test_a_yielding_bed_at_rest_carries_the_weight_above():
    times = LATE * np.arange(1.0, 7.0)
    settled = column(spheres(), times=times, compression=SOFT, **SETTLING)
    top, levels = float(settled.mudline[0]), np.asarray(settled.levels)
    length = 7.0 * 40.0 / (6.0 * WEIGHT * 0.3)
    fraction = 0.3 * (1.0 + np.maximum(top - levels, 0.0) / length) ** (1.0 / 6.0)
    exact = np.where(levels < top, SOFT.solid_stress(jnp.asarray(fraction)), 0.0)
    np.testing.assert_allclose(settled.solid_stress[0], exact, rtol=0.0, atol=1e-3 * exact[0])
    assert np.abs(settled.settling_velocity).max() < 1e-6 * SPEED


def test_the_velocity_in_a_yielding_bed_is_what_carries_the_particles():
    """d/dt of the particle volume below a level is phi u there, by central differences."""
    step = 2e-3 * FALL
    times = np.array([0.3, 1.2]) * FALL
    all_times = np.sort(np.concatenate([times - step, times, times + step]))
    settled = column(spheres(), times=all_times, compression=SOFT, **SETTLING)
    profiles, cell = np.asarray(settled.volume_fraction), HEIGHT / 200
    below = cell * (np.cumsum(profiles, axis=1) - 0.5 * profiles)
    carried = (below[2::3] - below[::3]) / (2.0 * step)
    flux = (profiles * np.asarray(settled.settling_velocity))[1::3]
    smooth = np.abs(np.diff(profiles[1::3], axis=1, append=0.0)) < 0.003  # not at a front
    assert (smooth & (flux > 0.0)).sum(axis=1).min() > 40
    assert np.abs(carried - flux)[smooth].max() < 0.01 * flux.max()
    in_bed = profiles[1::3] > 0.31
    assert (flux[in_bed & smooth] > 0.1 * flux.max()).any()


several = partial(mrjax.polydisperse_column, height=HEIGHT, bed_fraction=DENSEST, cells=60)


def classes(**changes):
    return spheres().replace(radius=2e-6 * jnp.asarray([1.0, 0.7]), **changes)


def test_of_several_classes():
    """Masliyah's velocities in the suspension; the bed carries all that is in it."""
    fractions = np.array([0.15, 0.1])
    excess = np.array([6000.0, 4000.0])
    dense = classes(particle_density=jnp.asarray(1000.0 + excess))
    settled = several(dense, times=TIMES[1:], hindrance=zaki(), volume_fraction=fractions)
    bed, suspended = np.asarray(settled.bed_front) / HEIGHT * 60, settled.class_fractions
    start = np.asarray(settled.class_velocities[0])
    lone = np.array([SPEED, 0.49 * SPEED * excess[1] / excess[0]])
    middle = 45
    phi = np.asarray(suspended[0, :, middle])
    assert phi == near(fractions, rel=1e-3)
    slip = lone * (1 - phi.sum()) ** (4.65 - 2) * (1.0 - excess @ phi / excess)
    exact = slip - phi @ slip
    assert start[:, middle] == near(exact, rel=1e-9)
    assert not start[:, : int(bed[0] + 0.5)].any()
    mean = phi @ exact / phi.sum()
    assert float(settled.settling_velocity[0, middle]) == near(mean, rel=1e-9)
    weight = 9.81 * HEIGHT * (excess @ fractions)
    cell = HEIGHT / 60
    lowest = 9.81 * cell / 2 * excess @ np.asarray(suspended[-1, :, 0])
    # All but the fines that are not in the bed yet: less than a cell of it.
    assert float(settled.solid_stress[-1, 0]) == near(weight - lowest, rel=0.01)
    slope = np.diff(np.asarray(settled.solid_stress[-1]))[: int(bed[-1]) - 2]
    both = np.asarray(suspended[-1])
    between = 0.5 * (both[:, 1:] + both[:, :-1])[:, : int(bed[-1]) - 2]
    assert slope == near(-9.81 * cell * (excess @ between), rel=1e-9)


FEW = dict(times=TIMES[1:3], cells=30)


@pytest.mark.parametrize(
    "settle, particles, tolerance",
    [
        (partial(column, **FEW, **RIGID, steps=200), spheres(), 1e-5),
        (partial(column, **FEW, **SETTLING, compression=SOFT, steps=60), spheres(), 1e-5),
        # Its steps carry no derivative: in cells with traces of particles it errs.
        pytest.param(
            partial(several, **FEW, hindrance=zaki(), volume_fraction=[0.15, 0.1]),
            classes(),
            0.1,
            marks=pytest.mark.slow,
        ),
    ],
    ids=["rigid", "yielding", "classes"],
)
def test_gradients_of_fields_are_those_of_differences(settle, particles, tolerance):
    @jax.jit
    def fields(factor):
        tube = settle(particles.replace(viscosity=particles.viscosity * factor))
        flux = tube.volume_fraction * tube.settling_velocity / SPEED
        return jnp.stack([flux, tube.solid_stress / WEIGHT / HEIGHT])

    step = 1e-6
    slopes = np.asarray(jax.jacfwd(fields)(jnp.asarray(1.0)))
    central = np.asarray(fields(1.0 + step) - fields(1.0 - step)) / (2.0 * step)
    largest = np.abs(slopes).max(axis=(1, 2), keepdims=True)
    assert largest.min() > 0.05
    assert (np.abs(slopes - central) / largest).max() < tolerance
