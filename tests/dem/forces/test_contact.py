"""Which laws act, contact forces of one moment, coatings and walls at the edge of the model."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.state import WALLS
from mrjax.dem.forces import ActiveLaws, active_laws
from mrjax.laws import closed_forms, particle, time_scales
from tests.builders.particles import glass

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

ROOM = mrjax.Box((1e-2, 1e-2, 1e-2))
GLASS = glass(elastic_modulus=5e7, poisson_ratio=0.25, friction=0.3).astype(float)
STEP = 1e-7
OBLIQUE = mrjax.place([[5e-3, 5e-3, 1.001e-3]], [[0.5, 0.0, -0.5]], contact_diameter=2e-3)


SLIDING = ActiveLaws(sliding=True, rolling=False, damped=False)


def test_only_laws_that_act_or_may_be_differentiated_are_compiled():
    assert active_laws(GLASS) == SLIDING
    assert active_laws(GLASS.replace(friction=0.0)) == replace(SLIDING, sliding=False)
    table = jnp.array([[0.0, 0.0], [0.0, 0.1]])
    assert active_laws(GLASS.replace(friction=0.0, rolling_friction=table)).rolling
    seen = []
    jax.grad(lambda mu: seen.append(active_laws(GLASS.replace(friction=mu))) or mu)(0.0)
    jax.jit(lambda mu: seen.append(active_laws(GLASS.replace(friction=mu))) or mu)(0.0)
    assert seen == [SLIDING] * 2


@pytest.mark.parametrize(
    "name, idle", [("restitution", 1.0), ("dissipation", 0.0), ("tangential_dissipation", 0.0)]
)
def test_dashpots_are_compiled_where_one_acts_or_may_be_differentiated(name, idle):
    for value in (0.5, jnp.array([[idle, idle], [idle, 0.5]])):
        assert active_laws(GLASS.replace(**{name: value})) == replace(SLIDING, damped=True)
    assert active_laws(GLASS.replace(**{name: jnp.full((2, 2), idle)})) == SLIDING
    seen = []
    jax.grad(lambda leaf: seen.append(active_laws(GLASS.replace(**{name: leaf}))) or leaf)(idle)
    assert seen == [replace(SLIDING, damped=True)]


def test_no_dashpot_by_value_is_none_by_law():
    def after(restitution):
        run = mrjax.simulate(
            OBLIQUE, GLASS.replace(restitution=restitution), ROOM, duration=3e-4, time_step=STEP
        )
        return run.state.velocity, run.state.spin

    without, compiled = after(1.0), jax.jit(after)(1.0)
    for found, expected in zip(compiled, without, strict=True):
        # Roundings of 3000 steps.
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert without[0][0, 2] > 0.49 and np.abs(without[1]).max() > 100


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("axis", range(3))
def test_every_wall_is_like_the_floor(axis, end):
    """Force, torque and memory of one that slides and rolls, seen in another view of the box."""
    rough = GLASS.replace(rolling_friction=0.1, rolling_damping=0.3, restitution=0.7)

    def near_wall(axis, end):
        turn = np.roll(np.eye(3), axis - 2, axis=0)  # of the floor to the lower end of the axis
        mirror = np.diag(np.where(np.arange(3) == axis, 1.0 - 2.0 * end, 1.0))
        view = mirror @ turn
        axial = np.linalg.det(view) * view  # spins and torques are axial vectors
        state = mrjax.place(
            [5e-3 + view @ [1e-3, -2e-3, -4.01e-3]],
            [view @ [0.3, 0.1, -0.2]],
            [axial @ [20.0, -40.0, 30.0]],
        )
        stretch, angle = view @ [1e-7, -2e-7, 0.0], axial @ [2e-4, 1e-4, 0.0]
        wall = jnp.array([[WALLS[2 * axis + end]]], jnp.int32)
        contacts = mrjax.Contacts(wall, jnp.array([[stretch]]), jnp.array([[angle]]))
        return replace(state, contacts=contacts), view, axial

    state, view, axial = near_wall(axis, end)
    floor, *_ = near_wall(2, 0)
    found, expected = (mrjax.contact_forces(of, rough, ROOM) for of in (state, floor))
    assert expected[0][0, 2] > 0.05 and np.abs(expected[1][0, :2]).min() > 1e-6
    for of_this, of_floor, seen in zip(found, expected, (view, axial), strict=True):
        # An overlap of 1e-3 of the box has lost as much of its precision.
        allowed = 1e-12 * np.abs(of_floor).max()
        np.testing.assert_allclose(of_this[0], seen @ of_floor[0], rtol=0, atol=allowed)
    # Without the memory, or with that of the wall across, it would be another force.
    across = jnp.array([[WALLS[2 * axis + 1 - end]]], jnp.int32)
    for contacts in (None, replace(state.contacts, partner=across)):
        other, _ = mrjax.contact_forces(replace(state, contacts=contacts), rough, ROOM)
        assert np.abs(other - found[0]).max() > 1e-2 * np.abs(found[0]).max()


def test_no_friction_by_value_is_no_friction_by_law():
    def after(friction):
        run = mrjax.simulate(
            OBLIQUE, GLASS.replace(friction=friction), ROOM, duration=3e-4, time_step=STEP
        )
        return run.state.velocity, run.state.spin

    without, (velocity, spin) = after(0.0), jax.jit(after)(0.0)
    np.testing.assert_allclose(velocity, without[0], rtol=1e-13, atol=1e-15)
    assert not spin.any() and not without[1].any()
    assert velocity[0, 2] > 0.49


def test_contact_forces_are_what_accelerates():
    """m dv/dt and I d spin/dt along an impact, from velocities ten steps apart."""

    @jax.jit
    def onward(state):
        run = mrjax.simulate(state, GLASS, ROOM, duration=10 * STEP, time_step=STEP)
        return run.state, *mrjax.contact_forces(run.state, GLASS, ROOM)

    state, moments = OBLIQUE, []
    for _ in range(150):
        state, force, torque = onward(state)
        moments.append((state.velocity[0], state.spin[0], force[0], torque[0]))
    velocity, spin, force, torque = map(np.array, zip(*moments, strict=True))
    peak, twist = np.abs(force).max(), np.abs(torque).max()
    mass = float(particle.mass(GLASS)) / (10 * STEP)
    moment = float(particle.moment_of_inertia(GLASS)) / (10 * STEP)
    assert peak > 0.1 and twist > 1e-5
    # The mean over ten steps against the mean of its ends: curvature, and where sliding sets in.
    middle = 0.5 * (force[1:] + force[:-1])
    np.testing.assert_allclose(mass * np.diff(velocity, axis=0), middle, atol=5e-3 * peak)
    middle = 0.5 * (torque[1:] + torque[:-1])
    np.testing.assert_allclose(moment * np.diff(spin, axis=0), middle, atol=5e-3 * twist)
    assert not force[-1].any()  # it has left


def test_contact_forces_of_a_crowd():
    """A large sphere wears more small ones than a list for equal spheres has room for."""
    count, large, small = 80, 1e-3, 1.5e-4
    golden = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    height = 1 - 2 * (np.arange(count) + 0.5) / count
    around = np.sqrt(1 - height**2)
    normal = np.stack([around * np.cos(golden), around * np.sin(golden), height], axis=1)
    depth = 1e-6
    centre = np.full(3, 5e-3)
    state = mrjax.place(np.concatenate([centre[None], centre + (large + small - depth) * normal]))
    radius = jnp.array([large] + [small] * count)
    force, torque = mrjax.contact_forces(state, GLASS.replace(radius=radius), ROOM)
    pair_radius = large * small / (large + small)
    push = 4 / 3 * 5e7 / (2 * (1 - 0.25**2)) * np.sqrt(pair_radius * depth) * depth
    np.testing.assert_allclose(force[1:], push * normal, rtol=1e-9, atol=1e-9 * push)
    np.testing.assert_allclose(force[0], -push * normal.sum(axis=0), atol=1e-9 * push)
    assert not torque.any()


def test_single_precision_gives_the_same_impact():
    def after(dtype):
        state = mrjax.place(OBLIQUE.position, OBLIQUE.velocity, dtype=dtype)
        return mrjax.simulate(state, GLASS, ROOM, duration=3e-4, time_step=STEP).state

    double, single = after(jnp.float64), after(jnp.float32)
    assert single.contacts.sliding.dtype == single.spin.dtype == jnp.float32
    # 3000 steps of rounding, 6e-8 each; and the moment of first touch, at 1e-7 of the box.
    np.testing.assert_allclose(single.velocity, double.velocity, atol=1e-3 * 0.7)
    np.testing.assert_allclose(single.spin, double.spin, atol=1e-3 * 700)
    assert double.spin[0, 1] > 300


# --- the edges of the model -----------------------------------------------------------------------


def coated(thickness):
    """The sphere of GLASS, part of it a coating."""
    core = 1e-3 - thickness
    return GLASS.replace(radius=core, f_r=1e-3 / core, coating_density=2500.0)


def test_an_overlap_is_reported_beside_the_thickness_of_the_coating():
    bare, layer = (
        mrjax.simulate(OBLIQUE, parameters, ROOM, duration=3e-4, time_step=STEP)
        for parameters in (GLASS, coated(1e-4))
    )
    assert bare.coating_overlap == 0.0
    assert layer.coating_overlap == near(float(layer.deepest_overlap) * 1e-3 / 1e-4)
    assert 0.05 < layer.coating_overlap < 0.2


def test_an_overlap_through_the_coating_is_not_a_result():
    with pytest.raises(mrjax.SimulationError, match="thickness of the coating"):
        mrjax.simulate(OBLIQUE, coated(1e-5), ROOM, duration=3e-4, time_step=STEP)

    @jax.jit
    def traced(friction):
        parameters = coated(1e-5).replace(friction=friction)
        return mrjax.simulate(OBLIQUE, parameters, ROOM, duration=3e-4, time_step=STEP)

    run = traced(0.3)
    assert int(run.fault) == mrjax.Fault.THROUGH_COATING
    assert np.isnan(run.state.velocity).all() and np.isnan(run.coating_overlap)


@pytest.mark.parametrize("size", [2e-3, 1.9e-3])
def test_walls_closer_than_a_particle_are_refused(size):
    box = mrjax.Box((1e-2, 1e-2, size))
    state = mrjax.place([[5e-3, 5e-3, 0.95e-3]])
    with pytest.raises(mrjax.InputError, match=r"along z is not larger than a particle of 0\.002"):
        mrjax.simulate(state, GLASS, box, duration=1e-6, time_step=STEP)


def thrown(box, every, velocity=-1.0):
    """A lone particle, 0.3 mm from the floor where there is one; skin 0.2 mm."""
    state = mrjax.place([[5e-3, 5e-3, 1.3e-3]], [[0.0, 0.0, velocity]], contact_diameter=2e-3)
    return mrjax.simulate(state, GLASS, box, duration=1e-3, time_step=2 * STEP, rebuild_every=every)


def test_a_lone_particle_never_outruns_the_walls():
    """Its list holds every wall, however far: plain and traced calls may rebuild it as rarely."""
    often, rarely = thrown(ROOM, 50), thrown(ROOM, 5000)
    assert often.state.velocity[0, 2] > 0.99
    # A few more steps may be taken where the interval is cut.
    np.testing.assert_allclose(rarely.state.velocity, often.state.velocity, rtol=1e-6, atol=0)
    traced = jax.jit(lambda velocity: thrown(ROOM, 5000, velocity))(-1.0)
    assert int(traced.fault) == 0
    np.testing.assert_allclose(traced.state.velocity, often.state.velocity, rtol=1e-6, atol=0)
    # Where there are none it meets nobody, however far it flies.
    free = jax.jit(lambda velocity: thrown(mrjax.Box(ROOM.size, (True,) * 3), 5000, velocity))(-1.0)
    assert int(free.fault) == 0
    np.testing.assert_allclose(free.state.position[0, 2], 0.3e-3, rtol=1e-9)


# --- before anything touches ----------------------------------------------------------------------


def test_where_nothing_can_touch_the_step_resolves_the_rise_alone(case2):
    state, parameters = mrjax.disperse(case2), case2.parameters()
    rise = float(time_scales.rise_time(parameters))
    run = mrjax.simulate(state, parameters, case2.box, duration=4 * rise, frames=4)
    assert 0.9 * rise / time_scales.REFINEMENT < run.time_step <= rise / time_scales.REFINEMENT
    assert run.time_step > 10 * mrjax.time_step(parameters)
    assert run.state.contacts is None
    expected = closed_forms.free_fall_velocity(parameters, run.times)
    np.testing.assert_allclose(run.mean_velocity, expected, rtol=1e-9, atol=1e-20)


def test_where_something_may_touch_the_step_resolves_it_and_friction_acts(case2):
    parameters = case2.parameters()
    state = mrjax.place([[10e-6, 10e-6, 2.0000001e-6]], [[0.0, 0.0, -1e-3]])
    run = mrjax.simulate(state, parameters, case2.box, duration=1e-8)
    assert run.time_step <= mrjax.time_step(parameters)
    assert run.deepest_overlap > 0 and run.state.contacts is not None


def test_a_dry_flight_without_contact_chooses_its_step():
    """No drag and nothing to touch: nothing limits the step but the frames."""
    state = mrjax.place([[3e-3, 5e-3, 5e-3], [7e-3, 5e-3, 5e-3]], [[0.0, 0.0, 0.01]] * 2)
    run = mrjax.simulate(state, GLASS, ROOM, duration=1e-3, frames=5)
    assert run.steps == 5
    np.testing.assert_allclose(run.state.position[:, 2], 5e-3 + 1e-5, rtol=1e-12)
