"""Brownian motion by its closed forms: Stokes and Einstein, and the size of the random force."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import brownian
from tests.builders.particles import light_balls


def near(value, rel):
    """Equal to a number within a relative tolerance."""
    return pytest.approx(float(value), rel=rel, abs=0.0)


KT = 1.380649e-23 * 300.0
WARM = light_balls(temperature=300.0, radius=1e-7).astype(float)
STEP = 1e-6


def test_the_coefficients_are_those_of_stokes_and_einstein():
    # Closed forms, to rounding.
    gamma = 6 * math.pi * 1e-3 * 1e-7
    assert brownian.diffusion_coefficient(WARM) == near(KT / gamma, rel=1e-14)
    turning = 8 * math.pi * 1e-3 * 1e-21
    assert brownian.rotational_diffusion_coefficient(WARM) == near(KT / turning, rel=1e-14)
    weight = 4 / 3 * math.pi * 1e-21 * 200.0 * 9.81
    assert brownian.sedimentation_length(WARM) == near(KT / weight, rel=1e-14)
    mass = 4 / 3 * math.pi * 1e-21 * (1200.0 + 500.0)
    assert brownian.thermal_speed(WARM) == near(math.sqrt(KT / mass), rel=1e-14)


def test_random_force_and_torque_balance_the_drag():
    # Fluctuation and dissipation: F^2 dt = 2 k T gamma.
    force, torque = brownian.random_force_and_torque(WARM, STEP)
    assert force**2 * STEP == near(2 * KT * 6 * math.pi * 1e-10, rel=1e-13)
    assert torque**2 * STEP == near(2 * KT * 8 * math.pi * 1e-24, rel=1e-13)


def test_the_force_and_its_derivatives_are_finite_at_rest_and_in_single_precision():
    def force(temperature):
        return brownian.random_force_and_torque(WARM.replace(temperature=temperature), STEP)[0]

    # F is proportional to the root of T.
    assert jax.grad(force)(300.0) == near(force(300.0) / 600.0, rel=1e-13)
    for derivative in (force, jax.grad(force), jax.grad(jax.grad(force))):
        assert derivative(0.0) == 0.0
    tiny = light_balls(temperature=300.0, radius=1e-9).astype(jnp.float32)
    small = brownian.random_force_and_torque(tiny, jnp.float32(1.0))
    exact = brownian.random_force_and_torque(
        light_balls(temperature=300.0, radius=1e-9).astype(float), 1.0
    )
    # The torque is 1e-34 N m; single precision has 7 digits down to 1e-38.
    np.testing.assert_allclose(small, exact, rtol=1e-5)


def test_brownian_motion_asks_for_a_temperature():
    with pytest.raises(mrjax.InputError, match="temperature is missing"):
        brownian.diffusion_coefficient(light_balls())
