"""The coated particle against numbers worked out by hand (Son 2018, Eqs. 3, 9, 11, 20-23)."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax import Parameters
from mrjax.laws import particle

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12

# Iron of 4 um in oil with hydrated guar gum, f_r = 1.1, so f_r^3 = 1.331 (Son 2018, Table 1).
VOLUME = 3.3510321638291125e-17  # 4/3 pi 8e-18 m^3
CORE = dict(
    radius=2e-6,
    particle_density=7470.0,
    fluid_density=950.0,
    viscosity=0.01,
    elastic_modulus=3.12e9,
    poisson_ratio=0.25,
)
COATED = Parameters(**CORE, coating_density=800.0, f_r=1.1).astype(float)
UNCOATED = Parameters(**CORE, coating_density=800.0).astype(float)
LAWS = (
    particle.outer_radius,
    particle.core_volume,
    particle.mass,
    particle.displaced_mass,
    particle.apparent_density,
    particle.inertia,
    particle.net_weight,
)


@pytest.mark.parametrize(
    "law, expected",
    [
        (particle.outer_radius, 2.2e-6),
        (particle.core_volume, VOLUME),
        (particle.mass, 7734.8 * VOLUME),  # Eq. 20: 7470 + 800 * 0.331
        (particle.displaced_mass, 1264.45 * VOLUME),  # Eq. 23: 950 * 1.331
        (particle.inertia, 8367.025 * VOLUME),  # Eq. 21: 7734.8 + 1264.45 / 2
        (particle.net_weight, 6470.35 * 9.81 * VOLUME),  # Eqs. 22, 23: 7734.8 - 1264.45
    ],
)
def test_coated_particle(law, expected):
    assert law(COATED) == near(expected, rel=EXACT)


def test_apparent_density_of_case_3(case3):
    density = particle.apparent_density(case3.parameters())
    assert density == near(7734.8 / 1.331, rel=EXACT)
    assert density == pytest.approx(5811.27, abs=0.005)  # to the digits given


@pytest.mark.parametrize(
    "law, expected",
    [
        (particle.outer_radius, 2e-6),
        (particle.mass, 7470.0 * VOLUME),  # Eq. 3
        (particle.displaced_mass, 950.0 * VOLUME),  # Eq. 9
        (particle.apparent_density, 7470.0),
        (particle.inertia, 7945.0 * VOLUME),  # Eq. 11: 7470 + 950 / 2
        (particle.net_weight, 6520.0 * 9.81 * VOLUME),
    ],
)
def test_uncoated_limit(law, expected):
    assert law(UNCOATED) == near(expected, rel=EXACT)
    # Whatever the coating would be made of.
    assert law(UNCOATED.replace(coating_density=jnp.asarray(3e4))) == law(UNCOATED)


def test_added_mass_can_be_left_out():
    assert particle.inertia(COATED.replace(added_mass=0.0)) == particle.mass(COATED)


def test_lighter_than_the_fluid_rises():
    light = UNCOATED.replace(particle_density=jnp.asarray(900.0))
    assert particle.net_weight(light) == near(-50.0 * 9.81 * VOLUME, rel=EXACT)


@pytest.mark.parametrize(
    "law, leaf, expected",
    [
        (particle.outer_radius, "f_r", 2e-6),
        (particle.mass, "f_r", 3 * 800.0 * 1.21 * VOLUME),
        (particle.mass, "radius", 3 * 7734.8 * VOLUME / 2e-6),
        (particle.mass, "coating_density", 0.331 * VOLUME),
        (particle.apparent_density, "f_r", -3 * (7470.0 - 800.0) / 1.1**4),
        (particle.apparent_density, "radius", 0.0),
        (particle.inertia, "added_mass", 1264.45 * VOLUME),
        (particle.inertia, "f_r", 3 * 1.21 * (800.0 + 475.0) * VOLUME),
        (particle.net_weight, "f_r", 3 * 1.21 * (800.0 - 950.0) * 9.81 * VOLUME),
        (particle.net_weight, "fluid_density", -1.331 * 9.81 * VOLUME),
        (particle.net_weight, "gravity", 6470.35 * VOLUME),
    ],
)
def test_derivatives_are_the_closed_forms(law, leaf, expected):
    derivative = getattr(jax.grad(law)(COATED), leaf)
    # What cancels exactly on paper cancels to rounding of law / leaf.
    rounding = 1e-15 * float(jnp.abs(law(COATED) / getattr(COATED, leaf)))
    assert derivative == pytest.approx(expected, rel=EXACT, abs=rounding)


@pytest.mark.parametrize("law", LAWS)
def test_a_leaf_may_hold_one_value_for_each_particle(law):
    radius, f_r = jnp.array([1e-6, 2e-6, 5e-6]), jnp.array([1.0, 1.1, 1.3])
    together = law(COATED.replace(radius=radius, f_r=f_r))
    alone = [law(COATED.replace(radius=r, f_r=f)) for r, f in zip(radius, f_r, strict=True)]
    np.testing.assert_allclose(
        jnp.broadcast_to(together, (3,)), jnp.stack(alone), rtol=EXACT, atol=0.0
    )


def test_particles_do_not_feel_each_others_leaves():
    def weights(f_r):
        return particle.net_weight(COATED.replace(f_r=f_r))

    f_r = jnp.array([1.0, 1.1, 1.3])
    expected = jnp.diag(3 * f_r**2 * (800.0 - 950.0) * 9.81 * VOLUME)
    np.testing.assert_allclose(jax.jacobian(weights)(f_r), expected, rtol=EXACT, atol=0.0)
