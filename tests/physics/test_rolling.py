"""A sphere that rolls on a floor: to rest with a rolling friction, for ever without."""

from functools import partial

import numpy as np
import pytest

import mrjax
from mrjax.laws import particle
from tests.builders.particles import glass
from tests.builders.tangents import length

near = partial(pytest.approx, abs=0.0)  # its own abs passes all within 1e-12

RADIUS, GRAVITY, SPEED = 1e-3, 9.81, 0.05
BALL = glass(
    radius=RADIUS, elastic_modulus=2.18e6, friction=0.5, restitution=0.5, gravity=GRAVITY
).astype(float)
FLOOR = mrjax.Box((0.1, 0.1, 0.004), (True, True, False))


def sinking():
    """Overlap at which Hertz's law carries the weight, m."""
    modulus = 2.18e6 / 0.91
    weight = float(particle.net_weight(BALL))
    return (3 * weight / (4 * modulus * np.sqrt(RADIUS))) ** (2 / 3)


def rolling_ball():
    """Along x without slip: the point of contact, R - d/2 below the centre, is at rest."""
    arm = RADIUS - 0.5 * sinking()
    start = [[0.01, 0.05, RADIUS - sinking()]]
    return mrjax.place(start, [[SPEED, 0.0, 0.0]], [[0.0, SPEED / arm, 0.0]])


def roll_for(duration, state, **changes):
    run = mrjax.simulate(state, BALL.replace(**changes), FLOOR, duration=duration, time_step=8e-6)
    return run.state


def test_a_rolling_sphere_is_slowed_down_by_the_closed_form():
    """About the point of contact nothing but the weight's M_r = mu_r R m g has a moment.

    Friction f slows the centre, m dv/dt = f, and keeps v = omega R with I domega/dt = -R f - M_r:
    together (I + m R^2) domega/dt = -mu_r R m g, so dv/dt = -5/7 mu_r g for a homogeneous sphere.
    """
    mu_r = 0.1
    slowing = 5 / 7 * mu_r * GRAVITY
    resistance = dict(rolling_friction=mu_r, rolling_damping=0.3)
    # Spring and dashpot reach the limit at once: at this spin the dashpot alone bears 16 of it.
    stop = SPEED / slowing
    halfway = roll_for(0.5 * stop, rolling_ball(), **resistance)
    # The overlap, 1e-3 of the radius, shortens the arms; half of it in R - d/2.
    assert float(halfway.velocity[0, 0]) == near(0.5 * SPEED, rel=5e-4)
    assert float(halfway.spin[0, 1]) == near(0.5 * SPEED / RADIUS, rel=1e-3)
    np.testing.assert_allclose(halfway.velocity[0, 1:], 0.0, atol=1e-9 * SPEED)
    np.testing.assert_allclose(halfway.spin[0, ::2], 0.0, atol=1e-9 * SPEED / RADIUS)
    # Then it rocks on the spring, 0.3 of critically damped at some 400/s, and rests.
    end = roll_for(0.5 * stop + 0.1, halfway, **resistance)
    assert length(end.velocity) < 1e-5 * SPEED
    assert length(end.spin) < 1e-5 * SPEED / RADIUS
    # Back by q = 4 d / (9 mu_r R), the angle at which the spring had yielded.
    travelled = float(end.position[0, 0]) - 0.01
    assert travelled == near(0.5 * SPEED * stop - 4 * sinking() / (9 * mu_r), rel=1e-3)


def test_by_default_it_rolls_on_for_ever():
    start = rolling_ball()
    end = roll_for(0.5, start)
    assert end.contacts.rolling is None
    np.testing.assert_allclose(end.velocity, start.velocity, rtol=1e-9, atol=1e-9 * SPEED)
    np.testing.assert_allclose(end.spin, start.spin, rtol=1e-9, atol=1e-9 * SPEED / RADIUS)
