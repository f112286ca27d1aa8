"""Hopf's formula for a column: Kynch's constructions, the scheme of many cells, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial
from scipy.optimize import minimize_scalar

from mrjax.continuum import characteristics, kynch
from mrjax.continuum.column import column, column_steps
from mrjax.laws import drag
from tests.continuum.test_column import (
    EXACT,
    EXPONENT,
    FANS,
    HEIGHT,
    SPEED,
    exact_fan,
    exact_shock,
    near,
    speed,
    spheres,
    zaki,
)

PARABOLA = 2e-7
"""Of the height: what a parabola between nodes of the flux misses, of third order in 1 / 256."""

tall = jnp.asarray(HEIGHT)


def table(initial, densest, law=None):
    law = law or zaki()
    return kynch.table(spheres(), law, jnp.asarray(initial), jnp.asarray(densest))


def seconds(times):
    """Times in s, of ones in HEIGHT / SPEED."""
    return jnp.asarray(times) * HEIGHT / SPEED


@pytest.mark.parametrize("initial, densest", FANS)
def test_the_mudline_is_that_of_kynchs_construction(initial, densest):
    mudline, _, start, end, _ = exact_fan(initial, densest)
    times = np.linspace(0.0, 1.5 * end, 300)
    found = characteristics.mudline(table(initial, densest), tall, seconds(times)) / HEIGHT
    exact = np.array([mudline(time) for time in times])
    assert np.abs(found - exact).max() < PARABOLA
    assert np.abs(found - exact)[(times < start) | (times > end)].max() < EXACT
    assert float(found[0]) == near(1.0, rel=EXACT)


@pytest.mark.parametrize("initial, densest", [*FANS, (0.1, 0.6)])
def test_all_rests_when_the_mudline_meets_the_bed(initial, densest):
    end = exact_shock(initial, densest)[1] if initial == 0.1 else exact_fan(initial, densest)[3]
    found = characteristics.rest_time(table(initial, densest), tall) * SPEED / HEIGHT
    assert float(found) == near(end, rel=2e-5)  # the greatest of values at nodes


def solids_of(profile, time):
    """Solids below heights, of the integral of a profile with a hundred thousand cells."""
    edges = np.linspace(0.0, 1.0, 100001)
    below = np.append(0.0, np.cumsum(profile(0.5 * (edges[1:] + edges[:-1]), time))) / 1e5
    return lambda height: np.interp(height, edges, below)


@pytest.mark.parametrize("initial, densest", FANS)
@pytest.mark.parametrize("share", [0.3, 0.9, 1.2])
def test_solids_and_mean_fractions_are_those_of_the_construction(initial, densest, share):
    """In the bed, the fan, the suspension, the clear fluid, and layers with a front in them."""
    *_, start, end, profile = exact_fan(initial, densest)
    time = min(share * start, 0.5 * (start + end))
    below = solids_of(profile, time)
    heights, thickness = np.linspace(0.0, 1.0, 101), 0.01
    flux_table, at = table(initial, densest), jnp.full(101, seconds(time))
    solids = characteristics.solids_below(flux_table, tall, heights * HEIGHT, at) / HEIGHT
    assert np.abs(solids - below(heights)).max() < 1e-5  # half a cell of a front
    mean = characteristics.mean_fraction(
        flux_table, tall, heights * HEIGHT, at, jnp.asarray(thickness * HEIGHT)
    )
    low, high = (np.clip(heights + way * thickness / 2, 0.0, 1.0) for way in (-1, 1))
    exact = (below(high) - below(low)) / (high - low)
    assert np.abs(mean - exact).max() < 2e-3  # 1e-5 twice, over 0.01


@pytest.mark.parametrize("exponent, densest", [(4.65, 0.6), (60.0, 0.13)])
def test_a_column_of_ever_more_cells_comes_to_it(exponent, densest):
    """A straight fall, a fan of concentrations and the bed; errors fall with the cells."""
    law, initial = zaki(exponent), 0.04
    falls = speed(initial, law)
    times = HEIGHT / falls * np.linspace(0.05, 3.0, 30)
    case = dict(height=HEIGHT, volume_fraction=initial, bed_fraction=densest, hindrance=law)
    flux_table = table(initial, densest, law)
    exact = np.asarray(characteristics.mudline(flux_table, tall, jnp.asarray(times)))
    assert exact[0] == near(HEIGHT - falls * times[0], rel=EXACT)
    errors = []
    for cells in (50, 200):
        settled = column(spheres(), times=times, cells=cells, **case)
        at, level = (one.ravel() for one in jnp.meshgrid(times, settled.levels, indexing="ij"))
        mean = characteristics.mean_fraction(flux_table, tall, level, at, tall / cells)
        off = np.abs(np.ravel(settled.volume_fraction) - mean).mean()
        errors.append([np.abs(settled.mudline - exact).max() / HEIGHT, off / initial])
    assert errors[1][0] < 0.004
    assert errors[1][1] < 0.05  # the front to the bed is smeared over some cells
    assert (np.array(errors[1]) < 0.5 * np.array(errors[0])).all()


@pytest.mark.parametrize(
    "law",
    [zaki(2.4), zaki(30.0), Partial(drag.son2018_smooth, coefficient=5.0, exponent=3.0, cap=160.0)],
)
def test_the_mudline_is_the_greatest_over_all_fractions(law):
    """Of the formula, by a search of scipy between the nodes."""
    initial, densest = 0.15, 0.55
    for time in np.array([0.2, 0.7, 1.5, 4.0]) * HEIGHT / speed(initial, law):

        def height(fraction, time=time):
            return (initial * HEIGHT - fraction * speed(fraction, law) * time) / fraction

        grid = np.linspace(initial, densest, 400)
        best = grid[int(np.argmax([height(one) for one in grid]))]
        width = grid[1] - grid[0]
        around = max(initial, best - width), min(densest, best + width)
        least = minimize_scalar(
            lambda x: -height(x), bounds=around, method="bounded", options={"xatol": 1e-12}
        )
        exact = max(-least.fun, height(initial), HEIGHT * initial / densest)
        flux_table = table(initial, densest, law)
        found = characteristics.mudline(flux_table, tall, jnp.asarray([time]))
        assert float(found[0]) == pytest.approx(exact, abs=5 * PARABOLA * HEIGHT)


def test_gradients_are_those_of_differences_and_of_factors_of_time():
    _, _, start, end, _ = exact_fan(0.35, 0.75)
    times = seconds([0.5 * start, 0.5 * (start + end), 1.2 * end])

    def line(theta):
        parameters = spheres(f_s=theta[0])
        law = Partial(drag.richardson_zaki, exponent=EXPONENT * theta[1])
        flux_table = kynch.table(parameters, law, 0.35 * theta[2], 0.75 * theta[3])
        heights = characteristics.mudline(flux_table, tall, times)
        level = jnp.array([0.2, 0.45, 0.55]) * HEIGHT
        layers = characteristics.mean_fraction(flux_table, tall, level, times, 0.02 * tall)
        return jnp.concatenate([heights / HEIGHT, layers])

    at = jnp.ones(4)
    forward, backward = jax.jacfwd(line)(at), jax.jacrev(line)(at)
    np.testing.assert_allclose(backward, forward, rtol=1e-9, atol=1e-11)
    step = 1e-5
    for number in range(4):
        unit = step * jnp.zeros(4).at[number].set(1.0)
        central = (line(at + unit) - line(at - unit)) / (2 * step)
        # The parabola of third order has a slope of second.
        np.testing.assert_allclose(forward[:, number], central, rtol=2e-6, atol=1e-7)
    # The straight fall at its velocity, and the bed at its height, exactly.
    assert float(forward[0, 0]) == near(float(times[0]) * speed(0.35, zaki()) / HEIGHT, rel=1e-9)
    np.testing.assert_allclose(forward[2, :3], [0.0, 0.0, 0.35 / 0.75], atol=EXACT)


def test_steps_of_a_column_end_with_its_rest():
    """Whenever it is looked at last; its profile then is that of a column that has long rested."""
    case = dict(height=HEIGHT, volume_fraction=0.2, bed_fraction=0.62, hindrance=zaki(), cells=60)
    rest = float(characteristics.rest_time(table(0.2, 0.62), tall))
    times = np.array([0.3, 0.8, 9.0, 1e9]) * rest
    assert column_steps(spheres(), times=times, **case) == column_steps(
        spheres(), times=times[:3], **case
    )
    settled = column(spheres(), times=times, **case)
    np.testing.assert_array_equal(settled.times, times)
    np.testing.assert_array_equal(settled.volume_fraction[2], settled.volume_fraction[3])
    assert float(settled.mudline[-1]) == near(HEIGHT * 0.2 / 0.62, rel=1e-9)
    early = column(spheres(), times=times[:2], **case)
    assert np.abs(early.mudline - settled.mudline[:2]).max() < 1e-3 * HEIGHT  # other steps
