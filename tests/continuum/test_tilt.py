"""A tilted tube: the rate of Ponder, Nakamura and Kuroda, exact curves, and gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial
from scipy.integrate import solve_ivp

import mrjax
from mrjax.continuum import characteristics, kynch, tilt
from mrjax.laws import drag

HEIGHT, GAP, ANGLE, BED = 0.1, 0.1 / 7, 5.0, 0.6
PARAMETERS = mrjax.Recipe.load("case2").parameters().replace(f_w=1.0, f_s=1.0).astype(float)
ALONE = float(mrjax.terminal_velocity(PARAMETERS))
ZAKI = Partial(drag.richardson_zaki, exponent=4.65)
STRONG = Partial(drag.richardson_zaki, exponent=8.0)
COMPRESSION = mrjax.Compression(gel_fraction=0.3, stress=20.0, exponent=3.0)


def settled(times, *, initial=0.2, leaning=None, factor=1.0, **options):
    return mrjax.column(
        PARAMETERS.replace(f_s=factor), height=HEIGHT, volume_fraction=initial, bed_fraction=BED,
        times=times, tilt=leaning, **options,
    )  # fmt: skip


def leaning(angle=ANGLE, gap=GAP):
    return mrjax.Tilt(angle=angle, gap=gap)


def test_a_tilt_of_one_two_and_five_degrees_is_faster_by_12_24_and_61_percent():
    rates = [float(leaning(angle).rate(7 * GAP)) for angle in (0.0, 1.0, 2.0, 5.0)]
    np.testing.assert_allclose(rates, [1.0, 1.122, 1.244, 1.606], atol=5e-4)
    assert tilt.gap_of_round_tube(0.02) == pytest.approx(np.pi * 0.01**2 / 0.02)


def test_a_straight_mudline_becomes_that_of_its_differential_equations():
    """Mudline and bed of particles of one velocity, to the tolerance of the ODE."""
    initial, radians = 0.2, np.deg2rad(ANGLE)
    table = kynch.table(PARAMETERS, None, jnp.asarray(initial), jnp.asarray(BED))
    growth = initial / (BED - initial)

    def slopes(_, fronts):
        rate = np.cos(radians) + (fronts[0] - fronts[1]) / GAP * np.sin(radians)
        return [-ALONE * rate, ALONE * growth * rate]

    def met(_, fronts):
        return fronts[0] - fronts[1]

    met.terminal = True
    times = np.linspace(0.05, 1.0, 20) * HEIGHT / ALONE
    exact = solve_ivp(slopes, [0, times[-1]], [HEIGHT, 0.0], t_eval=times, events=met,
                      rtol=1e-12, atol=1e-15)  # fmt: skip
    upright = characteristics.tilted_times(table, jnp.asarray(HEIGHT), times, leaning())
    found = characteristics.mudline(table, jnp.asarray(HEIGHT), upright)
    fallen = exact.t.size
    assert 5 < fallen < 15
    np.testing.assert_allclose(found[:fallen], exact.y[0], rtol=1e-9)
    np.testing.assert_allclose(found[fallen:], HEIGHT * initial / BED, rtol=1e-12)


def test_a_bent_mudline_falls_by_the_rate_of_the_length_of_its_suspension():
    """dh/dt over the slope of the upright curve at the same height, in the fan and before it."""
    height = jnp.asarray(HEIGHT)
    times = jnp.linspace(0.02, 1.5, 60) * HEIGHT / ALONE * (1.0 - 0.35) ** -4.65

    @jax.jit
    def followed(times):
        table = kynch.table(PARAMETERS, ZAKI, jnp.asarray(0.35), jnp.asarray(0.75))
        kinks = [f(table, height) for f in (characteristics.bend_time, characteristics.rest_time)]
        at, rate = jax.jvp(
            lambda times: characteristics.tilted_times(table, height, times, leaning()),
            (times,),
            (jnp.ones_like(times),),
        )
        mudline = characteristics.mudline(table, height, at)
        return at, rate, mudline, characteristics.bed_front(table, height, at), *kinks

    at, rate, mudline, bed, bend, rest = followed(times)
    length = mudline - bed
    assert times[0] < bend < times[-1] and 1.5 * bend < rest
    # The rate is linear between nodes: within 1e-4, and exact at a node.
    np.testing.assert_allclose(rate, leaning().rate(length), rtol=2e-4)
    assert (np.diff(at) > 0.0).all() and float(length[-1]) < 1e-12 < float(length[-20])


def test_an_upright_tube_is_one_without_a_tilt():
    times = np.linspace(0.1, 2.0, 8) * HEIGHT / ALONE
    plain = settled(times, cells=50, hindrance=ZAKI)
    upright = settled(times, leaning=leaning(0.0), cells=50, hindrance=ZAKI)
    np.testing.assert_allclose(upright.mudline, plain.mudline, rtol=1e-9)
    # The scheme has the times of the characteristics.
    tilted = settled(times, leaning=leaning(), cells=50, hindrance=ZAKI)
    table = kynch.table(PARAMETERS, ZAKI, jnp.asarray(0.2), jnp.asarray(BED))
    at = characteristics.tilted_times(table, jnp.asarray(HEIGHT), times, leaning())
    exact = characteristics.mudline(table, jnp.asarray(HEIGHT), at)
    np.testing.assert_allclose(tilted.mudline, exact, atol=5e-3 * HEIGHT)
    assert (np.abs(tilted.mudline - plain.mudline) > 0.02 * HEIGHT).any()
    faster = float(tilted.settling_velocity[0, 25] / plain.settling_velocity[0, 25])
    length = float(tilted.mudline[0] - tilted.bed_front[0])
    assert faster == pytest.approx(float(leaning().rate(length)), rel=1e-6)


def test_a_yielding_bed_consolidates_no_faster_in_a_tilted_tube():
    """The suspension settles sooner; from then on the clock runs at the cosine of the angle."""
    fall = HEIGHT / ALONE
    times = np.append(np.linspace(0.3, 1.5, 4), np.linspace(4.0, 7.0, 9)) * fall
    options = {"hindrance": STRONG, "compression": COMPRESSION, "cells": 50}
    plain, faster = settled(times, **options), settled(times, leaning=leaning(), **options)
    assert float(faster.mudline[0]) < float(plain.mudline[0]) - 0.02 * HEIGHT
    # Times of the upright bed at the heights of the tilted one.
    heights = np.asarray(faster.mudline[4:])
    assert heights[0] - heights[-1] > 0.01 * HEIGHT
    fine = np.linspace(1.0, 9.0, 300) * fall
    curve = np.asarray(settled(fine, **options).mudline)
    upright = np.interp(-heights, -curve, fine)
    slope = np.diff(upright) / np.diff(times[4:])
    np.testing.assert_allclose(slope, np.cos(np.deg2rad(ANGLE)), atol=0.01)


def classes(leaning, cells=50):
    powder = mrjax.Recipe.load("case2").replace(
        particle={"diameter": [3e-6, 5e-6]}, drag={"f_w": "richardson-zaki", "local": True}
    ).size_classes(2)  # fmt: skip
    times = (
        np.linspace(0.1, 1.5, 6)
        * HEIGHT
        / float(np.min(mrjax.terminal_velocity(powder.parameters)))
    )
    return times, mrjax.polydisperse_column(
        powder.parameters, height=HEIGHT, volume_fraction=powder.volume_fraction, bed_fraction=0.6,
        times=times, hindrance=ZAKI, tilt=leaning, cells=cells,
    )  # fmt: skip


def test_classes_settle_faster_and_to_the_same_bed():
    times, plain = classes(None)
    _, upright = classes(leaning(0.0))
    np.testing.assert_allclose(upright.mudline, plain.mudline, atol=2e-3 * HEIGHT)
    _, faster = classes(leaning())
    np.testing.assert_array_equal(faster.times, times)
    first = (HEIGHT - np.asarray(faster.mudline[0])) / (HEIGHT - np.asarray(plain.mudline[0]))
    rate = leaning().rate(np.array([HEIGHT, float(faster.mudline[0] - faster.bed_front[0])]))
    assert float(rate[1]) < first < float(rate[0])
    fastest = np.max(faster.settling_velocity[0]) / np.max(plain.settling_velocity[0])
    assert fastest == pytest.approx(float(rate[1]), rel=0.02)
    assert float(faster.mudline[-1]) == pytest.approx(float(plain.mudline[-1]), rel=5e-3)


def by_characteristics(theta):
    """Mudline over the height in a rigid bed; theta is tilt, gap and a factor on drag."""
    parameters = PARAMETERS.replace(f_s=theta[2])
    table = kynch.table(parameters, ZAKI, jnp.asarray(0.2), jnp.asarray(BED))
    times = jnp.array([0.4, 0.8, 1.5, 2.5, 5.0]) * HEIGHT / ALONE
    height = jnp.asarray(HEIGHT)
    at = characteristics.tilted_times(table, height, times, leaning(theta[0], theta[1]))
    return characteristics.mudline(table, height, at) / HEIGHT


def by_yielding_bed(theta):
    times = np.array([0.4, 0.8, 4.0]) * HEIGHT / ALONE
    at = {"leaning": leaning(theta[0], theta[1]), "factor": theta[2]}
    options = {"hindrance": STRONG, "compression": COMPRESSION, "cells": 30, "steps": 60}
    return settled(times, **at, **options).mudline / HEIGHT


@pytest.mark.parametrize("heights", [by_characteristics, by_yielding_bed])
def test_derivatives_are_those_of_central_differences(heights):
    """By tilt, gap and drag, in the straight part, the bent part and the bed."""
    at = jnp.array([ANGLE, GAP, 1.0])
    slope = jax.jit(lambda theta, unit: jax.jvp(heights, (theta,), (unit,)))
    for number, value in enumerate(at):
        unit = value * jnp.zeros(3).at[number].set(1.0)
        step = 1e-5 * unit
        exact = slope(at, unit)[1]
        central = (slope(at + step, unit)[0] - slope(at - step, unit)[0]) / 2e-5
        np.testing.assert_allclose(exact, central, rtol=1e-5, atol=1e-7)
        assert abs(float(exact[0])) > 1e-2


def test_a_tilt_can_be_zero_in_a_derivative():
    def heights(angle):
        return by_characteristics(jnp.stack([angle, jnp.asarray(GAP), jnp.asarray(1.0)]))

    slope = jax.jit(lambda angle: jax.jvp(heights, (angle,), (jnp.ones(()),)))
    (level, exact), (above, _) = slope(jnp.asarray(0.0)), slope(jnp.asarray(1e-4))
    np.testing.assert_allclose(exact, (above - level) / 1e-4, rtol=1e-3, atol=1e-9)
    assert float(exact[0]) < -1e-3


@pytest.mark.parametrize(
    "angle, gap, words",
    [
        (90.0, GAP, r"tilt.angle = 90.0: give one number, from 0 to below 90"),
        (-1.0, GAP, r"tilt.angle = -1.0"),
        (ANGLE, 0.0, r"tilt.gap = 0 must be above 0"),
        ([1.0, 2.0], GAP, r"tilt.angle = \[1.0, 2.0\]: give one number"),
    ],
)
def test_a_tilt_that_is_none_is_refused_in_one_line(angle, gap, words):
    with pytest.raises(mrjax.InputError, match=words) as refusal:
        settled([1e3], leaning=leaning(angle, gap))
    assert "\n" not in str(refusal.value)


def test_a_traced_tilt_that_is_none_gives_no_numbers():
    run = jax.jit(lambda angle: settled([1e3], leaning=leaning(angle), cells=10, steps=20).mudline)
    assert np.isfinite(run(5.0)).all() and np.isnan(run(-5.0)).all()


def test_a_tall_narrow_tube_is_warned_of():
    assert tilt.warning(0.05, 0.01) is None
    words = tilt.warning(7 * GAP, GAP)
    assert "12 % at 1, 24 % at 2, 61 % at 5 degrees" in words
