"""Gradients of the simulated settling velocity: closed form, central differences, both modes."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax import timestep

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

LEAVES = (
    "f_w",
    "f_s",
    "f_v",
    "f_r",
    "viscosity",
    "radius",
    "particle_density",
    "fluid_density",
    "coating_density",
    "gravity",
)


def log_slopes(recipe) -> dict[str, float]:
    """d ln v / d ln p of v = (m - m_f) g / (6 pi f_w f_s f_v f_r mu R), by hand."""
    sheet, f_r = recipe, recipe.radius_factor
    core, fluid = sheet.particle.density, sheet.fluid.density
    shell_density = sheet.coating.density if sheet.coating else fluid
    shell = shell_density * (f_r**3 - 1)
    net = core + shell - fluid * f_r**3
    return {
        "f_w": -1.0,
        "f_s": -1.0,
        "f_v": -1.0,
        "f_r": 3 * f_r**3 * (shell_density - fluid) / net - 1,
        "viscosity": -1.0,
        "radius": 2.0,
        "particle_density": core / net,
        "fluid_density": -fluid * f_r**3 / net,
        "coating_density": shell / net,
        "gravity": 1.0,
    }


@pytest.fixture(scope="module", params=["case2", "case3"])
def velocity(request):
    """Settling velocity of a box of particles as a function of the logarithms of the leaves."""
    recipe = mrjax.Recipe.load(request.param)
    state, parameters = mrjax.disperse(recipe), recipe.parameters()
    step = float(timestep.relaxation_time(parameters))
    values = jnp.array([getattr(parameters, name) for name in LEAVES])

    @jax.jit
    def of(logs):
        changed = dict(zip(LEAVES, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(
            state, parameters.replace(**changed), recipe.box, duration=40 * step, time_step=step
        )
        return mrjax.settling_velocity(run)

    return recipe, of


def test_gradients_equal_the_closed_form_and_central_differences(velocity):
    recipe, of = velocity
    origin = jnp.zeros(len(LEAVES))
    value = float(of(origin))
    forward = np.asarray(jax.jit(jax.jacfwd(of))(origin)) / value
    reverse = np.asarray(jax.jit(jax.jacrev(of))(origin)) / value
    exact = np.array([log_slopes(recipe)[name] for name in LEAVES])
    np.testing.assert_allclose(forward, exact, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9, atol=1e-12)
    step = 1e-4  # truncation of a power law: step^2 times its exponent cubed, over 6
    central = [
        float(of(step * unit) - of(-step * unit)) / (2 * step * value)
        for unit in np.eye(len(LEAVES))
    ]
    np.testing.assert_allclose(forward, central, rtol=1e-5, atol=1e-8)


def test_plain_calls_are_differentiable_with_the_step_they_choose(case3):
    """Concrete values: simulate chooses its step, and grad and jvp see the same velocity."""
    state = mrjax.place([[10e-6, 10e-6, 20e-6], [16e-6, 10e-6, 20e-6]])
    parameters = case3.parameters()
    duration = 20 * float(timestep.relaxation_time(parameters))

    def velocity(f_w):
        run = mrjax.simulate(state, parameters.replace(f_w=f_w), case3.box, duration=duration)
        return mrjax.settling_velocity(run)

    value, slope = jax.value_and_grad(velocity)(40.0)
    tangent = jax.jvp(velocity, (40.0,), (1.0,))[1]
    assert float(value) == near(float(velocity(40.0)), rel=1e-12)
    # The start decays to e^-24 at this smaller drag factor, times its exponent.
    assert float(slope) == near(-float(value) / 40, rel=1e-4)
    assert float(slope) == near(float(tangent), rel=1e-9)


def test_no_nan_at_zero_overlap_or_apart_second_derivatives_included():
    """Two spheres that just touch, one far off, one resting on the floor at zero overlap."""
    box = mrjax.Box((20e-6, 20e-6, 20e-6))
    state = mrjax.place(
        [[6e-6, 6e-6, 10e-6], [8e-6, 6e-6, 10e-6], [15e-6, 15e-6, 15e-6], [6e-6, 15e-6, 1e-6]],
        contact_diameter=2e-6,
    )
    base = mrjax.Parameters(
        radius=1e-6,
        particle_density=7000.0,
        fluid_density=1000.0,
        viscosity=0.01,
        elastic_modulus=1e9,
        poisson_ratio=0.3,
        restitution=0.5,
        dissipation=1e-9,
    )
    leaves = ("radius", "elastic_modulus", "viscosity", "restitution", "dissipation", "f_r")
    values = jnp.array([getattr(base, name) for name in leaves])

    def observed(logs):
        changed = dict(zip(leaves, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(state, base.replace(**changed), box, duration=2e-9, time_step=1e-9)
        return 1e6 * (jnp.sum(run.state.position) + 1e-7 * jnp.sum(run.state.velocity))

    origin = jnp.zeros(len(leaves))
    for derivative in (
        jax.jacfwd(observed),
        jax.jacrev(observed),
        jax.jacfwd(jax.jacfwd(observed)),
        jax.jacfwd(jax.jacrev(observed)),
    ):
        assert bool(jnp.all(jnp.isfinite(jax.jit(derivative)(origin))))


def test_gradient_through_an_elastic_collision_equals_central_differences():
    """Oblique bounce of two spheres in a thin liquid: final velocity against every property."""
    box = mrjax.Box((10e-6,) * 3)
    state = mrjax.place(
        [[3.9e-6, 5e-6, 5e-6], [6.1e-6, 5.4e-6, 5e-6]],
        [[0.05, 0, 0], [-0.05, 0, 0]],
        contact_diameter=2e-6,
    )
    base = mrjax.Parameters(
        radius=1e-6,
        particle_density=7000.0,
        fluid_density=900.0,
        viscosity=1e-4,
        elastic_modulus=1e9,
        poisson_ratio=0.3,
    )
    leaves = ("elastic_modulus", "poisson_ratio", "particle_density", "radius", "viscosity")
    values = jnp.array([getattr(base, name) for name in leaves])

    @jax.jit
    def final(logs):
        changed = dict(zip(leaves, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(state, base.replace(**changed), box, duration=4e-6, time_step=4e-10)
        return run.state.velocity[0, 0] + 2.0 * run.state.velocity[1, 1]

    origin = jnp.zeros(len(leaves))
    forward = jax.jit(jax.jacfwd(final))(origin)
    reverse = jax.jit(jax.jacrev(final))(origin)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    # A radius that grows by v dt / R = 2e-5 of itself brings the contact one step forward: only
    # smaller differences see the derivative of the steps that were taken.
    steps = np.array([1e-5, 1e-5, 1e-5, 1e-7, 1e-5])
    central = [float(final(unit) - final(-unit)) / (2 * unit.sum()) for unit in np.diag(steps)]
    assert abs(central[3]) > 1e-2  # the bounce depends on the radius: it did happen
    # Rounding, 1e-13 m/s after the bounce, over those steps; the rest is truncation.
    np.testing.assert_allclose(forward, central, rtol=1e-4, atol=1e-8)


def test_one_value_for_each_particle_has_a_gradient_of_its_own(case3):
    """v is the mean of N terminal velocities: d v / d ln f_w of one particle is -v / N."""
    state, parameters = mrjax.disperse(case3), case3.parameters()
    step = float(timestep.relaxation_time(parameters))
    ones = jnp.ones(state.particles)

    def velocity(logs):
        changed = parameters.replace(
            f_w=parameters.f_w * jnp.exp(logs["f_w"]), radius=parameters.radius * ones
        )
        run = mrjax.simulate(state, changed, case3.box, duration=40 * step, time_step=step)
        return mrjax.settling_velocity(run)

    origin = {"f_w": 0.0 * ones}
    value, reverse = jax.value_and_grad(velocity)(origin)
    np.testing.assert_allclose(reverse["f_w"], -value / len(ones) * np.ones(len(ones)), rtol=1e-9)
    along = {"f_w": jnp.linspace(-1.0, 2.0, len(ones))}
    forward = jax.jvp(velocity, (origin,), (along,))[1]
    assert float(forward) == near(float(reverse["f_w"] @ along["f_w"]), rel=1e-9)
