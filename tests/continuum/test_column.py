"""The settling column: Kynch's constructions, conservation, order and gradients."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial
from scipy.optimize import brentq

import mrjax
from mrjax.continuum import kynch, scheme
from mrjax.continuum.column import column, column_steps
from mrjax.continuum.compression import Compression
from mrjax.laws import drag

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
EXACT = 1e-12  # sums over hundreds of cells and steps, in double precision
DAY = 86400.0
HEIGHT, EXPONENT = 0.1, 4.65
SPEED = 1e-6  # of a lone particle, m/s


def spheres(**changes):
    """Particles that settle at `SPEED` where f_w = 1."""
    of = dict(radius=2e-6, particle_density=7000.0, fluid_density=1000.0, viscosity=1.0)
    of |= dict(elastic_modulus=1e9, poisson_ratio=0.3)
    parameters = mrjax.Parameters(**of)
    slow = mrjax.terminal_velocity(parameters) / SPEED
    return parameters.replace(viscosity=slow, **changes).astype(float)


def zaki(exponent=EXPONENT):
    return Partial(drag.richardson_zaki, exponent=exponent)


def speed(fraction, law=None):
    """v(phi) in m/s: from the closure, not from a table."""
    return SPEED / (1.0 if law is None else float(law(jnp.asarray(fraction))))


def solid(settled):
    """Solid in each profile, as a height at volume fraction 1; (T,) in m."""
    return np.asarray(settled.volume_fraction).sum(axis=1) * HEIGHT / settled.levels.size


# --- Kynch's constructions ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "law, initial, densest, meets",
    [(None, 0.25, 0.6, 0.006), (None, 0.5, 0.6, 0.012), (zaki(), 0.1, 0.6, 0.003)],
    ids=["one speed", "one speed, dense", "Richardson-Zaki"],
)
def test_a_direct_shock(law, initial, densest, meets):
    """Both fronts are straight until they meet at t* = H (1 - phi_0/phi_m) / v_0.

    Their solid is that of Rankine and Hugoniot, whatever they are smeared over: exact but for where
    they meet, which takes some cells. With one speed for all nothing sharpens the upper front: it
    spreads over two cells, in the dense suspension over four, and the bed meets it before t*.
    """
    falls = speed(initial, law)
    meeting = HEIGHT * (1 - initial / densest) / falls
    times = meeting * np.append(np.linspace(0, 2, 41), 2.0 + np.pi)
    settled = column(
        spheres(), height=HEIGHT, volume_fraction=initial, bed_fraction=densest, times=times,
        hindrance=law,
    )  # fmt: skip
    rest = HEIGHT * initial / densest
    mudline = np.maximum(HEIGHT - falls * times, rest)
    bed = np.minimum(initial * falls / (densest - initial) * times, rest)
    assert settled.steps < 2000  # of which the errors are
    for found, exact in ((settled.mudline, mudline), (settled.bed_front, bed)):
        error = np.abs(found - exact)
        assert error.max() < meets * HEIGHT
        assert error[times < 0.7 * meeting].max() < EXACT * HEIGHT
        assert error[np.abs(times / meeting - 1) > 0.2].max() < 0.02 * meets * HEIGHT
        assert error[-1] < EXACT * HEIGHT
    assert float(settled.mudline[0]) == HEIGHT
    assert float(settled.sedimentation_ratio[-1]) == near(initial / densest, rel=EXACT)
    # Where the straight parts of the mudline meet.
    first = float((settled.mudline[10] - settled.mudline[4]) / (times[10] - times[4]))
    assert first == near(-falls, rel=1e-10)
    assert (float(settled.mudline[-1]) - HEIGHT) / first == near(meeting, rel=1e-10)


def flux(fraction):
    return fraction * (1 - fraction) ** EXPONENT


def slope(fraction):
    return (1 - fraction) ** (EXPONENT - 1) * (1 - (EXPONENT + 1) * fraction)


def exact_fan(initial, densest):
    """Kynch's construction for Richardson & Zaki with height and lone speed 1.

    Returns: mudline and bed front as functions of the time, the times at which the mudline meets
    the fan and the bed, and the profile as a function of height and time.
    """

    def tangent(low, high, at, value):
        return brentq(lambda x: flux(x) + slope(x) * (at - x) - value, low, high, xtol=1e-15)

    inflection = 2 / (EXPONENT + 1)
    most = tangent(inflection, densest - 1e-9, densest, 0.0)  # to the bed
    least = initial  # of the fan, which a front from phi_0 to it leads where f is concave
    if initial < inflection:
        least = tangent(inflection, densest - 1e-9, initial, flux(initial))
    assert least < most
    falls = flux(initial) / initial

    def meets(fraction):  # the solid below the mudline is all there is
        return initial / (flux(fraction) - fraction * slope(fraction))

    start, end = meets(least), meets(most)
    leading = (
        -(flux(initial) - flux(least)) / (initial - least) if least > initial else -slope(least)
    )
    assert start == near(1 / (falls + leading), rel=1e-9)  # two ways to the same time

    def mudline(time):
        if time <= start:
            return 1 - falls * time
        if time >= end:
            return initial / densest
        fraction = brentq(lambda x: meets(x) - time, least, most, xtol=1e-15)
        return -slope(fraction) * time

    def bed_front(time):
        return min(-slope(most) * time, initial / densest)

    fan = np.linspace(most, least, 4000)  # linear in between, to 1e-7

    def profile(height, time):
        inner = np.interp(height, -slope(fan) * time, fan)
        inner = np.where(height > leading * time, initial, inner)
        inner = np.where(height < bed_front(time), densest, inner)
        return np.where(height > mudline(time), 0.0, inner)

    return mudline, bed_front, start, end, profile


FANS = [(0.2, 0.62), (0.35, 0.75)]


def followed(initial, densest, times, cells):
    return column(
        spheres(), height=HEIGHT, volume_fraction=initial, bed_fraction=densest,
        times=np.asarray(times) * HEIGHT / SPEED, hindrance=zaki(), cells=cells,
    )  # fmt: skip


@pytest.mark.parametrize("initial, densest", FANS)
def test_a_fan_between_two_fronts(initial, densest):
    mudline, bed_front, start, end, _ = exact_fan(initial, densest)
    times = np.concatenate([np.linspace(0, start, 9), np.linspace(start, 1.5 * end, 33)[1:]])
    settled = followed(initial, densest, times, 200)
    found, exact = settled.mudline / HEIGHT, np.array([mudline(time) for time in times])
    assert np.abs(found - exact).max() < 0.004
    assert np.abs(found - exact)[:8].max() < 1e-8  # hardly any of the fan has come to it
    # The fan hangs on the bed: its last wave is as fast as the front, and the scheme spreads both.
    front = np.array([bed_front(time) for time in times])
    assert np.abs(settled.bed_front / HEIGHT - front).max() < 0.007
    assert np.abs(settled.bed_front / HEIGHT - front)[times > 1.3 * end].max() < 1e-6
    # Two straight lines would miss the second case by far.
    direct = np.maximum(1 - flux(initial) / initial * times, initial / densest)
    assert np.abs(exact - direct).max() > (0.07 if densest == 0.75 else 0.0)


def exact_shock(initial, densest):
    """As `exact_fan`, where the bed grows from a single front."""
    falls = flux(initial) / initial
    rises = flux(initial) / (densest - initial)
    end = 1 / (falls + rises)

    def profile(height, time):
        inner = np.where(height < rises * min(time, end), densest, initial)
        return np.where(height < max(1 - falls * time, initial / densest), inner, 0.0)

    return profile, end


def convergence(initial, densest, times, profile):
    """Errors in L1 of the profiles over the times, for cells halved thrice; (4,)."""
    errors = []
    for cells in (50, 100, 200, 400):
        settled = followed(initial, densest, times, cells)
        heights = (np.arange(8 * cells) + 0.5) / (8 * cells)  # eight to a cell
        exact = np.array([profile(heights, time) for time in times])
        mean = exact.reshape(len(times), cells, 8).mean(axis=2)
        errors.append(np.abs(settled.volume_fraction - mean).mean())
    return np.array(errors)


@pytest.mark.slow
def test_first_order_where_all_is_shocks():
    """Of monotone schemes in L1 (Teng & Zhang 1997)."""
    profile, end = exact_shock(0.1, 0.6)
    errors = convergence(0.1, 0.6, end * np.linspace(0.13, 0.91, 15), profile)
    assert np.log2(errors[0] / errors[-1]) / 3 > 0.9
    assert errors[2] < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("initial, densest", FANS)
def test_order_of_convergence_with_a_fan(initial, densest):
    """First order in L1, as for shocks, though the edge of the fan is as fast as the front it hangs
    on; both lines, too. A scheme without slopes in the cells has 2/3 there.
    """
    mudline, bed_front, start, end, profile = exact_fan(initial, densest)
    times = np.array(
        [0.5 * start, 0.9 * start, *(start + (end - start) * np.array([0.2, 0.5, 0.8]))]
    )
    errors = convergence(initial, densest, times, profile)
    assert np.log2(errors[0] / errors[-1]) / 3 > 0.85
    assert errors[2] < 2.5e-3
    lines = {"mudline": mudline, "bed_front": bed_front}
    for name, line in lines.items():
        exact = np.array([line(time) for time in times])
        errors = [
            np.abs(getattr(followed(initial, densest, times, cells), name) / HEIGHT - exact).max()
            for cells in (50, 100, 200, 400)
        ]
        assert np.log2(errors[0] / errors[-1]) / 3 > 0.9, name


# --- the scheme ---------------------------------------------------------------------------------


LAWS = {
    "one speed": None,
    "zaki": zaki(),
    "cap": Partial(drag.son2018),
    "smooth cap": Partial(drag.son2018_smooth),
    "wavy": Partial(lambda fraction: 1.5 + jnp.sin(25.0 * fraction)),
}


@jax.jit
def downwards(table, fraction):
    return kynch.godunov_flux(kynch.prepare_godunov(table), fraction[:-1], fraction[1:])


def a_flux(law, initial, densest, stretch):
    """A table in cells for each step, of which the fastest front crosses so many."""
    with_law = kynch.table(spheres(), LAWS[law], jnp.asarray(initial), jnp.asarray(densest))
    fastest = kynch.fastest_front(with_law, with_law.initial)
    return with_law._replace(flux=with_law.flux * stretch / fastest)


@pytest.mark.parametrize("law", LAWS)
def test_the_table_holds_the_flux(law):
    table = a_flux(law, 0.2, 0.6, 1.0)
    per_step = float(table.flux[1] / table.fraction[1]) / speed(table.fraction[1], LAWS[law])
    fraction = np.asarray(table.fraction)
    exact = [x * speed(x, LAWS[law]) * per_step for x in fraction[1:-1]]
    np.testing.assert_allclose(table.flux[1:-1], exact, rtol=EXACT)
    assert table.fraction[0] == table.flux[0] == table.flux[-1] == 0.0
    assert float(table.initial) == near(0.2, rel=EXACT)
    assert float(table.densest) == near(0.6, rel=EXACT)


@pytest.mark.parametrize("law", LAWS)
def test_no_steeper_is_the_largest_below(law):
    table = a_flux(law, 0.3, 0.6, 1.0)
    found = kynch.slope_limited(table, jnp.asarray(1.0))
    fraction, flux = (np.asarray(column) for column in table)
    apart = np.abs(fraction[:, None] - fraction[None, :])
    np.testing.assert_allclose(found.flux, (flux[None, :] + apart).min(axis=1), rtol=0, atol=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_the_flux_between_cells_is_the_extreme_of_all_between(law):
    table = kynch.slope_limited(a_flux(law, 0.2, 0.6, 0.9), jnp.asarray(1.0))
    random = np.random.default_rng(3)
    at = np.concatenate([random.uniform(0, 0.6, 40), random.choice(table.fraction, 20)])
    at = np.concatenate([at, [0.0, 0.6, 0.0, 0.6, 0.2, 0.2, 0.6], at[:3] + 1e-4])
    found = downwards(table, jnp.asarray(at))
    nodes, flux = (np.asarray(column) for column in table)
    for low, high, between in zip(at[:-1], at[1:], found, strict=True):
        inside = nodes[(nodes > min(low, high)) & (nodes < max(low, high))]
        values = np.interp(np.concatenate([[low, high], inside]), nodes, flux)
        exact = values.min() if low >= high else values.max()
        assert float(between) == pytest.approx(exact, rel=EXACT, abs=1e-15)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("stretch", [0.3, 1.0, 30.0])
def test_order_is_kept_and_variation_lost(law, stretch):
    """A monotone scheme (Crandall & Majda 1980), also at steps that are too long to be right."""
    flux = kynch.slope_limited(a_flux(law, 0.2, 0.6, stretch), jnp.asarray(1.0))

    def stepped(fraction):
        return fraction + np.diff(np.pad(downwards(flux, fraction), 1))

    def variation(fraction):  # between the floor, which is full, and clear fluid
        return np.abs(np.diff(np.concatenate([[0.6], fraction, [0.0]]))).sum()

    random = np.random.default_rng(4)
    less = 0.6 * random.uniform(0, 1, 60) ** random.choice([0.3, 1.0, 4.0])
    more = less + (0.6 - less) * random.choice([0.0, 1.0, 0.01, 0.5], 60)
    total, mass = variation(less), less.sum()
    for _ in range(60):
        less, more = stepped(less), stepped(more)
        # The table's 512 intervals multiply the rounding of a place in it.
        assert (less - more).max() < 1e-13
        assert variation(less) <= total + 1e-12
        total = variation(less)
        assert less.min() > -1e-14 and more.max() < 0.6 + 1e-14
        assert less.sum() == near(mass, rel=EXACT)
    assert total < 0.9 * variation(0.6 * random.uniform(0, 1, 60))  # it had something to lose


@pytest.mark.parametrize("law", LAWS)
def test_lines_through_the_cells_make_no_new_extremes(law):
    """Each half of a cell is one of twice the step to its own face, and a step of Heun is the mean
    of such (Shu & Osher 1988): between the extremes, and no more variation, for steps of any length
    as f~ is no steeper than half a cell in a step.
    """
    flux = kynch.prepare_godunov(kynch.slope_limited(a_flux(law, 0.2, 0.6, 30.0), jnp.asarray(0.5)))
    faces = jax.jit(scheme._limited_flux)

    def euler(fraction):
        return fraction + np.diff(np.pad(faces(flux, fraction, jnp.asarray(0.6)), 1))

    def variation(fraction):
        return np.abs(np.diff(np.concatenate([[0.6], fraction, [0.0]]))).sum()

    random = np.random.default_rng(4)
    fraction = 0.6 * random.uniform(0, 1, 60) ** random.choice([0.3, 1.0, 4.0])
    total = first = variation(fraction)
    for _ in range(60):
        fraction = 0.5 * (fraction + euler(euler(fraction)))
        assert fraction.min() > -1e-14 and fraction.max() < 0.6 + 1e-14
        assert variation(fraction) <= total + 1e-12
        total = variation(fraction)
    assert total < 0.9 * first  # it had something to lose


@pytest.mark.parametrize("law", ["one speed", "cap", "wavy"])
def test_solid_is_kept_and_never_more_than_a_bed(law):
    random = np.random.default_rng(5)
    needed = []
    for initial, densest in ((1e-6, 0.6), (0.5, 0.51), (0.599, 0.6), (0.2, 0.99)):
        given = dict(
            height=HEIGHT, volume_fraction=initial, bed_fraction=densest,
            times=np.sort(random.uniform(0, 1e5, 5)), hindrance=LAWS[law], cells=20,
        )  # fmt: skip
        needed.append(column_steps(spheres(), **given))
        settled = column(spheres(), **given, steps=25000)
        np.testing.assert_allclose(solid(settled), initial * HEIGHT, rtol=EXACT)
        profile = np.asarray(settled.volume_fraction)
        assert profile.min() > -1e-14 and profile.max() < densest + 1e-14
        assert (np.diff(settled.mudline) < 1e-12 * HEIGHT).all()
        assert (settled.bed_front <= settled.mudline).all()
    assert 100 < max(needed) < 25000


# --- gradients ----------------------------------------------------------------------------------

SETTLING = dict(height=HEIGHT, volume_fraction=0.2, bed_fraction=0.62)
TIMES = np.array([0.15, 0.9, 1.7, 2.2, 3.5]) * HEIGHT / SPEED
STEPS = 400


def lines(theta, **given):
    """Mudline and bed front for factors on what is named, with a law that bends them; (2, T)."""
    theta = dict(theta)
    case = {name: value * theta.pop(name, 1.0) for name, value in SETTLING.items()}
    case |= dict(times=TIMES * theta.pop("times", 1.0), cells=60, steps=STEPS) | given
    law = zaki(EXPONENT * theta.pop("exponent", 1.0))
    changed = {name: getattr(spheres(), name) * factor for name, factor in theta.items()}
    settled = column(spheres().replace(**changed), hindrance=law, **case)
    return jnp.stack([settled.mudline, settled.bed_front]) / HEIGHT


NAMES = ["f_v", "f_s", "viscosity", "times", "radius", "particle_density"]
NAMES += ["exponent", "height", "volume_fraction", "bed_fraction"]


@jax.jit
def by_name(theta):
    """The lines for factors on all that is named; (2, T)."""
    return lines(dict(zip(NAMES, theta, strict=True)))


@pytest.fixture(scope="module")
def slopes():
    """Derivatives of the lines by the logarithms of the factors, {name: (2, T)}."""
    found = jax.jit(jax.jacfwd(by_name))(jnp.ones(len(NAMES)))
    return dict(zip(NAMES, np.moveaxis(np.asarray(found), -1, 0), strict=True))


@pytest.mark.parametrize("name", ["f_s", "f_v", "viscosity"])
def test_a_factor_of_the_drag_is_a_factor_of_time(name, slopes):
    """h depends on t / (f_s f_v mu) alone: dh/dln f = -t dh/dt, and steps scale with it all."""
    found = slopes[name]
    np.testing.assert_allclose(found, -slopes["times"], rtol=1e-9, atol=1e-9)
    # The first line descends at v_0.
    gone = TIMES[0] * speed(0.2, zaki()) / HEIGHT
    assert float(found[0, 0]) == near(gone, rel=1e-9)
    assert float(found[0, -1]) == pytest.approx(0.0, abs=1e-9)  # at rest
    assert np.abs(found[:, 1:3]).min() > 1e-3  # not only there


def test_the_slope_by_a_factor_is_that_of_the_mudline(slopes):
    """-t dh/dt with dh/dt between neighbouring times, of which each is looked at exactly."""
    time = TIMES[0]
    spread = np.sort(np.append(TIMES[2:], time * np.array([0.99, 1.01])))
    around = lines({}, times=spread)[0, :2]
    rate = float(around[1] - around[0]) / (0.02 * time)
    assert float(slopes["f_v"][0, 0]) == near(-time * rate, rel=1e-8)


def test_gradients_forward_backward_and_by_differences(slopes):
    weights = np.random.default_rng(6).uniform(0.5, 1.5, (2, 5))

    def one(theta):
        return jnp.sum(weights * by_name(theta))

    start = jnp.ones(len(NAMES))
    backward = jax.jit(jax.grad(one))(start)
    for number, name in enumerate(NAMES):
        forward = (weights * slopes[name]).sum()
        # Sums in another order.
        assert float(backward[number]) == pytest.approx(forward, rel=1e-9, abs=1e-11), name
        step = 1e-7 * jnp.zeros(len(NAMES)).at[number].set(1.0)
        central = float(one(start + step) - one(start - step)) / 2e-7
        # Rounding, 1e-14 / 1e-7, and kinks that a step may pass.
        assert forward == pytest.approx(central, rel=1e-5, abs=1e-6), name
        assert abs(central) > 1e-2, name


def test_at_rest_the_height_follows_the_bed(slopes):
    """H phi_0 / phi_m: logarithmic derivatives of 1, 1 and -1, and none by the particles."""
    for name, exact in dict(height=1, volume_fraction=1, bed_fraction=-1, radius=0).items():
        assert slopes[name][0, -1] == pytest.approx(exact * 0.2 / 0.62, abs=1e-9), name


def test_many_at_once_and_in_single_precision():
    factors = jnp.asarray([0.9, 1.0, 1.3])
    together = jax.jit(jax.vmap(lambda factor: lines({"f_v": factor})))(factors)
    for factor, line in zip(factors, together, strict=True):
        np.testing.assert_allclose(line, lines({"f_v": factor}), rtol=1e-11, atol=1e-13)
    assert float(together[0, 0, 1]) < 0.9 * float(together[2, 0, 1])
    single = column(
        spheres().astype(jnp.float32), times=TIMES, hindrance=zaki(), cells=60, steps=STEPS,
        **SETTLING,
    )  # fmt: skip
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(single))
    # Some hundred steps of rounding of 6e-8.
    np.testing.assert_allclose(single.mudline / HEIGHT, lines({})[0], atol=2e-5)
    np.testing.assert_allclose(solid(single), 0.2 * HEIGHT, rtol=2e-5)


# --- use ----------------------------------------------------------------------------------------


def test_a_tube_of_ten_centimetres_for_thirty_days(case):
    times = np.linspace(0.0, 30.0, 31) * DAY
    law = Partial(drag.son2018)
    settled = column(
        case.parameters(), height=0.1, volume_fraction=case.coated_volume_fraction,
        bed_fraction=0.6, times=times, hindrance=law,
    )  # fmt: skip
    falls = float(settled.mudline[0] - settled.mudline[1]) / DAY
    felt = case.parameters().replace(f_w=law(jnp.asarray(case.coated_volume_fraction)))
    rest = 0.1 * case.coated_volume_fraction / 0.6
    assert falls == near(min(float(mrjax.terminal_velocity(felt)), (0.1 - rest) / DAY), rel=1e-6)
    assert (np.diff(settled.mudline) < 1e-15).all()
    assert float(settled.mudline[-1]) == near(rest, rel=1e-6)


def test_a_plain_function_is_a_closure_too_and_times_may_be_a_list():
    bound, plain = (
        column(spheres(), times=list(TIMES), hindrance=law, cells=60, steps=STEPS, **SETTLING)
        for law in (Partial(drag.richardson_zaki), drag.richardson_zaki)
    )
    np.testing.assert_array_equal(bound.mudline, plain.mudline)


# --- faults -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_too_few_steps():
    fewest = column_steps(spheres(), times=TIMES, hindrance=zaki(), cells=60, **SETTLING)
    assert fewest < STEPS
    with pytest.raises(mrjax.InputError, match="give at least") as refusal:
        lines({}, steps=int(0.8 * fewest))
    least = int(str(refusal.value).split("at least ")[1].split(",")[0])
    assert int(0.8 * fewest) < least <= fewest
    assert np.isfinite(lines({}, steps=least)).all()
    with pytest.raises(mrjax.InputError, match="give at least"):
        lines({}, steps=least - 1)
    traced = jax.jit(lambda factor: lines({"f_v": factor}, steps=least))
    assert np.isfinite(traced(1.0)).all()
    assert np.isnan(traced(0.98)).all()
    assert np.isnan(jax.grad(lambda factor: jnp.sum(traced(factor)))(0.98))


def test_traced_steps_must_be_given():
    with pytest.raises(mrjax.InputError, match="column_steps") as refusal:
        jax.jit(lambda factor: lines({"f_v": factor}, steps=None))(1.0)
    assert "\n" not in str(refusal.value)
    with pytest.raises(mrjax.InputError, match="column_steps"):
        jax.vmap(lambda height: lines({"height": height}, steps=None))(jnp.ones(2))
    # A derivative has a value to choose by.
    slope = jax.grad(lambda factor: lines({"f_v": factor}, steps=None)[0, 0])(1.0)
    assert float(slope) == near(TIMES[0] * speed(0.2, zaki()) / HEIGHT, rel=1e-9)


@pytest.mark.parametrize(
    "name, value",
    [("volume_fraction", 3.5), ("volume_fraction", -1.0), ("bed_fraction", 2.0), ("height", -1.0),
     ("times", -1.0)],
)  # fmt: skip
def test_what_cannot_be_is_not_a_number_where_traced(name, value):
    traced = jax.jit(lambda factor: lines({name: factor}, steps=20000 if name == "f_v" else STEPS))
    assert np.isnan(traced(value)).all()
    with pytest.raises(mrjax.InputError):
        lines({name: value})


@pytest.mark.parametrize(
    "wrong, message",
    [
        (dict(height=0.0), r"height = 0 must be above 0, in m"),
        (dict(height=[0.1, 0.2]), r"height = .*: give one number, in m"),
        (dict(height="tall"), r"height = 'tall': give one number"),
        (dict(volume_fraction=0.62), r"volume_fraction = 0.62 must be above 0 and below 0.62"),
        (dict(volume_fraction=np.nan), r"volume_fraction = nan must be above 0"),
        (dict(bed_fraction=1.0), r"bed_fraction = 1 must be above 0 and below 1"),
        (dict(times=[]), r"times have shape \(0,\); give one row"),
        (dict(times=5.0), r"times have shape \(\); give one row"),
        (dict(times=[0.0]), r"times = \[0\].*give a later last time"),
        (dict(times=[-1.0, 2.0]), r"times\[0\] = -1 must be at least 0"),
        (dict(times=[1.0, np.nan]), r"times\[1\] = nan must be at least 0 and finite"),
        (dict(times=[1.0, 2.0, 2.0]), r"times\[2\] = 2 s is not after 2 s; give increasing"),
        (
            dict(cells=10**6, times=[1e30], hindrance=zaki(40.0)),
            r"steps, more than 100000000; give an earlier last time",
        ),
        (dict(cells=0), r"cells = 0 must be a whole number"),
        (dict(steps=0.5), r"steps = 0.5 must be a whole number"),
        (dict(hindrance=drag.haberman_sayre), r"at a volume fraction of 0\.\d+ the particles would"
         r" settle at -.* m/s; give a hindrance that holds up to bed_fraction = 0.62"),
        (dict(parameters=spheres(f_v=0.0)), r"f_v = 0.0 must be above 0"),
        (dict(parameters=spheres(radius=np.ones(2))), r"parameters are those of \(2,\)"),
        (dict(compression=Compression(gel_fraction=0.62, stress=1.0, exponent=2.0)),
         r"gel_fraction = 0.62 must be above 0 and below 0.62, bed_fraction"),
        (dict(compression=Compression(gel_fraction=0.3, stress=-1.0, exponent=2.0)),
         r"stress = -1 must be above 0, in Pa"),
    ],
)  # fmt: skip
def test_refused_in_one_line(wrong, message):
    given = dict(parameters=spheres(), times=TIMES, **SETTLING) | wrong
    with pytest.raises(mrjax.InputError, match=message) as refusal:
        column(given.pop("parameters"), **given)
    assert "\n" not in str(refusal.value)
