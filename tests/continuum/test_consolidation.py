"""A yielding bed: rest by quadrature, exact derivatives, order, limits, and any last time."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import mrjax
from mrjax.continuum import characteristics, consolidation, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.column import column, column_steps
from mrjax.continuum.compression import Compression, densest_bed
from mrjax.continuum.time_grid import time_grid
from mrjax.laws.closures.floc_richardson_zaki import floc_richardson_zaki
from tests.continuum.test_column import EXACT, HEIGHT, SPEED, near, solid, spheres, zaki

WEIGHT = 6000.0 * 9.81  # of the solid in the fluid, N/m^3
SOFT = Compression(gel_fraction=0.3, stress=40.0, exponent=7.0)
SETTLING = dict(height=HEIGHT, volume_fraction=0.15, bed_fraction=0.64, hindrance=zaki())
NAMES = ("gel_fraction", "stress", "exponent", "volume_fraction", "viscosity")
LATE = 1000.0 * HEIGHT / SPEED


def changed(factors, **given):
    """Arguments of the column with factors on `NAMES`."""
    gel, stress, exponent, fraction, viscosity = factors
    given = SETTLING | given
    compression = given.pop("compression", SOFT)
    given["compression"] = Compression(
        gel_fraction=compression.gel_fraction * gel,
        stress=compression.stress * stress,
        exponent=compression.exponent * exponent,
    )
    given["volume_fraction"] = given["volume_fraction"] * fraction
    particles = spheres()
    return particles.replace(viscosity=particles.viscosity * viscosity), given


def mudline(factors, **given):
    particles, given = changed(factors, **given)
    return column(particles, **given).mudline


def height_at_rest(initial, compression):
    """INTEGRAL of dm / phi over the stress that each particle carries, by quadrature; m."""
    weight = WEIGHT * initial * HEIGHT
    gel, stress, k = (float(getattr(compression, name)) for name in NAMES[:3])

    def volume(share):
        return (1.0 + weight * share / stress) ** (-1.0 / k)

    layer = stress / weight
    points = [point for point in (layer, 10 * layer) if point < 1.0]
    integral = quad(volume, 0.0, 1.0, epsabs=0.0, epsrel=1e-12, points=points or None)[0]
    return HEIGHT * initial / gel * integral


def test_the_stress_is_its_own_derivative():
    fraction = jnp.asarray([0.1, 0.29, 0.31, 0.4, 0.6])
    slope = jax.vmap(jax.grad(SOFT.solid_stress))(fraction)
    np.testing.assert_allclose(SOFT.stiffness(fraction), slope, rtol=EXACT)
    np.testing.assert_allclose(SOFT.solid_stress(0.6), 40.0 * (2.0**7 - 1.0), rtol=EXACT)
    assert float(SOFT.solid_stress(0.29)) == 0.0


@pytest.mark.parametrize(
    "initial, compression",
    [
        (0.15, SOFT),
        (0.35, SOFT),
        (0.02, Compression(gel_fraction=0.03, stress=1.0, exponent=3.0)),
        (0.2, Compression(gel_fraction=0.4, stress=1e4, exponent=4.0)),
    ],
    ids=["suspension", "gelled from the start", "flocs", "stiff"],
)
def test_the_rest_height_and_its_derivatives_are_those_of_quadrature(initial, compression):
    """Cells carry the weight above their middles, so that only the quadrature errs: 1e-4."""
    given = dict(volume_fraction=initial, compression=compression, times=[LATE], cells=100)
    at_rest = partial(mudline, **given)
    height, slopes = float(at_rest(jnp.ones(5))[0]), np.asarray(jax.jacfwd(at_rest)(jnp.ones(5)))
    assert height == near(height_at_rest(initial, compression), rel=1e-4)
    for number, name in enumerate(NAMES[:3]):
        step = 1e-5 * getattr(compression, name)
        ends = (
            height_at_rest(
                initial, replace(compression, **{name: getattr(compression, name) + sign * step})
            )
            for sign in (1, -1)
        )
        exact = (next(ends) - next(ends)) / 2e-5
        assert slopes[0, number] == near(exact, rel=1e-3), name
    assert abs(slopes[0, 4]) < 1e-9 * HEIGHT  # a thicker fluid changes no bed at rest


def test_the_profile_at_rest_carries_the_weight():
    """In the profile over the height, too, which is cut from the material cells."""
    settled = column(spheres(), times=[LATE], compression=SOFT, **SETTLING)
    top = float(settled.mudline[0])
    length = 7.0 * 40.0 / (6.0 * WEIGHT * 0.3)
    levels, fraction = np.asarray(settled.levels), np.asarray(settled.volume_fraction)[0]
    inside = levels < top - HEIGHT / 100
    exact = 0.3 * (1.0 + (top - levels[inside]) / length) ** (1.0 / 6.0)
    np.testing.assert_allclose(fraction[inside], exact, rtol=2e-3)
    assert exact[0] > 1.2 * exact[-1]
    assert float(solid(settled)[0]) == near(0.15 * HEIGHT, rel=EXACT)
    assert float(settled.bed_front[0]) == near(top, rel=1e-9)
    assert not fraction[levels > top + HEIGHT / 200].any()


TIMES = np.array([0.1, 0.5, 0.9, 1.1, 1.3, 2.0, 10.0]) * HEIGHT / SPEED


def test_derivatives_forward_backward_and_by_differences():
    """Exact derivatives of the scheme, wherever its branches do not change."""
    curve = jax.jit(partial(mudline, times=TIMES, cells=40, steps=80))
    forward = np.asarray(jax.jacfwd(curve)(jnp.ones(5)))
    for number, name in enumerate(NAMES):
        step = 1e-6 * jnp.zeros(5).at[number].set(1.0)
        central = (curve(1.0 + step) - curve(1.0 - step)) / 2e-6
        scale = np.abs(central).max()
        np.testing.assert_allclose(forward[:, number], central, atol=1e-5 * scale, err_msg=name)
    weights = np.random.default_rng(1).uniform(0.5, 1.5, TIMES.size)
    backward = jax.grad(lambda factors: jnp.sum(weights * curve(factors)))(jnp.ones(5))
    np.testing.assert_allclose(backward, weights @ forward, rtol=1e-8, atol=1e-12)


def case():
    times = np.array([3.0]) * HEIGHT / SPEED
    given = Case(spheres(), times=times, compression=None, **SETTLING)
    return given.as_arrays().astype(jnp.float64)


def test_long_steps_of_a_dense_bed_have_derivatives_of_differences():
    """A bed so tight that its velocity falls by half within a cell: derivatives stay bounded."""
    given = SETTLING | dict(
        compression=Compression(gel_fraction=0.32, stress=25.0, exponent=2.9),
        volume_fraction=0.087,
        bed_fraction=0.72,
        hindrance=zaki(18.0),
        times=np.array([2.0, 5.0, 10.0, 30.0, 100.0]) * HEIGHT / SPEED,
    )

    def curve(gel):
        return mudline((gel, 1.0, 1.0, 1.0, 1.0), **given)

    slope = jax.jvp(curve, (1.0,), (1.0,))[1]
    step = 1e-7  # a limiter changes its branch within a longer one
    central = (curve(1.0 + step) - curve(1.0 - step)) / (2.0 * step)
    np.testing.assert_allclose(slope, central, atol=1e-4 * np.abs(central).max())


def test_the_order_is_two_where_the_bed_consolidates():
    """Against four times as many cells and steps, once the front has passed the mudline."""
    times = np.linspace(1.6, 3.0, 8) * HEIGHT / SPEED
    coarse, middle, fine, reference = (
        consolidation.mudline_at(
            consolidation.consolidate(
                case(),
                Compression(gel_fraction=0.2, stress=300.0, exponent=3.0),
                cells=cells,
                steps=2 * cells,
            ),
            times,
        )
        for cells in (25, 50, 100, 400)
    )
    errors = [np.abs(np.asarray(one - reference)).max() for one in (coarse, middle, fine)]
    assert errors[0] > 1e-6 * HEIGHT
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.8).all(), (errors, orders)


@pytest.mark.parametrize("initial", [0.1, 0.35], ids=["direct shock", "fan"])
def test_a_bed_without_stress_is_rigid_at_its_greatest_fraction(initial):
    """Kynch's exact mudline; the front that arrives is smeared over a few cells."""
    times = np.linspace(0.05, 4.0, 40) * HEIGHT / SPEED
    given = SETTLING | dict(volume_fraction=initial, bed_fraction=0.5)
    weak = Compression(gel_fraction=0.45, stress=1e-6, exponent=1.0)
    settled = column(spheres(), times=times, compression=weak, **given)
    flux = kynch.table(spheres(), zaki(), jnp.asarray(initial), jnp.asarray(0.5))
    exact = characteristics.mudline(flux, jnp.asarray(HEIGHT), jnp.asarray(times))
    np.testing.assert_allclose(settled.mudline, exact, atol=1e-3 * HEIGHT)
    assert float(settled.mudline[-1]) == near(initial / 0.5 * HEIGHT, rel=1e-6)
    assert np.asarray(settled.volume_fraction).max() < 0.5 * (1.0 + 1e-9)


def test_a_stiff_bed_is_a_rigid_one():
    """With a stress that hardly yields the bed is one of the gel fraction."""
    times = np.linspace(0.0, 2.5, 11) * HEIGHT / SPEED
    given = dict(height=HEIGHT, volume_fraction=0.1, times=times, hindrance=zaki())
    rigid = column(spheres(), bed_fraction=0.5, **given)

    def gap(stress):
        stiff = Compression(gel_fraction=0.5, stress=stress, exponent=8.0)
        bed = column(spheres(), bed_fraction=0.64, compression=stiff, **given)
        return max(
            float(jnp.abs(getattr(bed, line) - getattr(rigid, line)).max()) / HEIGHT
            for line in ("mudline", "bed_front")
        )

    assert gap(1e6) < 0.01  # two cells, of either front
    assert gap(1e2) > 0.02


def test_the_mudline_falls_at_the_suspension_s_velocity_until_the_bed_reaches_it():
    falling = consolidation.consolidate(case(), SOFT, cells=50, steps=100)
    speed = SPEED * (1.0 - 0.15) ** 4.65
    early = np.asarray(falling.time) < 0.8 * HEIGHT / speed * (1.0 - 0.15 / 0.3)
    expected = HEIGHT - speed * np.asarray(falling.time)[early]
    np.testing.assert_allclose(np.asarray(falling.mudline)[early], expected, rtol=1e-9)
    np.testing.assert_allclose(np.asarray(falling.speed)[early], speed, rtol=1e-9)


def test_a_network_that_carries_its_weight_stands_still():
    stiff = Compression(gel_fraction=0.1, stress=1e4, exponent=2.0)
    standing = column(spheres(), times=TIMES, compression=stiff, **SETTLING)
    np.testing.assert_array_equal(standing.mudline, np.full(TIMES.size, HEIGHT))
    np.testing.assert_allclose(solid(standing), 0.15 * HEIGHT, rtol=EXACT)


@pytest.mark.parametrize("last", [1e-3, 1.0, 1e3, 1e12])
def test_steps_reach_any_last_time(last):
    """As many steps however late it is, and the same early curve."""
    settled = column(spheres(), times=[0.3 * last, last], compression=SOFT, **SETTLING)
    assert settled.steps == column_steps(spheres(), times=[last], compression=SOFT, **SETTLING)
    assert settled.steps == 400
    if last >= 1e3:
        late = column(spheres(), times=[last, LATE + last], compression=SOFT, **SETTLING)
        assert float(late.mudline[-1]) == near(height_at_rest(0.15, SOFT), rel=1e-4)


def test_times_of_steps():
    """Equal at first, then longer by a constant factor, up to the last time."""
    times = np.asarray(time_grid(jnp.asarray(2.0), jnp.asarray(3000.0), 100))
    lengths = np.diff(times)
    np.testing.assert_allclose(lengths[:60], 2.0 / 60, rtol=1e-9)
    np.testing.assert_allclose(lengths[61:] / lengths[60:-1], lengths[62] / lengths[61], rtol=1e-9)
    assert times[-1] == near(3000.0, rel=1e-9)
    short = np.asarray(time_grid(jnp.asarray(2.0), jnp.asarray(1.0), 100))
    np.testing.assert_allclose(np.diff(short), 0.01, rtol=2e-3)
    # A settled time beyond the last one has no derivative.
    by_both = jax.grad(lambda settled, last: time_grid(settled, last, 10)[-1], (0, 1))
    np.testing.assert_allclose(by_both(2.0, 3000.0), (0.0, 1.0), atol=1e-9)


def test_many_at_once_in_single_precision_and_creaming():
    together = jax.vmap(lambda factor: mudline((1.0, factor, 1.0, 1.0, 1.0), times=TIMES))(
        jnp.asarray([0.5, 1.0, 3.0])
    )
    np.testing.assert_allclose(together[1], mudline(jnp.ones(5), times=TIMES), rtol=1e-9)
    assert float(together[0, -1]) < 0.97 * float(together[2, -1])
    given = dict(times=TIMES, compression=SOFT, **SETTLING)
    single = column(spheres().astype(jnp.float32), **given)
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(single))
    np.testing.assert_allclose(single.mudline, together[1], atol=1e-4 * HEIGHT)
    light = spheres().replace(particle_density=1000.0, fluid_density=7000.0)
    creaming = column(light.replace(added_mass=0.0), **given)
    assert (np.diff(creaming.mudline) >= 0.0).all() and float(creaming.mudline[0]) > 0.0


def test_the_densest_bed_is_that_of_spheres_or_full_of_flocs():
    flocs = partial(floc_richardson_zaki, floc_volume=9.0)
    assert float(densest_bed(None)) == float(densest_bed(zaki())) == 0.74
    assert float(densest_bed(flocs)) == near(0.999 / 9.0)
    assert float(densest_bed(partial(floc_richardson_zaki, floc_volume=1.0))) == 0.74


def test_a_suspension_that_falls_faster_if_denser_is_refused():
    """The scheme takes the velocity at a face from below, where disturbances come from."""
    given = SETTLING | dict(hindrance=lambda fraction: 1.0 / (1.0 + fraction))
    with pytest.raises(mrjax.InputError, match="falls faster than a thinner one"):
        column(spheres(), times=TIMES, compression=SOFT, **given)
    traced = jax.jit(lambda times: column(spheres(), times=times, compression=SOFT, **given))
    assert np.isnan(traced(TIMES).mudline).all()


def test_a_bed_that_is_not_solved_is_refused():
    """Where hardly any stress holds a bed of low permeability below its greatest fraction."""
    weak = Compression(gel_fraction=0.03, stress=0.00374, exponent=0.972)
    given = dict(height=HEIGHT, volume_fraction=0.002657, bed_fraction=0.175)
    given |= dict(hindrance=zaki(11.4), compression=weak, times=[3.1e3 * HEIGHT / SPEED])
    with pytest.raises(mrjax.InputError, match="were not solved"):
        column(spheres(), cells=100, **given)
    traced = jax.jit(lambda times: column(spheres(), cells=100, **given | dict(times=times)))
    assert np.isnan(traced(given["times"]).mudline).all()


def test_a_carrier_whose_yield_stress_holds_the_suspension():
    """It stands still to rounding; just below the threshold it settles slowly."""
    given = dict(times=TIMES, compression=SOFT, **SETTLING)
    threshold = float(mrjax.laws.yield_stress.critical_yield_stress(spheres()))
    held = column(spheres().replace(yield_stress=1.01 * threshold), **given)
    np.testing.assert_allclose(held.mudline, HEIGHT, rtol=1e-13)
    slowed = column(spheres().replace(yield_stress=0.5 * threshold), **given)
    assert HEIGHT > float(slowed.mudline[1]) > float(column(spheres(), **given).mudline[1])
