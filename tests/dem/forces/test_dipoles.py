"""Dipoles in runs: what turns, what is conserved, where runs go on, and derivatives."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.errors import InputError
from mrjax.dem import sorting
from mrjax.dem.force_bounds import force_bounds, plan_reach
from mrjax.dem.forces import Contact, Dipoles, Particles, active_forces
from mrjax.dem.forces.dipoles import DIRECTION
from mrjax.dem.plan import System
from mrjax.io import run_file
from mrjax.laws import dipoles, magnetism
from mrjax.laws.dipoles import VACUUM_PERMEABILITY
from mrjax.laws.vectors import rotated

near = partial(pytest.approx, abs=0.0)
RADIUS, REMANENCE = 2e-6, 2e4
MOMENT = 4.0 / 3.0 * np.pi * RADIUS**3 * REMANENCE
ROOM = mrjax.Box((1e-4, 1e-4, 1e-4))
MIDDLE = 5e-5
ALONE = [Dipoles()]
"""Without contact, whose stiffness would need a thousand times as many steps."""


def iron(**changes):
    """Iron without fluid and weight, with a remanence."""
    free = dict(viscosity=0.0, fluid_density=0.0, gravity=0.0, remanence=REMANENCE)
    parameters = mrjax.Recipe.load("case2").parameters()
    return parameters.replace(**(free | changes)).astype(float)


def turned(parameters, spins=None, place=((0.0, 0.0, 0.0), (5e-6, 1e-6, 2e-6))):
    """Two particles, not in line, whose moments point along z and obliquely."""
    state = mrjax.place(MIDDLE + np.asarray(place), spins=spins)
    directions = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])[: len(place)]
    return mrjax.magnetised(state, directions)


def energy(state, parameters, applied=None):
    """Magnetic energy, and that of motion and rotation; J."""
    inertia = float(mrjax.particle.inertia(parameters))
    moment_of_inertia = float(mrjax.particle.moment_of_inertia(parameters))
    moving = 0.5 * inertia * jnp.sum(state.velocity**2)
    turning = 0.5 * moment_of_inertia * jnp.sum(state.spin**2)
    moment = MOMENT * state.memory[DIRECTION].T
    return moving + turning + dipoles.energy(state.position.T, moment, applied)


# --- the law --------------------------------------------------------------------------------------


def test_two_touching_particles_in_line_attract_each_other_by_the_closed_form():
    """pi mu_0 M^2 d^2 / 24, and that of the bound of a chain over zeta(3)."""
    parameters = iron()
    position = jnp.array([[0.0, 0.0], [0.0, 0.0], [0.0, 2.0 * RADIUS]])
    directions = {DIRECTION: jnp.zeros((3, 2)).at[2].set(1.0)}
    still = jnp.zeros((3, 2))
    law = Dipoles().active(parameters)
    force, torque, _ = law(parameters, Particles(position, still, still, directions))
    expected = np.pi * VACUUM_PERMEABILITY / 24.0 * (REMANENCE * 2.0 * RADIUS) ** 2
    np.testing.assert_allclose(force[2], [expected, -expected], rtol=1e-12)
    assert np.abs(torque).max() < 1e-20 * expected
    _, pull = law.between_surfaces(parameters)
    assert float(pull) == near(magnetism.CHAIN * expected, rel=1e-12)


def test_it_is_in_the_list_where_something_is_magnetic():
    def listed(**changes):
        return [type(force) for force in active_forces(None, iron(**changes))].count(Dipoles)

    field = jnp.array([0.0, 0.0, 1e4])
    assert listed() == 1 == listed(remanence=None, field=field, susceptibility=3.0)
    assert listed(remanence=None) == 0 == listed(remanence=0.0, field=field)
    assert listed(remanence=0.0, field=0.0 * field, susceptibility=3.0) == 0


@pytest.mark.parametrize("changes, gained", [({}, False), ({"susceptibility": 5.0}, True)])
def test_only_what_acts_is_computed(changes, gained):
    law = Dipoles().active(iron(**changes))
    assert law.remanent and law.induced == gained


# --- turning --------------------------------------------------------------------------------------


def test_a_rotation_is_exact_and_keeps_the_length():
    """By Rodrigues' formula of numpy, for angles from 1e-9 to 10; the derivatives are finite."""
    random = np.random.default_rng(0)
    vectors, axes = random.normal(size=(2, 3, 50))
    vectors /= np.linalg.norm(vectors, axis=0)
    axes /= np.linalg.norm(axes, axis=0)
    angle = np.geomspace(1e-9, 10.0, 50)
    found = rotated(jnp.asarray(vectors), jnp.asarray(angle * axes))
    along = (axes * vectors).sum(axis=0)
    expected = (
        np.cos(angle) * vectors
        + np.sin(angle) * np.cross(axes, vectors, axis=0)
        + (1.0 - np.cos(angle)) * along * axes
    )
    np.testing.assert_allclose(found, expected, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(found, axis=0), 1.0, rtol=1e-15)
    still = jnp.zeros((3, 50))
    slope = jax.hessian(lambda angle: jnp.sum(rotated(jnp.asarray(vectors), angle)[0]))(still)
    assert np.isfinite(slope).all() and np.any(slope)


def test_a_moment_turns_with_its_particle():
    """A free particle spins on: after the run it has turned by spin times duration."""
    spin, duration = np.array([[3e4, -1e4, 2e4]]), 1e-4
    parameters = iron()
    state = turned(parameters, spin, place=((0.0, 0.0, 0.0),))
    run = mrjax.simulate(
        state, parameters, ROOM, duration=duration, frames=3, time_step=1e-6, forces=ALONE
    )
    expected = rotated(state.memory[DIRECTION].T, jnp.asarray(spin.T * duration)).T
    np.testing.assert_allclose(run.state.memory[DIRECTION], expected, atol=1e-12)


def test_a_compass_needle_oscillates_at_its_frequency():
    """omega^2 = mu_0 m H / I: after a quarter of a period it points along the field.

    The first correction is of the square of the angle, 1e-3, and of the step, 1e-2 rad.
    """
    parameters = iron(field=jnp.array([0.0, 0.0, 1e4]))
    moment_of_inertia = float(mrjax.particle.moment_of_inertia(parameters))
    frequency = np.sqrt(VACUUM_PERMEABILITY * MOMENT * 1e4 / moment_of_inertia)
    tilted = [[np.sin(1e-3), 0.0, np.cos(1e-3)]]
    state = mrjax.magnetised(mrjax.place([[MIDDLE] * 3]), tilted)
    quarter = 0.5 * np.pi / frequency
    run = mrjax.simulate(
        state,
        parameters,
        ROOM,
        duration=quarter,
        frames=1,
        time_step=1e-2 / frequency,
        forces=ALONE,
    )
    assert abs(float(run.state.memory[DIRECTION][0, 0])) < 1e-5 * 1e-3 * 10.0
    assert float(run.state.spin[0, 1]) == near(-1e-3 * frequency, rel=1e-4)


def test_the_energy_of_a_pair_is_conserved_to_the_second_order_of_the_step():
    """Its error falls by four where the step is halved; positions, spins and directions move."""
    parameters = iron(field=jnp.array([2e3, 0.0, 1e4]))
    state = turned(parameters, [[1e4, 0.0, 0.0], [0.0, -2e4, 1e4]])
    applied, duration = jnp.asarray(parameters.field), 4e-5
    before = float(energy(state, parameters, applied))
    errors = []
    for steps in (100, 200, 400):
        run = mrjax.simulate(
            state,
            parameters,
            ROOM,
            duration=duration,
            time_step=duration / steps * (1 + 1e-9),
            forces=ALONE,
        )
        errors.append(float(energy(run.state, parameters, applied)) - before)
    assert float(jnp.abs(run.state.memory[DIRECTION] - state.memory[DIRECTION]).max()) > 0.05
    magnetic = abs(float(dipoles.energy(state.position.T, MOMENT * state.memory[DIRECTION].T)))
    assert 0.0 < abs(errors[0]) < 0.05 * magnetic
    orders = np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_momentum_and_angular_momentum_of_a_pair_are_conserved():
    """Total force and torque are zero; the order of the step limits the angular momentum."""
    parameters = iron()
    state = turned(parameters)
    run = mrjax.simulate(state, parameters, ROOM, duration=4e-5, time_step=2e-7, forces=ALONE)
    mass = float(mrjax.particle.inertia(parameters))
    momentum = mass * np.asarray(run.state.velocity)
    assert np.abs(momentum.sum(axis=0)).max() < 1e-12 * np.abs(momentum).max()
    lever = np.cross(np.asarray(run.state.position) - MIDDLE, momentum).sum(axis=0)
    turning = float(mrjax.particle.moment_of_inertia(parameters)) * np.asarray(run.state.spin)
    assert np.abs(lever + turning.sum(axis=0)).max() < 1e-3 * np.abs(turning).max()


# --- runs that go on ------------------------------------------------------------------------------


def moving():
    parameters = iron(field=jnp.array([0.0, 0.0, 1e4]), susceptibility=3.0, saturation=1e6)
    return turned(parameters, [[1e4, 0.0, 0.0], [0.0, -2e4, 1e4]]), parameters


def test_a_run_goes_on_from_its_state_also_from_a_file(tmp_path):
    """Two halves are the whole, to rounding of half steps; files keep all bits."""
    state, parameters = moving()
    go = partial(mrjax.simulate, parameters=parameters, box=ROOM, time_step=2e-7, forces=ALONE)
    whole = go(state, duration=2e-5)
    half = go(state, duration=1e-5)
    mrjax.save_state(tmp_path / "half.npz", half.state)
    read = mrjax.load_state(tmp_path / "half.npz")
    assert np.array_equal(read.memory[DIRECTION], half.state.memory[DIRECTION])
    rest = go(read, duration=1e-5)
    for name in ("position", "velocity", "spin"):
        ours, theirs = getattr(rest.state, name), getattr(whole.state, name)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    ours, theirs = rest.state.memory[DIRECTION], whole.state.memory[DIRECTION]
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    run_file.save_run(tmp_path / "run.npz", rest, {})
    again, _ = mrjax.load_run(tmp_path / "run.npz")
    assert np.array_equal(again.state.memory[DIRECTION], rest.state.memory[DIRECTION])


def test_a_checkpoint_keeps_the_directions_with_all_bits(tmp_path):
    state, parameters = moving()
    go = dict(
        parameters=parameters, box=ROOM, duration=2e-5, frames=4, time_step=2e-7, forces=ALONE
    )
    whole = mrjax.simulate(state, **go)
    for _ in range(2):
        kept = mrjax.follow(state, **go, checkpoint=tmp_path / "kept")
        assert np.array_equal(kept.state.memory[DIRECTION], whole.state.memory[DIRECTION])
        assert np.array_equal(kept.state.position, whole.state.position)
    other = mrjax.magnetised(state, seed=3)
    with pytest.raises(InputError):
        mrjax.follow(other, **go, checkpoint=tmp_path / "kept")


def test_sorting_moves_directions_with_their_particles():
    state = mrjax.magnetised(mrjax.place(np.eye(3)), seed=1)
    order = jnp.array([2, 0, 1])
    there = sorting.permute_state(state, order)
    assert np.array_equal(there.memory[DIRECTION], state.memory[DIRECTION][order])
    parameters = iron(radius=jnp.array([1.0, 2.0, 3.0]), field=jnp.array([1.0, 2.0, 3.0]))
    sorted_ones = sorting.permute_parameters(parameters, order)
    assert np.array_equal(sorted_ones.radius, [3.0, 1.0, 2.0])
    assert np.array_equal(sorted_ones.field, [1.0, 2.0, 3.0])


class Clock(mrjax.BodyForce):
    """Remembers the age of a particle, s, and the way it has gone, m; it exerts no force."""

    def memory(self):
        return {"age": mrjax.Remembered(1, "s"), "way": mrjax.Remembered(3, "m")}

    def moved(self, parameters, particles, time):
        age, way = particles.memory["age"], particles.memory["way"]
        return {"age": age + time, "way": way + time * particles.velocity}

    def __call__(self, parameters, particles):
        return mrjax.Wrench(jnp.zeros_like(particles.position))


def test_a_force_of_ones_own_remembers_of_each_particle_in_si(tmp_path):
    """Both begin as zeros, and go on with the state."""
    parameters = iron(remanence=None)
    state = mrjax.place([[MIDDLE] * 3, [2e-5] * 3], [[1e-2, 0.0, 0.0], [0.0, 0.0, -2e-2]])
    for part in (1.0, 2.0):
        go = dict(duration=1e-5, time_step=1e-7, forces=[Clock()])
        state = mrjax.simulate(state, parameters, ROOM, **go).state
        np.testing.assert_allclose(state.memory["age"], part * 1e-5, rtol=1e-12)
        expected = part * 1e-5 * np.array([[1e-2, 0.0, 0.0], [0.0, 0.0, -2e-2]])
        np.testing.assert_allclose(state.memory["way"], expected, rtol=1e-12)
    mrjax.save_state(tmp_path / "old.npz", state)
    read = mrjax.load_state(tmp_path / "old.npz")
    assert {name: rows.shape for name, rows in read.memory.items()} == {"age": (2,), "way": (2, 3)}


# --- boxes, states, steps -------------------------------------------------------------------------


def test_the_nearest_image_acts_on_periodic_axes():
    parameters = iron()
    place = np.array([[1e-6, MIDDLE, MIDDLE], [9.5e-5, MIDDLE, MIDDLE]])
    along = [[1.0, 0.0, 0.0]] * 2
    box = mrjax.Box(ROOM.size, (True, False, False))
    inside = mrjax.magnetised(mrjax.place(place), along)
    beside = mrjax.magnetised(mrjax.place(place - [[0.0, 0.0, 0.0], [1e-4, 0.0, 0.0]]), along)
    ends = [
        mrjax.simulate(
            state, parameters, box, duration=1e-6, time_step=1e-7, forces=ALONE
        ).state.velocity
        for state in (inside, beside)
    ]
    np.testing.assert_allclose(*ends, rtol=1e-9)
    assert ends[0][0, 0] < 0.0 < ends[0][1, 0]


def test_a_state_without_good_directions_is_refused_in_one_line():
    parameters = iron()
    state = mrjax.place([[MIDDLE] * 3])
    run = partial(mrjax.simulate, parameters=parameters, box=ROOM, duration=1e-6, time_step=1e-7)
    with pytest.raises(InputError, match="magnetised"):
        run(state)
    long = replace(state, memory={DIRECTION: jnp.array([[0.0, 0.0, 2.0]])})
    with pytest.raises(InputError, match="particle 0 is of length 2"):
        run(long)
    with pytest.raises(InputError, match="shape"):
        mrjax.magnetised(state, [[0.0, 0.0, 1.0]] * 2)
    with pytest.raises(InputError, match="nothing is magnetic"):
        run(state, parameters=iron(remanence=None), forces=[Contact(), Dipoles()])


def test_directions_of_a_seed_are_uniform_on_the_sphere():
    """Means and mean squares of 3000 within four standard errors, 1/sqrt(3 N) and 0.3/sqrt(N)."""
    state = mrjax.place(np.random.default_rng(0).normal(size=(3000, 3)))
    first, again, other = (
        np.asarray(mrjax.magnetised(state, seed=seed).memory[DIRECTION]) for seed in (0, 0, 1)
    )
    assert np.array_equal(first, again) and not np.any(first == other)
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), 1.0, rtol=1e-12)
    assert np.abs(first.mean(axis=0)).max() < 4.0 / np.sqrt(3.0 * 3000)
    assert np.abs((first**2).mean(axis=0) - 1.0 / 3.0).max() < 4.0 * 0.3 / np.sqrt(3000)


def test_the_step_and_softening_follow_the_pull():
    """The bound of force and stiffness goes into both; a stronger magnet is softened less."""
    recipe = mrjax.Recipe.load("case2")
    plain = recipe.parameters()
    weak, strong = (plain.replace(remanence=size).astype(float) for size in (1e2, 1e4))
    soft = [mrjax.softened(one, recipe.box, 314, 0.02) for one in (plain, weak, strong)]
    moduli = [float(one.elastic_modulus) for one in soft]
    assert moduli[0] == near(moduli[1], rel=0.02) and moduli[2] > 2.0 * moduli[1]
    state = mrjax.magnetised(mrjax.place([[1.2e-5] * 3]))
    system = System.of(state, strong, recipe.box)
    bounds = force_bounds(system, strong, plan_reach(system, strong))
    assert bounds.pair_force == near(float(magnetism.largest_pull(strong)), rel=1e-6)
    assert bounds.stiffness == near(float(magnetism.largest_stiffness(strong)), rel=1e-6)


# --- derivatives of a run -------------------------------------------------------------------------

LEAVES = {
    "remanence": REMANENCE, "field": 1e4, "susceptibility": 3.0, "saturation": 2e5,
}  # fmt: skip


def end_of_run(shares):
    """A mean of positions and directions after a run; shares of the coefficients."""
    state, _ = moving()
    leaves = {name: shares[name] * LEAVES[name] for name in LEAVES}
    leaves["field"] = leaves["field"] * jnp.array([0.2, 0.0, 1.0])
    parameters = iron().replace(**leaves)
    run = mrjax.simulate(
        state, parameters, ROOM, duration=1e-5, time_step=1e-6, rebuild_every=10, forces=ALONE
    )
    moved = jnp.sum((run.state.position - MIDDLE) * jnp.array([[1.0, 2.0, 3.0]])) / RADIUS
    return moved + jnp.sum(run.state.memory[DIRECTION] * jnp.array([[3.0, 1.0, 2.0]]))


@pytest.mark.slow
def test_derivatives_of_a_run_by_every_coefficient():
    """Central differences at 1e-4 have errors of 1e-8 and of rounding; forward is reverse."""
    ones = {name: jnp.asarray(1.0) for name in LEAVES}
    reverse, forward = jax.grad(end_of_run)(ones), jax.jacfwd(end_of_run)(ones)
    for name in LEAVES:
        step = 1e-4
        above, below = (end_of_run({**ones, name: 1.0 + way * step}) for way in (1.0, -1.0))
        expected = float(above - below) / (2.0 * step)
        assert abs(expected) > 1e-3
        assert float(reverse[name]) == near(expected, rel=1e-5)
        assert float(forward[name]) == near(float(reverse[name]), rel=1e-8)


@pytest.mark.slow
def test_second_derivatives_of_a_run_are_finite():
    def along(share):
        return end_of_run({name: 1.0 + share * k for k, name in enumerate(LEAVES, 1)})

    curvature = float(jax.jacfwd(jax.jacfwd(along))(0.0))
    step = 1e-3
    expected = (float(along(step)) - 2.0 * float(along(0.0)) + float(along(-step))) / step**2
    assert curvature == near(expected, rel=1e-3)


@pytest.mark.slow
def test_runs_are_mapped_over_seeds_and_strengths():
    state, parameters = moving()
    states = [mrjax.magnetised(state, seed=seed) for seed in (1, 2)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *states)

    def end(state):
        return mrjax.simulate(
            state, parameters, ROOM, duration=2e-6, time_step=5e-7, rebuild_every=4, forces=ALONE
        ).state.memory[DIRECTION]

    both = jax.vmap(end)(replace(stacked, contact_diameter=2.0 * RADIUS))
    for row, one in zip(both, states, strict=True):
        np.testing.assert_allclose(row, end(one), rtol=1e-9, atol=1e-12)
