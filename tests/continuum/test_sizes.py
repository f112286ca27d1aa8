"""Several classes of particles in a column: Masliyah's fluxes, fronts, conservation, gradients."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial
from scipy.optimize import brentq, fsolve

import mrjax
from mrjax.continuum import characteristics, kynch
from mrjax.continuum.sizes import interfaces, masliyah, scheme
from mrjax.laws import drag

near = partial(pytest.approx, abs=0.0)
HEIGHT, CELLS, EXPONENT = 0.1, 100, 4.65
CELL = HEIGHT / CELLS
SPEED = 1e-6  # of a lone particle of the reference radius, m/s
RADIUS = 2e-6
ZAKI = Partial(drag.richardson_zaki, exponent=EXPONENT)
CLOSURES = [
    (None, 0.6),
    (ZAKI, 0.6),
    (Partial(drag.son2018), 0.6),
    (Partial(drag.son2018_smooth), 0.6),
    (Partial(drag.haberman_sayre), 0.36),
]
NAMES = ["number", "richardson-zaki", "son2018", "son2018-smooth", "haberman-sayre"]


def spheres(ratio=1.0, **changes):
    """Particles with diameters `ratio` times that which falls at `SPEED`."""
    of = dict(radius=RADIUS, particle_density=7000.0, fluid_density=1000.0, viscosity=1.0)
    of |= dict(elastic_modulus=1e9, poisson_ratio=0.3)
    one = mrjax.Parameters(**of)
    slow = mrjax.terminal_velocity(one) / SPEED
    return one.replace(viscosity=slow, radius=RADIUS * jnp.asarray(ratio), **changes).astype(float)


def tube(parameters, fractions, times, law=ZAKI, densest=0.6, **options):
    options = dict(height=HEIGHT, bed_fraction=densest, cells=CELLS) | options
    return mrjax.polydisperse_column(
        parameters, volume_fraction=fractions, times=times, hindrance=law, **options
    )


# --- fluxes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("law, densest", CLOSURES, ids=NAMES)
def test_the_flux_of_one_class_is_kynchs(law, densest):
    initial = 0.4 * densest
    table = kynch.table(spheres(), law, jnp.asarray(initial), jnp.asarray(densest))
    inner = table.fraction[1:-1]
    one = masliyah.classes(spheres(), law)
    flux = masliyah.fluxes(one, inner[None], jnp.asarray(densest))[0]
    assert np.abs(flux / table.flux[1:-1] - 1).max() < 1e-12


def test_the_printed_form_of_equal_densities():
    """v_i = u_1 (1 - phi)^(n - 1) (delta_i - SUM delta_m phi_m), with delta_i = (d_i / d_1)^2."""
    ratio, fractions = np.array([1.0, 0.7, 0.4]), np.array([0.2, 0.05, 0.1])
    law = masliyah.classes(spheres(ratio), ZAKI)
    velocity = masliyah.velocities(law, jnp.asarray(fractions)[:, None], jnp.asarray(0.6))[:, 0]
    delta = ratio**2
    printed = SPEED * (1 - fractions.sum()) ** (EXPONENT - 1) * (delta - delta @ fractions)
    assert np.asarray(velocity) == near(printed, rel=1e-12)
    assert printed[-1] < 0  # the fines rise with the displaced fluid


def test_other_densities_by_the_balance_of_volumes():
    """Slip by the density of the suspension; no net volume crosses a height."""
    fractions = np.array([0.1, 0.2])
    parameters = spheres(np.array([1.0, 1.3]), coating_density=1500.0, f_r=np.array([1.0, 1.2]))
    law = masliyah.classes(parameters, ZAKI)
    velocity = masliyah.velocities(law, jnp.asarray(fractions)[:, None], jnp.asarray(0.6))[:, 0]
    total = fractions.sum()
    fluid = -(fractions @ velocity) / (1 - total)
    density = np.asarray(mrjax.laws.particle.apparent_density(parameters))
    suspension = fractions @ density + (1 - total) * 1000.0
    diameter = 2 * np.asarray(mrjax.laws.particle.outer_radius(parameters))
    stokes = (density - suspension) * 9.81 * diameter**2 / 18 / np.asarray(parameters.viscosity)
    slip = stokes * (1 - total) ** (EXPONENT - 2)
    assert np.asarray(velocity) - fluid == near(slip, rel=1e-11)


# --- one class ----------------------------------------------------------------------------------


@pytest.mark.parametrize("law, densest", CLOSURES[:3], ids=NAMES[:3])
def test_one_class_settles_as_kynchs(law, densest):
    """Within a cell of the exact mudline, at all times, and at rest to rounding."""
    initial = 0.25
    table = kynch.table(spheres(), law, jnp.asarray(initial), jnp.asarray(densest))
    rest = characteristics.rest_time(table, jnp.asarray(HEIGHT))
    times = rest * jnp.linspace(0.0, 3.0, 25)
    settled = tube(spheres(), [initial], times, law, densest)
    exact = characteristics.mudline(table, jnp.asarray(HEIGHT), times)
    assert np.abs(settled.mudline - exact).max() < CELL
    assert float(settled.mudline[-1]) == near(HEIGHT * initial / densest, rel=1e-7)
    assert float(settled.bed_front[-1]) == near(HEIGHT * initial / densest, rel=1e-7)
    assert np.diff(settled.volume_fraction, axis=1).max() < 1e-12  # denser below, always


def test_equal_classes_are_one():
    times = np.array([0.1, 0.3, 0.6]) * HEIGHT / SPEED
    shares = np.array([0.5, 0.3, 0.2])
    one = tube(spheres(), [0.3], times)
    several = tube(spheres(np.ones(3)), 0.3 * shares, times)
    exact = shares[:, None] * np.asarray(one.volume_fraction)[:, None]
    assert np.abs(several.class_fractions - exact).max() < 1e-12
    assert np.abs(several.mudline - one.mudline).max() < 1e-12 * HEIGHT
    assert several.bed_composition[-1] == near(shares, rel=1e-10)


# --- several classes ----------------------------------------------------------------------------


def spread(classes=5, sigma=1.5):
    """Equal volumes at the middle quantiles of a log-normal distribution, coarse first."""
    quantiles = jax.scipy.stats.norm.ppf((np.arange(classes) + 0.5) / classes)
    return sigma ** np.asarray(quantiles)[::-1]


DENSITIES = {"equal": {}, "differ": {"particle_density": np.linspace(7000.0, 4000.0, 5)}}


@pytest.mark.parametrize("densities", DENSITIES.values(), ids=DENSITIES)
def test_the_mass_of_each_class_and_the_bounds(densities):
    fractions = np.array([0.02, 0.08, 0.1, 0.08, 0.04])
    times = np.array([0.2, 0.5, 1.0, 3.0, 300.0]) * HEIGHT / SPEED
    settled = tube(spheres(spread(), **densities), fractions, times)
    profiles = np.asarray(settled.class_fractions)
    assert np.abs(profiles.mean(axis=2) / fractions - 1).max() < 1e-14
    assert profiles.min() >= 0.0
    assert profiles.sum(axis=1).max() < 0.6 * (1 + 1e-15)
    # All but the last cell is in the bed; that fills slowly, as v(phi_m) is small.
    missing = fractions - np.asarray(settled.bed_composition[-1]) * fractions.sum()
    assert np.abs(missing).max() < 0.6 / CELLS
    assert float(settled.mudline[-1]) == near(HEIGHT * fractions.sum() / 0.6, rel=1e-4)
    coarse, fine = settled.bed_composition[0, [0, -1]] / fractions[[0, -1]]
    assert coarse > 2 * fine


def jump_conditions(ratio, fractions):
    """Fraction of the fines alone above the coarse, and the speeds of both fronts.

    phi_2* (v_2(0, phi_2*) - sigma_1) = phi_2 (v_2(phi) - sigma_1), with sigma_1 = v_1(phi) and
    sigma_2 = v_2(0, phi_2*).
    """
    lone = SPEED * ratio**2

    def velocity(phi):
        return (1 - phi.sum()) ** (EXPONENT - 1) * (lone - lone @ phi)

    coarse, fine = velocity(fractions)

    def balance(alone):
        above = velocity(np.array([0.0, alone]))[1]
        return alone * (above - coarse) - fractions[1] * (fine - coarse)

    alone = brentq(balance, 1e-6, 0.3, xtol=1e-15)
    return alone, coarse, velocity(np.array([0.0, alone]))[1]


def test_fronts_of_two_classes():
    ratio, fractions = np.array([1.0, 0.5]), np.array([0.15, 0.05])
    alone, coarse, fines = jump_conditions(ratio, fractions)
    times = np.linspace(0.1, 0.5, 9) * HEIGHT / coarse
    settled = tube(spheres(ratio), fractions, times, threshold=0.1)
    assert np.abs(settled.mudline - (HEIGHT - fines * times)).max() < 0.5 * CELL
    assert np.abs(settled.mudline_at(0.6) - (HEIGHT - coarse * times)).max() < 0.5 * CELL
    between = int((1 - 0.5 * (coarse + fines) * times[-1] / HEIGHT) * CELLS)
    assert settled.class_fractions[-1, :, between] == pytest.approx([0.0, alone], abs=1e-4)
    assert alone > 1.5 * fractions[1]  # fines stay behind, and are more than at first


def test_thin_suspensions_settle_each_at_its_own_velocity():
    ratio, fractions = spread(3), np.full(3, 1e-6)
    times = np.array([0.3, 0.6]) * HEIGHT / (SPEED * ratio[0] ** 2)
    settled = tube(spheres(ratio), fractions, times)
    below = HEIGHT - SPEED * ratio**2 * times[:, None]
    for number in range(3):
        front = interfaces.crossings(
            settled.class_fractions[:, number], 0.5e-6 * jnp.ones(()), jnp.asarray(0.6)
        )
        assert np.abs(front * CELL - below[:, number]).max() < CELL


def test_smooth_profiles_are_of_second_order():
    """The error of a smooth profile of two classes falls with the square of the cell."""

    def error(cells):
        law = masliyah.classes(spheres(np.array([1.0, 0.6])), ZAKI)
        law = law._replace(mobility=law.mobility * cells)
        column = scheme.column(law, jnp.array([0.1, 0.1]), jnp.asarray(0.6))
        level = (jnp.arange(cells, dtype=float) + 0.5) / cells
        bump = 0.1 + 0.05 * jnp.exp(-((level - 0.6) ** 2) / 0.02)
        carry = scheme.Carry(
            jnp.stack([bump, 0.25 - bump]), jnp.zeros(()), jnp.zeros((), jnp.int32)
        )
        end = jnp.asarray(0.1 / SPEED)
        carry = jax.lax.while_loop(
            lambda now: now.time < end, lambda now: scheme._step(column, now, end), carry
        )
        half = cells // 40  # away from floor and top, on a common grid
        return np.asarray(carry.fraction).reshape(2, 40, half).mean(axis=2)[:, 20:34]

    coarse, middle, fine = (error(cells) for cells in (160, 320, 640))
    order = np.log2(np.abs(coarse - middle).mean() / np.abs(middle - fine).mean())
    assert order > 1.7  # minmod flattens the top of a bump


# --- heights ------------------------------------------------------------------------------------


def test_a_front_is_located_by_volume():
    """However a front is smeared over three cells, its height and derivative are exact."""

    def profile(place):
        inner = [jnp.clip((place - 40.0 + 1.0 - at) / 3.0, 0.0, 1.0) for at in range(-1, 3)]
        above = jnp.full(56, 0.05)
        return jnp.concatenate([jnp.full(40, 0.3), 0.05 + 0.25 * jnp.stack(inner), above])

    for place in (40.2, 40.9, 41.5):
        volume = jnp.sum(profile(place) - 0.05) / 0.25
        for level in (0.1, 0.2):
            found = interfaces.crossing(profile(place), jnp.asarray(level), jnp.asarray(0.6))
            assert float(found) == near(float(volume), rel=1e-12)


def test_a_smooth_profile_is_interpolated():
    level = jnp.arange(100.0) + 0.5
    found = interfaces.crossing(0.4 - 0.003 * level, jnp.asarray(0.2), jnp.asarray(0.6))
    assert float(found) == near(0.2 / 0.003, rel=1e-10)


def zone_fronts(ratio, fractions):
    """Speeds of the front of each class, coarse first, and total fractions below them.

    In a uniform suspension the coarsest class falls with its own velocity s. The finer ones cross
    its front by phi_j* (v_j(phi*) - s) = phi_j (v_j(phi) - s), and so on for the next class.
    """
    delta, phi, fronts = ratio**2, np.array(fractions), []
    for number in range(len(ratio)):
        hindered = (1 - phi.sum()) ** (EXPONENT - 1)
        velocity = hindered * (delta - delta @ phi)
        front = velocity[number]
        fronts.append((SPEED * front, phi.sum()))
        finer = np.arange(len(ratio)) > number

        def above(unknown, phi=phi, velocity=velocity, front=front, finer=finer):
            there = unknown[0] * (delta - unknown[1]) - front
            return np.where(finer, phi * (velocity - front) / there, 0.0)

        def balance(unknown, above=above):
            there = above(unknown)
            return (1 - there.sum()) ** (EXPONENT - 1) - unknown[0], delta @ there - unknown[1]

        phi = above(fsolve(balance, [hindered, delta @ phi - delta[number] * phi[number]]))
    return np.array(fronts).T


def test_the_mudline_of_a_spread_needs_a_threshold():
    """Its edges at 50, 10 and 1 % of the initial fraction part as the distribution widens.

    Lone velocity of the median over that of the edge: 6.8 at all three without a spread, and 6.7,
    8.2 and 8.2 with ten classes of a geometric standard deviation of 1.5.
    """
    shares, time = (0.5, 0.1, 0.01), 2.5 * HEIGHT / SPEED
    factors = []
    for sigma in (1.0, 1.5):
        ratio, fractions = spread(10, sigma), np.full(10, 0.0337)
        settled = tube(spheres(ratio), fractions, jnp.array([time]))
        edges = np.array([float(settled.mudline_at(share)[0]) for share in shares])
        factors.append(SPEED * time / (HEIGHT - edges))
        if sigma > 1.0:
            speeds, below = zone_fronts(ratio, fractions)
            last = [np.flatnonzero(below >= share * 0.337)[-1] for share in shares]
            assert np.abs(edges - (HEIGHT - speeds[last] * time)).max() < 1.5 * CELL
    assert factors[0] == near(np.full(3, (1 - 0.337) ** -EXPONENT), rel=2e-3)
    assert factors[1] == near(np.array([6.7, 8.2, 8.2]), rel=0.03)


# --- derivatives and transformations ------------------------------------------------------------


def heights(scale, steps=None, cells=CELLS):
    """Mudline over the height, (3,), as a function of factors on five values, (5,)."""
    parameters = spheres(np.array([1.2, 0.8]))
    settled = tube(
        parameters.replace(
            viscosity=parameters.viscosity * scale[0], radius=parameters.radius * scale[4]
        ),
        jnp.array([0.15, 0.1]) * scale[1],
        jnp.array([0.8, 2.0, 300.0]) * HEIGHT / SPEED,
        Partial(drag.richardson_zaki, exponent=EXPONENT * scale[2]),
        0.6 * scale[3],
        steps=steps,
        cells=cells,
    )
    return settled.mudline / HEIGHT


def test_gradients_against_central_differences():
    start = jnp.ones(5)
    forward = jax.jit(jax.jacfwd(heights))(start)
    run, width = jax.jit(heights), 0.03  # wider than the passage of a cell
    for number in range(5):
        shift = width * jnp.eye(5)[number]
        difference = (run(start + shift) - run(start - shift)) / (2 * width)
        assert np.abs(forward[:, number] - difference).max() < 0.1  # of derivatives up to 1
        assert float(forward[2, number]) == pytest.approx(float(difference[2]), abs=1e-3)


@pytest.mark.slow
def test_reverse_mode_of_a_given_number_of_steps():
    start = jnp.ones(5)
    forward = jax.jit(jax.jacfwd(partial(heights, cells=40)))(start)
    reverse = jax.jit(jax.grad(lambda scale: heights(scale, 400, 40)[1]))(start)
    assert np.abs(forward[1] - reverse).max() < 1e-9


def test_a_column_that_creams_is_a_mirror_image():
    sinks, rises = spheres(np.array([1.2, 0.8])), spheres(np.array([1.2, 0.8]))
    rises = rises.replace(particle_density=1000.0, fluid_density=7000.0)
    sinks = sinks.replace(coating_density=0.0)
    times = jnp.array([0.3]) * HEIGHT / SPEED
    down, up = (tube(each, [0.1, 0.1], times) for each in (sinks, rises))
    assert np.asarray(up.class_fractions[..., ::-1]) == near(
        np.asarray(down.class_fractions), rel=1e-9
    )
    assert float(up.mudline[0]) == near(HEIGHT - float(down.mudline[0]), rel=1e-9)
    assert float(up.mudline_at(0.1)[0]) == near(HEIGHT - float(down.mudline_at(0.1)[0]), rel=1e-9)


def test_steps_follow_the_fastest_class_that_is_left():
    """A column at rest takes one step to each further time."""
    times = jnp.array([1.0, 300.0]) * HEIGHT / SPEED
    parameters = spheres(np.array([2.0, 0.5]))
    settled = tube(parameters, [0.05, 0.05], times)
    later = tube(parameters, [0.05, 0.05], jnp.append(times, times[-1] * jnp.arange(2.0, 12.0)))
    assert int(later.steps) <= int(settled.steps) + 10 + 60
    fast = 2 * CELLS * 2.0**2 * float(times[-1]) * SPEED / HEIGHT
    assert int(settled.steps) < 0.01 * fast


@pytest.mark.parametrize(
    "change, words",
    [
        ({"volume_fraction": 0.1}, "one number for each class"),
        ({"volume_fraction": [0.4, 0.3]}, "sum of volume_fraction = 0.7 must be above 0 and below"),
        ({"volume_fraction": [0.4, -0.3]}, "at least 0"),
        ({"volume_fraction": [0.1, 0.1, 0.1]}, "radius has shape"),
        ({"threshold": 1.0}, "threshold = 1"),
        ({"hindrance": lambda phi: 1.0 - phi}, "give a hindrance that grows"),
        ({"steps": 20}, "steps = 20: too few"),
        (
            {"parameters": spheres(np.ones(2), particle_density=np.array([7e3, 9e2]))},
            "all sink or all rise",
        ),
    ],
)
def test_what_is_refused(change, words):
    options = dict(
        parameters=spheres(np.array([1.0, 0.5])), height=HEIGHT, volume_fraction=[0.1, 0.1],
        bed_fraction=0.6, times=[1e5], hindrance=ZAKI, cells=CELLS,
    ) | change  # fmt: skip
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.polydisperse_column(options.pop("parameters"), **options)


def test_traced_calls_with_impossible_arguments_are_nan():
    def height(fraction):
        settled = tube(spheres(np.array([1.0, 0.5])), fraction * jnp.ones(2), jnp.array([1e4]))
        return settled.mudline[0]

    heights = jax.jit(jax.vmap(height))(jnp.array([0.1, 0.4]))
    assert np.isfinite(heights[0]) and np.isnan(heights[1])
