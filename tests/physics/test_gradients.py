"""Gradients of the simulated settling velocity: closed form, central differences, both modes."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import time_scales
from tests.builders.particles import glass, iron

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


@pytest.fixture(scope="module", params=[pytest.param("case2", marks=pytest.mark.slow), "case3"])
def velocity(request):
    """Settling velocity of a box of particles as a function of the logarithms of the leaves."""
    recipe = mrjax.Recipe.load(request.param)
    # Nothing touches: friction would only be compiled.
    state, parameters = mrjax.disperse(recipe), recipe.parameters().replace(friction=0.0)
    step = float(time_scales.relaxation_time(parameters))
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


@pytest.mark.slow
def test_plain_calls_are_differentiable_with_the_step_they_choose(case3):
    """Concrete values: simulate chooses its step, and grad and jvp see the same velocity."""
    state = mrjax.place([[10e-6, 10e-6, 20e-6], [16e-6, 10e-6, 20e-6]])
    parameters = case3.parameters()
    duration = 20 * float(time_scales.relaxation_time(parameters))

    def velocity(f_w):
        run = mrjax.simulate(state, parameters.replace(f_w=f_w), case3.box, duration=duration)
        return mrjax.settling_velocity(run)

    value, slope = jax.value_and_grad(velocity)(40.0)
    tangent = jax.jvp(velocity, (40.0,), (1.0,))[1]
    assert float(value) == near(float(velocity(40.0)), rel=1e-12)
    # The start decays to e^-24 at this smaller drag factor, times its exponent.
    assert float(slope) == near(-float(value) / 40, rel=1e-4)
    assert float(slope) == near(float(tangent), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 2])
def test_no_nan_at_zero_overlap_or_apart_second_derivatives_included(times):
    """Two spheres that just touch, one far off, one resting on the floor at zero overlap."""
    box = mrjax.Box((20e-6, 20e-6, 20e-6))
    state = mrjax.place(
        [[6e-6, 6e-6, 10e-6], [8e-6, 6e-6, 10e-6], [15e-6, 15e-6, 15e-6], [6e-6, 15e-6, 1e-6]],
        contact_diameter=2e-6,
    )
    base = iron(restitution=0.5, dissipation=1e-9)
    leaves = ("radius", "elastic_modulus", "viscosity", "restitution", "dissipation", "f_r")
    values = jnp.array([getattr(base, name) for name in leaves])

    def observed(logs):
        changed = dict(zip(leaves, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(state, base.replace(**changed), box, duration=2e-9, time_step=1e-9)
        return 1e6 * (jnp.sum(run.state.position) + 1e-7 * jnp.sum(run.state.velocity))

    origin = jnp.zeros(len(leaves))
    for first in (jax.jacfwd(observed), jax.jacrev(observed)):
        derivative = first if times == 1 else jax.jacfwd(first)
        assert bool(jnp.all(jnp.isfinite(jax.jit(derivative)(origin))))


@pytest.mark.slow
def test_gradient_through_an_elastic_collision_equals_central_differences():
    """Oblique bounce of two spheres in a thin liquid: final velocity against every property."""
    box = mrjax.Box((10e-6,) * 3)
    state = mrjax.place(
        [[3.9e-6, 5e-6, 5e-6], [6.1e-6, 5.4e-6, 5e-6]],
        [[0.05, 0, 0], [-0.05, 0, 0]],
        contact_diameter=2e-6,
    )
    base = iron(fluid_density=900.0, viscosity=1e-4)
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


@pytest.mark.slow
def test_one_value_for_each_particle_has_a_gradient_of_its_own(case3):
    """v is the mean of N terminal velocities: d v / d ln f_w of one particle is -v / N."""
    state, parameters = mrjax.disperse(case3), case3.parameters().replace(friction=0.0)
    step = float(time_scales.relaxation_time(parameters))
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


# --- through frictional collisions ----------------------------------------------------------------

# Those that shift the time at which a contact begins come last.
CONTACT_LEAVES = (
    "friction",
    "restitution",
    "elastic_modulus",
    "wall_elastic_modulus",
    "dissipation",
    "tangential_dissipation",
    "rolling_friction",
    "poisson_ratio",
    "particle_density",
    "radius",
    "viscosity",
    "gravity",
)
GRIT = glass(
    fluid_density=1000.0,
    wall_elastic_modulus=3e7,
    wall_poisson_ratio=0.2,
    friction=0.3,
    restitution=0.7,
    dissipation=2e-6,
    tangential_dissipation=3e-6,
    rolling_friction=0.1,
    rolling_damping=0.2,
).astype(float)
TRAY = mrjax.Box((60e-3, 20e-3, 30e-3))
GRAINS, STEPS, STEP = 10, 400, 1e-6


def moved(logs, values, state):
    """Velocities (m/s) and spins (1000 rad/s) at the end, (GRAINS * 6,), from logarithms."""
    changed = dict(zip(CONTACT_LEAVES, values * jnp.exp(logs), strict=True))
    run = mrjax.simulate(
        state,
        GRIT.replace(**changed),
        TRAY,
        duration=STEPS * STEP,
        time_step=STEP,
        rebuild_every=25,
        capacity=GRAINS - 1,
        cell_capacity=GRAINS,
    )
    return jnp.concatenate([run.state.velocity, 1e-3 * run.state.spin], axis=1).ravel()


MOVED = jax.jit(moved)


@jax.jit
def pushed(tangent, logs, *of):
    """Forward mode, along a tangent of the logarithms."""
    return jax.jvp(lambda logs: moved(logs, *of), (logs,), (tangent,))[1]


@jax.jit
def pulled(cotangent, logs, *of):
    """Reverse mode, along a cotangent of the result."""
    return jax.vjp(lambda logs: moved(logs, *of), logs)[1](cotangent)[0]


def leaves(parameters):
    return jnp.array([getattr(parameters, name) for name in CONTACT_LEAVES])


GLANCES = (0.05, 0.6, 3.0)  # slow, middling and fast along the surfaces: m/s, at 1 m/s across


def impacts():
    """Three pairs in the air and four spheres on the floor, of which the last spins only."""
    position, velocity, spin = [], [], []
    for column, glance in enumerate(GLANCES):
        x = 10.0 + 15.0 * column
        position += [[x, 10.0, 20.0], [x + 1.98, 10.0, 20.3]]
        velocity += [[0.5, 0.5 * glance, 0.0], [-0.5, -0.5 * glance, 0.0]]
        spin += [[0.0, 0.0, 0.0]] * 2
    for column, glance in enumerate((*GLANCES, 0.0)):
        position += [[8.0 + 12.0 * column, 10.0, 1.005]]
        velocity += [[glance, 0.0, -1.0]]
        spin += [[0.0, 0.0, 0.0] if glance else [200.0, -300.0, 500.0]]
    return mrjax.place(1e-3 * np.array(position), velocity, spin, contact_diameter=2e-3)


def settling_bed():
    """Ten in a viscous fluid, falling onto the floor and each other."""
    random = np.random.default_rng(5)
    column, layer = np.meshgrid(np.arange(5), np.arange(2), indexing="ij")
    position = np.stack(
        [10.0 + 2.02 * column + 1.01 * layer, 10.0 + 0 * column, 1.01 + 1.78 * layer], axis=-1
    ).reshape(GRAINS, 3)
    position += random.uniform(-4e-3, 4e-3, (GRAINS, 3))
    velocity = random.normal(size=(GRAINS, 3)) * 0.1 + [0.2, 0.0, -0.3]
    spin = random.normal(size=(GRAINS, 3)) * 100.0
    return mrjax.place(1e-3 * position, velocity, spin, contact_diameter=2e-3)


def compare(values, state, steps):
    """Both modes, and central differences over `steps` of the logarithms; the Jacobian."""
    origin = jnp.zeros(len(CONTACT_LEAVES))
    assert bool(jnp.isfinite(MOVED(origin, values, state)).all())
    forward = np.stack([pushed(unit, origin, values, state) for unit in np.eye(len(steps))], axis=1)
    largest = np.abs(forward).max(axis=0)
    for weights in np.random.default_rng(3).normal(size=(3, 6 * GRAINS)):
        reverse = pulled(weights, origin, values, state)
        assert (np.abs(weights @ forward - reverse) <= 1e-9 * largest).all()
    central = np.stack(
        [
            (MOVED(step, values, state) - MOVED(-step, values, state)) / (2 * step.sum())
            for step in np.diag(steps)
        ],
        axis=1,
    )
    assert (np.abs(forward - central) <= 1e-4 * largest).all()
    return forward.reshape(GRAINS, 6, -1)


def test_gradients_through_frictional_impacts():
    """Pairs and a floor, struck so that they stick, slide, or change from one to the other."""
    state, values = impacts(), leaves(GRIT)
    # The radius moves the first touch: by a step for v dt / R = 1e-3 of itself. Only within that
    # is the difference one of the same steps; rounding, 1e-15, leaves room for 1e-7.
    steps = np.where(np.array(CONTACT_LEAVES) == "radius", 1e-7, 1e-5)
    jacobian = compare(values, state, steps)
    after = MOVED(jnp.zeros(len(values)), values, state).reshape(GRAINS, 6)
    change = np.asarray(after)[6:9, :3] - np.asarray(state.velocity)[6:9]
    ratio = -change[:, 0] / change[:, 2]
    assert ratio[0] < 0.02 and 0.05 < ratio[1] < 0.25  # of the impulses, tangential and normal
    assert ratio[2] == near(0.3, rel=1e-12)
    by_friction = jacobian[:, :, 0]
    # Sliding all along: dv_x = -mu dv_z, and sticking all along: nothing.
    assert by_friction[8, 0] == near(-0.3 * change[2, 2], rel=1e-9)
    assert np.abs(by_friction[[0, 1, 6]]).max() < 1e-3
    assert 1e-2 < np.abs(by_friction[7, 0]) < 0.5 * np.abs(by_friction[8, 0])
    # Every property of a contact matters; without fluid and weight these two do not.
    largest = np.abs(jacobian).max(axis=(0, 1))
    assert (largest[:-2] > 1e-3).all() and (largest[-2:] == 0.0).all()


def test_gradients_through_a_settling_bed():
    """Ten particles, hundreds of steps, some tens of contacts, sticking and sliding and rolling."""
    state = settling_bed()
    values = leaves(GRIT.replace(viscosity=1.0, gravity=500.0))
    # Here every property moves later touches, by a share of what was travelled, some 0.1 R; the
    # radius all of them, by ten times that.
    steps = np.where(np.array(CONTACT_LEAVES) == "radius", 1e-8, 1e-6)
    jacobian = compare(values, state, steps)
    assert (np.abs(jacobian).max(axis=(0, 1)) > 1e-3).all()


@pytest.mark.slow
def test_second_derivatives_through_a_frictional_impact():
    """Both ways, symmetric, and central differences of the first ones."""
    ball = mrjax.place([[10e-3, 10e-3, 1.003e-3]], [[0.6, 0.0, -1.0]], contact_diameter=2e-3)
    names = ("friction", "restitution", "elastic_modulus")
    values = jnp.array([getattr(GRIT, name) for name in names])

    def final(logs):
        changed = dict(zip(names, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(
            ball,
            GRIT.replace(rolling_friction=0.0, **changed),
            TRAY,
            duration=300 * STEP,
            time_step=STEP,
        )
        return run.state.velocity[0, 0] + 0.5e-3 * run.state.spin[0, 1] + run.state.velocity[0, 2]

    def slope(logs, along):
        return jax.jvp(final, (logs,), (along,))[1]

    origin, axes = jnp.zeros(len(names)), jnp.eye(len(names))
    over_reverse = jax.jit(lambda unit: jax.jvp(jax.grad(final), (origin,), (unit,))[1])
    over_forward = jax.jit(
        lambda one, other: jax.jvp(lambda logs: slope(logs, one), (origin,), (other,))[1]
    )
    found = np.array([over_reverse(unit) for unit in axes])
    expected = np.array([[over_forward(one, other) for one in axes] for other in axes])
    largest = np.abs(found).max()
    assert np.isfinite(found).all() and np.abs(found).min() > 1e-3
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * largest)
    np.testing.assert_allclose(found, found.T, rtol=0, atol=1e-9 * largest)
    step, slope = 1e-6, jax.jit(slope)
    central = [
        [(slope(step * one, other) - slope(-step * one, other)) / (2 * step) for other in axes]
        for one in axes
    ]
    np.testing.assert_allclose(found, central, rtol=0, atol=1e-6 * largest)


def test_a_fall_without_any_slip_has_the_derivative_of_those_with_some():
    """Straight down, without spin: nothing slips, and what would slip was not in contact yet."""
    ball = mrjax.place([[10e-3, 10e-3, 1.1e-3]], contact_diameter=2e-3)

    @jax.jit
    def along(speed):
        """Final velocity along the floor, and its derivative, of the initial one."""

        def final(speed):
            velocity = jnp.stack([speed, 0.0, -1.0])[None, :]
            state = replace(ball, velocity=velocity)
            run = mrjax.simulate(state, GRIT, TRAY, duration=STEPS * STEP, time_step=STEP)
            return run.state.velocity[0, 0]

        return jax.jvp(final, (speed,), (1.0,))

    value, slope = along(0.0)
    assert value == 0.0
    step = 1e-5
    central = (along(step)[0] - along(-step)[0]) / (2 * step)
    assert 0.1 < float(central) < 0.99
    assert float(slope) == near(float(central), rel=1e-6)
