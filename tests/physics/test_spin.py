"""Spin: the moment of inertia, the drag torque on a sphere, and what does not change it."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import mrjax
from mrjax.laws import drag, particle

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12

# Iron of 4 um in oil with hydrated guar gum (Son 2018, Table 1).
COATED = mrjax.Parameters(
    radius=2e-6,
    particle_density=7470.0,
    fluid_density=950.0,
    viscosity=0.01,
    elastic_modulus=3.12e9,
    poisson_ratio=0.25,
    coating_density=800.0,
    f_r=1.1,
    f_w=48.49,
    f_s=1.02,
    f_v=1.3,
).astype(float)
BOX = mrjax.Box((40e-6, 40e-6, 40e-6))


def test_moment_of_inertia_of_core_and_shell():
    """The integral of 8/3 pi rho r^4 over core and shell."""
    core, outer = 2e-6, 2.2e-6
    density = {0.0: 7470.0, core: 800.0}
    expected = sum(
        quad(lambda r, rho=density[inner]: 8 / 3 * np.pi * rho * r**4, inner, end, epsabs=0.0)[0]
        for inner, end in ((0.0, core), (core, outer))
    )
    assert float(particle.moment_of_inertia(COATED)) == near(expected, rel=1e-12)
    bare = COATED.replace(f_r=1.0)
    # No fluid is carried along: 2/5 m R^2 of the mass alone.
    homogeneous = 0.4 * particle.mass(bare) * 2e-6**2
    assert float(particle.moment_of_inertia(bare)) == near(float(homogeneous), rel=1e-12)
    of_coating = COATED.replace(particle_density=800.0)
    homogeneous = 0.4 * particle.mass(of_coating) * outer**2
    assert float(particle.moment_of_inertia(of_coating)) == near(float(homogeneous), rel=1e-12)


def test_derivatives_of_the_moment_of_inertia():
    """d ln I: 5 of the radius, and of f_r by hand."""
    slopes = jax.grad(lambda p: jnp.log(particle.moment_of_inertia(p)))(COATED)
    total = 7470.0 + 800.0 * (1.1**5 - 1)
    assert 2e-6 * slopes.radius == near(5.0, rel=1e-12)
    assert slopes.f_r == near(5 * 800.0 * 1.1**4 / total, rel=1e-12)
    assert slopes.coating_density == near((1.1**5 - 1) / total, rel=1e-12)


def relaxation_of_spin():
    """I / (8 pi f_w f_s f_v mu (f_r R)^3), s."""
    drag_torque = 8 * np.pi * 48.49 * 1.02 * 1.3 * 0.01 * (1.1 * 2e-6) ** 3
    assert float(drag.rotational_coefficient(COATED)) == near(drag_torque, rel=1e-13)
    return float(particle.moment_of_inertia(COATED)) / drag_torque


SPIN = np.array([[300.0, -200.0, 500.0]])


@pytest.mark.parametrize("times", [0.01, 0.1, 1.0, 5.0])
def test_spin_decays_exponentially_at_any_step(times):
    """In four steps, each a multiple of the time of relaxation."""
    tau = relaxation_of_spin()
    step = times * tau
    run = mrjax.simulate(
        mrjax.place([[20e-6, 20e-6, 20e-6]], spins=SPIN),
        COATED,
        BOX,
        duration=4 * step,
        time_step=step,
    )
    assert run.steps == 4
    np.testing.assert_allclose(run.state.spin, SPIN * np.exp(-4 * times), rtol=1e-9)


def test_each_particle_has_its_own_decay():
    """A small sphere stops earlier, as R^2; nothing touches, so friction does not matter."""
    radius = jnp.array([1e-6, 2e-6])
    parameters = COATED.replace(f_r=1.0, radius=radius, friction=0.5)
    tau = 7470.0 * radius**2 / (15 * 48.49 * 1.02 * 1.3 * 0.01)
    state = mrjax.place([[10e-6] * 3, [30e-6] * 3], spins=np.repeat(SPIN, 2, axis=0))
    duration = float(tau[1])
    run = mrjax.simulate(state, parameters, BOX, duration=duration, time_step=duration / 4)
    np.testing.assert_allclose(
        run.state.spin, SPIN * np.exp(-duration / np.asarray(tau))[:, None], rtol=1e-9
    )


def test_a_frictionless_contact_leaves_the_spin_alone():
    """An oblique bounce of two spinning spheres in vacuum, damped, one of them off the floor."""
    dry = COATED.replace(
        f_r=1.0,
        viscosity=0.0,
        fluid_density=0.0,
        gravity=0.0,
        restitution=0.5,
        dissipation=1e-9,
        tangential_dissipation=1e-9,
        rolling_damping=0.3,
    )
    state = mrjax.place(
        [[18.1e-6, 20e-6, 2.05e-6], [22.1e-6, 20.8e-6, 2.6e-6]],
        [[0.05, 0.0, -0.05], [-0.05, 0.0, 0.0]],
        [[3e4, 2e4, -1e4], [-1e4, 5e3, 2e4]],
    )
    run = mrjax.simulate(state, dry, BOX, duration=1e-5, time_step=1e-9)
    turned = np.abs(run.state.velocity - state.velocity).max(axis=1)
    assert (turned > 0.01).all() and run.state.velocity[0, 2] > 0.0
    np.testing.assert_allclose(run.state.spin, state.spin, rtol=1e-15)  # units and back
