"""How long a step may be: Son 2018, Eqs. 26, 28 and 29, and the stability of a contact."""

import re
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import mrjax
from mrjax.dem import integrator
from mrjax.laws import drag, normal, particle, time_scales
from tests.builders.particles import unit_spheres

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
DRY = dict(fluid_density=0.0, viscosity=0.0, gravity=0.0)


def test_rayleigh_times(case):
    # Iron, and the guar coating of 3120 MPa, where the paper's table prints GPa.
    expected = {"case1": 2.064e-9, "case2": 2.064e-9, "case3": 16.26e-9}[case.name]
    parameters = case.parameters()
    assert time_scales.rayleigh_time(parameters) == near(expected, rel=3e-4)  # as printed
    # The least of all particles.
    mixed = parameters.replace(radius=parameters.radius * jnp.array([3.0, 1.0, 2.0]))
    least = float(time_scales.rayleigh_time(parameters))
    assert time_scales.rayleigh_time(mixed) == near(least, rel=EXACT)


def test_rayleigh_time_by_hand():
    # G = 2.5 / 2.5 = 1 and rho = 4: pi * 3 * 2 / (0.1631 * 0.25 + 0.8766).
    parameters = mrjax.Parameters(
        radius=3.0, particle_density=4.0, elastic_modulus=2.5, poisson_ratio=0.25, **DRY
    ).astype(float)
    assert time_scales.rayleigh_time(parameters) == near(6 * np.pi / 0.917375, rel=EXACT)


def test_rise_times(case):
    # Case 2 with the f_w that the paper prints. To the digits given.
    f_w, expected = {"case1": (1.0, 3.06e-6), "case2": (48.49, 61.0e-9), "case3": (48.99, 34.4e-9)}[
        case.name
    ]
    parameters = case.parameters().replace(f_w=jnp.asarray(f_w))
    assert time_scales.rise_time(parameters) == near(expected, rel=1.7e-3)
    # 99 % of the way: exp(-alpha t_r) = 0.01.
    decay = time_scales.rise_time(parameters) / time_scales.relaxation_time(parameters)
    assert jnp.exp(-decay) == near(0.01, rel=EXACT)


def test_the_step_is_the_shorter_time_over_the_refinement(case3):
    parameters = case3.parameters()
    rayleigh, rise = time_scales.rayleigh_time(parameters), time_scales.rise_time(parameters)
    assert rayleigh < rise
    assert mrjax.time_step(parameters) == near(float(rayleigh) / 20, rel=EXACT)
    assert mrjax.time_step(parameters, 16.3) == near(1.0e-9, rel=5e-3)  # Table 2
    soft = parameters.replace(elastic_modulus=jnp.asarray(3e6))
    assert mrjax.time_step(soft) == near(float(rise) / 20, rel=EXACT)


@pytest.mark.parametrize("leaves", [float, None])
def test_without_drag_contact_alone_decides(leaves):
    """Also for parameters that are plain numbers."""
    dry = mrjax.Parameters(
        radius=1e-3, particle_density=2500.0, elastic_modulus=1e9, poisson_ratio=0.25, **DRY
    )
    dry = dry.astype(leaves) if leaves else dry
    assert time_scales.relaxation_time(dry) == jnp.inf
    assert time_scales.rise_time(dry) == jnp.inf
    assert mrjax.time_step(dry) == time_scales.rayleigh_time(dry) / 20 < 1.0


def test_expected_overlap():
    parameters = mrjax.Parameters(
        radius=1e-3, particle_density=2500.0, elastic_modulus=1e7, poisson_ratio=0.0, **DRY
    ).astype(float)
    mass = float(particle.mass(parameters))
    # On a rigid wall E* = E and R* = R: 4/3 E* sqrt(R*) d^1.5 carries the load.
    resting = float(time_scales.expected_overlap(parameters, 0.01, 0.0))
    assert 4 / 3 * 1e7 * np.sqrt(1e-3) * resting**1.5 == near(0.01, rel=EXACT)
    impact = normal.impact_overlap(1e7, 1e-3, mass, 2.0)
    assert time_scales.expected_overlap(parameters, 0.0, 2.0) == near(float(impact))
    assert impact > resting
    assert time_scales.expected_overlap(parameters, 0.01, 2.0) == near(float(impact))
    assert time_scales.largest_stable_step(parameters, 0.0) == jnp.inf


# --- stability of a resting contact -----------------------------------------------------------

REGIMES = {"undamped": 0.0, "inertial": 1e-3, "intermediate": 2.0, "overdamped": 1e3}


def resting(damping):
    """A particle on a spring of 1 N/m, of 1 kg, with a drag coefficient; and the overlap there."""
    parameters = unit_spheres(
        viscosity=damping / (6 * np.pi), elastic_modulus=1.0, poisson_ratio=0.0
    )
    return parameters, 0.25  # 2 E* sqrt(R* d) = 1


def stability_limit(damping):
    """Of dt K/gamma tanh(alpha dt / 2) = 2 with K = m = 1."""
    if damping == 0.0:
        return 2.0
    return brentq(lambda dt: dt / damping * np.tanh(damping * dt / 2) - 2, 1e-3, 1e5, rtol=1e-12)


ONE = time_scales.Mode(1.0, 0.0, 0.0)


@pytest.mark.parametrize("regime", REGIMES)
def test_the_limit_is_where_the_leapfrog_becomes_unstable(regime):
    parameters, _ = resting(REGIMES[regime])
    assert particle.inertia(parameters) == near(1.0, rel=EXACT)
    assert drag.coefficient(parameters) == near(REGIMES[regime], rel=EXACT)
    for fraction, stable in ((0.995, True), (1.005, False)):
        step = fraction * stability_limit(REGIMES[regime])
        kick = integrator.kick(parameters, step)
        plain = integrator.Kick(float(kick.keep), float(kick.gain))
        half_way, velocity = np.ones((3, 1)), np.zeros((3, 1))
        for _ in range(2000):
            half_way, velocity, _ = integrator.step(
                half_way,
                velocity,
                lambda half_way, _, plain=plain: (plain.keep, -plain.gain * half_way, None),
                step,
            )
        # An undamped orbit below the limit is an ellipse, 1/sqrt(1 - 0.995^2) = 10 long.
        assert (np.abs(half_way) < 30).all() == stable


def test_the_largest_step_keeps_within_the_limit():
    for damping in (0.0, *np.geomspace(1e-4, 1e4, 33)):
        parameters, overlap = resting(damping)
        largest = float(time_scales.largest_stable_step(parameters, overlap, arrangement=(ONE,)))
        exact = stability_limit(damping)
        # max(2 sqrt(m/K), 2 gamma/K), at worst where both are equal: 2 of 2.4.
        assert 0.83 * exact < largest <= exact * (1 + 1e-12)
    stiffer = time_scales.largest_stable_step(
        *resting(0.0), arrangement=(time_scales.Mode(4.0, 0.0, 0.0),)
    )
    assert stiffer == near(1.0, rel=EXACT)


# --- what `simulate` makes of it ----------------------------------------------------------------

BOX = mrjax.Box((6e-3, 6e-3, 6e-3))
PARTICLE = dict(radius=1e-3, particle_density=2500.0, elastic_modulus=1e7, poisson_ratio=0.25)
DRY_FALL = mrjax.Parameters(**PARTICLE, fluid_density=0.0, viscosity=0.0).astype(float)
OVERDAMPED = mrjax.Parameters(**PARTICLE, fluid_density=1000.0, viscosity=1e3).astype(float)


def settled(parameters):
    modulus = normal.effective_modulus(1e7, 0.25, jnp.inf, 0.0)
    weight = particle.net_weight(parameters)
    overlap = float((3 * weight / (4 * modulus * jnp.sqrt(1e-3))) ** (2 / 3))
    return mrjax.place([[3e-3, 3e-3, 1e-3 - overlap]])


ABOUT_TO_HIT = mrjax.place([[3e-3, 3e-3, 1.01e-3]], [[0.0, 0.0, -0.3]])


def largest_named(state, parameters, duration):
    with pytest.raises(mrjax.InputError, match="is unstable") as refusal:
        mrjax.simulate(state, parameters, BOX, duration=duration, time_step=duration)
    return float(re.search(r"largest that would do is (\S+) s", str(refusal.value)).group(1))


def softer(factor):
    return DRY_FALL.replace(elastic_modulus=DRY_FALL.elastic_modulus * factor)


@pytest.mark.parametrize(
    "state, parameters, duration",
    [
        (settled(DRY_FALL), DRY_FALL, 0.05),
        (settled(OVERDAMPED), OVERDAMPED, 10.0),
        (ABOUT_TO_HIT, DRY_FALL, 0.05),
        # Some of these numbers round up where the message gives three digits.
        *((ABOUT_TO_HIT, softer(factor), 0.05) for factor in (0.75, 0.8, 0.85, 0.9)),
    ],
)
def test_an_unstable_step_is_refused_and_the_named_one_holds(state, parameters, duration):
    named = largest_named(state, parameters, duration)
    run = mrjax.simulate(state, parameters, BOX, duration=duration, time_step=named)
    assert run.steps > 100
    # A dry bounce keeps within its energy, and nothing rests deeper than it would without a step.
    fall = np.sqrt(float(jnp.max(state.velocity**2)) + 2 * 9.81 * 1e-5)
    assert jnp.abs(run.state.velocity).max() < 1.1 * fall
    mass = float(particle.mass(parameters))
    deepest = time_scales.expected_overlap(parameters, 2.5 * mass * 9.81, 1.1 * fall)
    assert 0 < run.deepest_overlap * 1e-3 < deepest


def test_the_refused_step_depends_on_how_hard_particles_meet():
    weightless = DRY_FALL.replace(gravity=jnp.asarray(0.0))
    slow, fast = (
        largest_named(mrjax.place([[3e-3, 3e-3, 1.01e-3]], [[0.0, 0.0, -speed]]), weightless, 1.0)
        for speed in (0.1, 1.0)
    )
    # d ~ v^(4/5), K ~ sqrt(d), dt ~ 1 / sqrt(K): 10^(-1/5), both to three digits.
    assert fast / slow == near(10**-0.2, rel=1e-2)


def test_a_fall_without_contact_takes_any_step():
    """At 3 um/s, 200 s do not close a gap of 2 mm; where there is a contact, 7 ms is the most."""
    state = mrjax.place([[3e-3, 3e-3, 3e-3]])
    run = mrjax.simulate(state, OVERDAMPED, BOX, duration=200.0, time_step=50.0)
    assert run.steps == 4
    assert run.time_step > 1e3 * time_scales.largest_stable_step(OVERDAMPED, 1e-6)
    fallen = 3e-3 - float(run.state.position[0, 2])
    # All but the first instant, 4 us of relaxation, and half of one step by the leapfrog's start.
    final = float(mrjax.terminal_velocity(OVERDAMPED))
    assert fallen == near((200.0 - 25.0) * final, rel=1e-6)


def test_two_far_apart_take_any_step():
    state = mrjax.place([[1.5e-3, 3e-3, 3e-3], [4.5e-3, 3e-3, 3e-3]])
    run = mrjax.simulate(state, OVERDAMPED, BOX, duration=60.0, time_step=30.0)
    assert run.steps == 2
    assert run.deepest_overlap == 0.0


def test_tables_and_values_for_each_particle_count_in_the_stable_step():
    """Pair by pair; what the table says of walls on walls does not."""
    damped = DRY_FALL.replace(elastic_modulus=DRY_FALL.elastic_modulus * jnp.array([1.0, 4.0]))
    table = jnp.array([[0.9, 0.3], [0.3, 0.01]])
    of_table, of_worst, of_mild = (
        float(time_scales.largest_stable_step(damped.replace(restitution=e), 1e-5))
        for e in (table, 0.3, 0.9)
    )
    assert of_table == near(of_worst, rel=1e-12)
    assert of_table < 0.9 * of_mild


def test_friction_asks_for_shorter_steps():
    """A pair that slides swings sqrt(7 K_t / 2 K_n) times as fast as one that bounces."""
    rough = DRY_FALL.replace(friction=jnp.asarray(0.3))
    smooth, gripping = (
        float(time_scales.largest_stable_step(of, 1e-5, time_scales.TOUCHING_PAIR))
        for of in (DRY_FALL, rough)
    )
    # Of the stiffest contact, that with the rigid wall; K_t / K_n = 2 (1 - nu) / (2 - nu).
    assert smooth / gripping == near(np.sqrt(3.5 * 2 * 0.75 / 1.75), rel=1e-12)
