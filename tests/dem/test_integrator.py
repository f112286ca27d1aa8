"""The exponential leapfrog: its coefficients, its two limits, and its order."""

import math
from fractions import Fraction
from functools import partial
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.dem import integrator
from mrjax.dem.integrator import Kick
from mrjax.laws import particle
from mrjax.laws.closed_forms import SERIES_BELOW, phi_1
from tests.builders.particles import unit_spheres

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
DRY = dict(fluid_density=0.0, viscosity=0.0, gravity=0.0)

# --- (1 - e^-a) / a -----------------------------------------------------------------------------


def exactly(a, order):
    """A derivative of sum (-a)^k / (k + 1)!, in rational numbers."""
    a, total = Fraction(a), Fraction(0)
    for k in range(order, 60 + 6 * math.ceil(a)):
        derived = Fraction(math.factorial(k), math.factorial(k - order)) * (-a) ** (k - order)
        total += (-1) ** order * derived / math.factorial(k + 1)
    return float(total)


@pytest.mark.parametrize("order", range(4))
def test_mean_decay_and_its_derivatives(order):
    law = phi_1
    for _ in range(order):
        law = jax.grad(law)
    edge = SERIES_BELOW
    a = [0.0, 1e-300, 1e-12, 1e-4, 0.03, np.nextafter(edge, 0), edge, 1.01 * edge, 1.0, 7.0, 40.0]
    found = jax.jit(jax.vmap(law))(jnp.array(a))
    # Below the switch the first term left out, a^11/12!, is beyond double precision. Just above it
    # each derivative of (1 - e^-a) / a loses another factor of a = 0.1 to cancellation, and more.
    tolerance = [1e-14, 1e-13, 2e-12, 1e-10][order]
    np.testing.assert_allclose(found, [exactly(x, order) for x in a], rtol=tolerance)


def test_mean_decay_in_single_precision():
    a = jnp.array([0.0, 1e-30, 1e-8, 1e-3, 0.0999, 0.1001, 1.0, 50.0], jnp.float32)
    for order, law in enumerate((phi_1, jax.grad(phi_1))):
        found = jax.vmap(law)(a)
        assert found.dtype == jnp.float32
        # expm1 and exp are within 2e-7; the derivative loses a digit at the switch.
        expected = [exactly(float(x), order) for x in a]
        np.testing.assert_allclose(found, expected, rtol=[4e-7, 1e-5][order])


# --- one step -------------------------------------------------------------------------------------


def parameters(viscosity, **leaves):
    """Of 1 kg without added mass; the drag coefficient is 6 pi times the viscosity."""
    return unit_spheres(
        **{"viscosity": viscosity, "elastic_modulus": 1.0, "poisson_ratio": 0.0, **leaves}
    )


POSITION = jnp.array([[1.0, -2.0], [0.5, 0.0], [3.0, 1.0]])
VELOCITY = jnp.array([[0.1, 0.0], [-1.0, 2.0], [0.0, 0.5]])


def pull(position, velocity):
    return jnp.sin(3.0 * position) - 0.2 * velocity


def pulled(kick):
    """What a step with these coefficients does."""
    return lambda *moving: (kick.keep, kick.gain * pull(*moving), "noted")


def test_without_drag_it_is_the_leapfrog():
    dt = 0.1
    kick = integrator.kick(parameters(0.0), dt)
    assert kick.keep == 1.0 and kick.gain == near(dt, rel=EXACT)
    half_way = POSITION + 0.5 * dt * VELOCITY
    np.testing.assert_array_equal(integrator.drifted(POSITION, VELOCITY, 0.5 * dt), half_way)
    following, velocity, noted = integrator.step(half_way, VELOCITY, pulled(kick), dt)
    expected = VELOCITY + dt * pull(half_way, VELOCITY)
    np.testing.assert_allclose(velocity, expected, rtol=EXACT, atol=1e-15)
    position = half_way + 0.5 * dt * expected
    np.testing.assert_allclose(following, position + 0.5 * dt * expected, rtol=EXACT, atol=1e-15)
    assert noted == "noted"


def test_with_much_drag_it_is_overdamped_euler():
    dt, damping = 0.1, 1e6
    kick = integrator.kick(parameters(damping / (6 * np.pi)), dt)
    assert kick.keep == 0.0 and kick.gain == near(1 / damping, rel=EXACT)
    half_way, velocity = integrator.drifted(POSITION, VELOCITY, 0.5 * dt), VELOCITY
    for _ in range(3):
        before, force = half_way, pull(half_way, velocity)
        half_way, velocity, _ = integrator.step(half_way, velocity, pulled(kick), dt)
        np.testing.assert_allclose(velocity, force / damping, rtol=EXACT, atol=1e-21)
        # Euler's step, from one half-way point to the next.
        np.testing.assert_allclose(half_way - before, dt * force / damping, rtol=1e-8, atol=1e-15)


def test_a_free_fall_with_drag_is_exact_at_any_step():
    for dt in (1e-3, 1.0, 30.0):
        kick = integrator.kick(parameters(0.7 / (6 * np.pi)), dt)
        _, velocity, _ = integrator.step(
            POSITION,
            VELOCITY,
            lambda *_, kick=kick: (kick.keep, jnp.full_like(POSITION, 2.0 * kick.gain), None),
            dt,
        )
        decay = np.exp(-0.7 * dt)
        expected = VELOCITY * decay + 2.0 / 0.7 * (1 - decay)
        np.testing.assert_allclose(velocity, expected, rtol=1e-12)


@pytest.mark.parametrize("viscosity", [0.0, 1e-3, 0.3, 5.0])
def test_the_coefficients_are_differentiable(viscosity):
    """With respect to the viscosity: (keep, gain) = (e^-a, (1 - e^-a) / gamma), a = 6 pi mu dt."""
    dt, rate = 0.25, 6 * np.pi
    slope = jax.jacobian(lambda mu: integrator.kick(parameters(0.0).replace(viscosity=mu), dt))(
        viscosity
    )
    a = rate * viscosity * dt
    expected = Kick(-rate * dt * np.exp(-a), rate * dt**2 * exactly(a, 1))
    assert float(slope.keep) == near(expected.keep, rel=1e-12)
    assert float(slope.gain) == near(expected.gain, rel=1e-12)


# --- through the simulation -----------------------------------------------------------------------

GLASS = dict(radius=0.01, particle_density=2800.0, elastic_modulus=48e9, poisson_ratio=0.2)
DURATION = 80e-6  # the contacts last 46 and 48 us


def bounce(steps):
    """Two spheres head-on at unlike speeds and a third against the floor, from first touch."""
    run = mrjax.simulate(
        mrjax.place(
            [[0.04, 0.05, 0.06], [0.06, 0.05, 0.06], [0.02, 0.02, 0.01]],
            [[6.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [0.0, 0.0, -10.0]],
        ),
        mrjax.Parameters(**GLASS, **DRY).astype(float),
        mrjax.Box((0.1, 0.1, 0.1)),
        duration=DURATION,
        time_step=DURATION / steps,
        rebuild_every=25,
    )
    assert run.steps == steps
    return np.asarray(run.state.position), np.asarray(run.state.velocity)


COARSE, FINE = (100, 200, 400, 800), 12800


@pytest.fixture(scope="module")
def bounces():
    return {steps: bounce(steps) for steps in (*COARSE, FINE)}


@pytest.mark.parametrize("particles", [[0, 1], [2]], ids=["on each other", "on a wall"])
def test_undamped_bounces_converge_with_the_second_order(bounces, particles):
    reference = bounces[FINE][0][particles]
    errors = [np.abs(bounces[steps][0][particles] - reference).max() for steps in COARSE]
    # A slope over three halvings: where in a step a contact ends makes single ones scatter by 0.1.
    order = -np.polyfit(np.log(COARSE), np.log(errors), 1)[0]
    assert 1.9 < order < 2.3
    assert all(later < 0.3 * earlier for earlier, later in pairwise(errors))


def test_energy_and_momentum_after_an_undamped_bounce(bounces):
    """The pair exchanges its velocities, the third turns round."""
    for steps, (_, velocity) in bounces.items():
        energy = (velocity**2).sum(axis=1)
        # Second order or better: the force is that of a potential, and the step symplectic.
        lost = np.abs(energy / [16.0, 36.0, 100.0] - 1.0)
        assert (lost < 0.6 / steps**2).all()
        assert velocity[:2, 0].sum() == near(2.0, rel=1e-12)  # to rounding


def test_a_fall_without_drag_is_exact():
    """z_0 + v_0 t - g t^2 / 2, with steps of 10 ms."""
    ball = mrjax.Parameters(**{**GLASS, **DRY, "gravity": 9.81}).astype(float)
    start = mrjax.place([[0.05, 0.05, 10.0]], [[0.0, 0.0, 0.5]])
    run = mrjax.simulate(
        start,
        ball,
        mrjax.Box((0.1, 0.1, 20.0), (True, True, False)),
        duration=0.5,
        frames=5,
        time_step=0.01,
    )
    assert run.steps == 50
    height = 10.0 + 0.5 * run.times - 0.5 * 9.81 * run.times**2
    # 50 roundings of 10 m.
    np.testing.assert_allclose(run.mudline - 0.01, height, rtol=1e-14)
    np.testing.assert_allclose(-run.mean_velocity[1:], 0.5 - 9.81 * run.times[1:], rtol=EXACT)
    assert float(particle.net_weight(ball) / particle.inertia(ball)) == near(9.81)
