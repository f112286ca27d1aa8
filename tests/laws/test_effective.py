"""What two surfaces have in common: like and unlike particles, walls, and tables by material."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core import checks
from mrjax.dem.pairs import Pairs
from mrjax.laws import effective, normal, particle, tangential
from tests.builders.particles import glass

near = partial(pytest.approx, rel=1e-13, abs=0.0)  # its own abs passes all within 1e-12

# 3 kg of 1 m radius, of which 0.5 kg are added mass: I = 2/5 * 2.5 = 1 kg m^2.
BALL = mrjax.Parameters(
    radius=1.0,
    particle_density=2.5 * 3 / (4 * np.pi),
    fluid_density=1.0 * 3 / (4 * np.pi),
    viscosity=0.0,
    elastic_modulus=3.0,
    poisson_ratio=0.5,
    wall_elastic_modulus=4.0,
    wall_poisson_ratio=0.25,
    friction=0.3,
    restitution=0.5,
    dissipation=0.1,
    tangential_dissipation=0.2,
    rolling_friction=0.4,
    rolling_damping=0.6,
).astype(float)
TABLED = (
    "friction",
    "restitution",
    "dissipation",
    "tangential_dissipation",
    "rolling_friction",
    "rolling_damping",
)


def listed(first, second, particles=None):
    """These pairs; walls have the ids from `particles` on, and without it there are none."""
    first, second = (jnp.asarray(of, jnp.int32) for of in (first, second))
    nothing = (jnp.zeros(len(first)),) * 3
    return Pairs(
        first,
        second,
        present=jnp.ones(len(first), bool),
        wall=None if particles is None else second >= particles,
        separation=nothing,
        places=jnp.zeros((0, particles or int(second.max()) + 1), jnp.int32),
        overflow=jnp.zeros((), jnp.int32),
    )


def numbers(constants, place=None):
    """Those of one place; without it, one of each for all. Without attraction there is no F_c."""
    constants = [leaf for leaf in constants if leaf is not None]
    assert all(jnp.shape(leaf) == () or place is not None for leaf in constants)
    return [float(leaf if jnp.ndim(leaf) == 0 else leaf[place]) for leaf in constants]


TABLE_VALUES = [0.3, float(normal.damping_ratio(0.5)), 0.1, 0.2, 0.4, 0.6]
# E* = E / (2 (1 - nu^2)), G* = E / (4 (2 - nu) (1 + nu)), and half of 1 m, 3 kg, 4 kg m^2.
OF_LIKE = [2.0, 3 / 9, 0.5, 1.5, 2.0, *TABLE_VALUES]


def test_like_particles_share_one_number():
    assert numbers(effective.per_pair(BALL, None, *listed([0, 1], [1, 2]).surfaces)) == near(
        OF_LIKE
    )


def test_a_wall_is_of_its_own_material_and_infinite():
    # Of two particles: with each other, and with the lower end of x and the upper of z.
    found = effective.per_pair(BALL, None, *listed([0, 0, 1], [1, 2, 7], particles=2).surfaces)
    # 1/E* = 0.75/3 + (1 - 1/16)/4, 1/G* = 1.5 + 1.09375; 1 m, 3 kg, 1 + 3 kg m^2.
    at_wall = [1 / 0.484375, 1 / 2.59375, 1.0, 3.0, 4.0, *TABLE_VALUES]
    assert found.pull_off is None
    assert numbers(found, 0) == near(OF_LIKE)
    assert numbers(found, 1) == numbers(found, 2) == near(at_wall)
    assert numbers(found[5:-1]) == near(TABLE_VALUES)  # one for all contacts


UNLIKE = BALL.replace(
    radius=jnp.array([1.0, 2.0, 0.5]),
    particle_density=jnp.array([1.0, 3.0, 2.0]),
    elastic_modulus=jnp.array([3.0, 4.0, 5.0]),
    poisson_ratio=jnp.array([0.5, 0.25, 0.1]),
)
FIRST, SECOND = [0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]


@pytest.mark.parametrize("walled", [False, True])
def test_unlike_particles_have_one_for_each_contact(walled):
    walls = [(one, 3 + end) for one in range(3) for end in range(6)] if walled else []
    first, second = np.transpose([*zip(FIRST, SECOND, strict=True), *walls])
    found = effective.per_pair(UNLIKE, None, *listed(first, second, 3 if walled else None).surfaces)
    radius, mass, moment = (
        np.asarray(of(UNLIKE))
        for of in (particle.outer_radius, particle.inertia, particle.moment_of_inertia)
    )
    about = moment + mass * radius**2
    for place, (one, other) in enumerate(zip(first, second, strict=True)):
        materials = [
            (UNLIKE.elastic_modulus[k], UNLIKE.poisson_ratio[k]) if k < 3 else (4.0, 0.25)
            for k in (one, other)
        ]
        of = [one, other] if other < 3 else [one]  # a wall is infinite
        expected = [
            normal.effective_modulus(*materials[0], *materials[1]),
            tangential.effective_shear_modulus(*materials[0], *materials[1]),
            *(1 / sum(1 / value[of]) for value in (radius, mass, about)),
        ]
        assert all(leaf.shape == first.shape for leaf in found[:5])
        assert numbers(found[:5], place) == near([*map(float, expected)])
    assert numbers(found[5:-1]) == near(TABLE_VALUES)


def test_two_by_two_tables_are_of_particles_and_walls():
    tabled = BALL.replace(
        friction=jnp.array([[0.1, 0.2], [0.2, 9.0]]), restitution=jnp.array([[0.9, 0.7], [0.7, 1]])
    )
    found = effective.per_pair(tabled, None, *listed([1, 0, 2], [2, 4, 8], particles=3).surfaces)
    np.testing.assert_array_equal(found.friction, [0.1, 0.2, 0.2])
    for place, restitution in enumerate((0.9, 0.7, 0.7)):
        assert float(found.damping[place]) == near(float(normal.damping_ratio(restitution)))
    np.testing.assert_array_equal(
        effective.per_pair(tabled, None, *listed([1], [2]).surfaces).friction, [0.1]
    )


def test_tables_are_read_by_both_materials():
    value = jnp.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.5], [0.3, 0.5, 9.0]])
    tabled, material = BALL.replace(rolling_damping=value), jnp.array([1, 0, 1])
    for particles in (None, 3):
        between = effective.per_pair(tabled, material, *listed(FIRST, SECOND, particles).surfaces)
        np.testing.assert_array_equal(between.rolling_damping, [0.2, 0.4, 0.2, 0.2, 0.4, 0.2])
    at_wall = effective.per_pair(tabled, material, *listed([0, 1, 2], [3, 6, 8], 3).surfaces)
    np.testing.assert_array_equal(at_wall.rolling_damping, [0.5, 0.3, 0.5])


# --- three materials in one run -------------------------------------------------------------------

# Each pairing has values of its own; 3 is the wall.
PAIRINGS = [(0, 3), (1, 3), (2, 3), (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
VALUES = {
    "friction": [0.1, 0.2, 0.3, 0.15, 0.25, 0.35, 0.05, 0.4, 0.45],
    "restitution": [0.9, 0.8, 0.7, 0.6, 0.55, 0.95, 0.85, 0.75, 0.65],
    "dissipation": [1e-7, 4e-7, 7e-7, 2e-7, 5e-7, 8e-7, 3e-7, 6e-7, 0.0],
    "tangential_dissipation": [6e-6, 0.0, 3e-6, 1e-6, 4e-6, 7e-6, 2e-6, 5e-6, 8e-6],
    "rolling_friction": [0.1, 0.2, 0.3, 0.05, 0.15, 0.25, 0.35, 0.12, 0.22],
    "rolling_damping": [0.3, 0.1, 0.5, 0.4, 0.2, 0.6, 0.35, 0.15, 0.25],
}
GRAIN = glass().astype(float)
ROOM = mrjax.Box((32e-3, 12e-3, 24e-3), (True, True, False))


def table(values):
    """The pairings' values as a table of 3 materials and the wall; two walls never meet."""
    found = np.full((4, 4), min(values))
    for (one, other), value in zip(PAIRINGS, values, strict=True):
        found[one, other] = found[other, one] = value
    return jnp.asarray(found)


def impacts():
    """Each pairing at its place: on the floor, or on each other above it, oblique and spinning."""
    position, velocity, material, who = [], [], [], []
    for row, (one, other) in enumerate(PAIRINGS):
        if other == 3:
            who.append([len(position)])
            position.append([4.0 + 8.0 * row, 6.0, 1.01])
            velocity.append([0.6, 0.0, -1.0])
            material.append(one)
        else:
            who.append([len(position), len(position) + 1])
            x, z = 5.0 + 10.0 * (row % 3), 5.0 + 10.0 * (row // 3 - 1)
            position += [[x - 1.0, 6.0, z], [x + 1.0, 6.2, z]]
            velocity += [[0.5, 0.6, 0.0], [-0.5, 0.0, 0.0]]
            material += [one, other]
    spin = [[100.0 * (-1) ** k, 300.0, 200.0] for k in range(len(position))]
    state = mrjax.place(1e-3 * np.array(position), velocity, spin, materials=material)
    return replace(state, contact_diameter=2e-3), who


@jax.jit
def struck(state, parameters):
    return mrjax.simulate(
        state,
        parameters,
        ROOM,
        duration=500e-6,
        time_step=1e-6,
        rebuild_every=50,
        capacity=2,
        cell_capacity=4,
    )


@pytest.mark.slow
def test_every_pair_of_materials_has_its_own_values():
    """One run of three materials against one for each pairing, in which all have its values."""
    state, who = impacts()
    run = struck(state, GRAIN.replace(**{name: table(VALUES[name]) for name in TABLED}))
    run.check()
    uniform = []
    for row in range(len(PAIRINGS)):
        values = {name: jnp.asarray(VALUES[name][row]) for name in TABLED}
        uniform.append(struck(replace(state, material=None), GRAIN.replace(**values)))
        uniform[-1].check()

    def motion(run, particles):
        velocity, spin = (
            np.asarray(leaf)[particles] for leaf in (run.state.velocity, run.state.spin)
        )
        return np.concatenate([velocity, 1e-3 * spin], axis=1)

    for row, particles in enumerate(who):
        found = motion(run, particles)
        assert np.isfinite(found).all()
        # Rounding, after some 250 steps in contact.
        np.testing.assert_allclose(found, motion(uniform[row], particles), rtol=0, atol=1e-12)
        for other in set(range(len(PAIRINGS))) - {row}:
            assert np.abs(found - motion(uniform[other], particles)).max() > 1e-3


# --- what is refused ------------------------------------------------------------------------------

SYMMETRIC = jnp.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.5], [0.3, 0.5, 0.6]])
ADVICE = r"; give one number, or a table with a row and a column for each material and a last one"


@pytest.mark.parametrize("name", TABLED)
def test_tables_that_fit_are_accepted(name):
    for leaf, materials in (
        (SYMMETRIC[:2, :2], None),
        (SYMMETRIC, jnp.array([0, 1, 1])),
        (SYMMETRIC, jnp.array([0, 0, 0])),  # the second has run out
    ):
        checks.refuse_bad_parameters(GRAIN.replace(**{name: leaf}), 3, materials)


@pytest.mark.parametrize(
    "leaf, materials, message",
    [
        (jnp.full(3, 0.1), [0, 1, 1], r"friction has shape \(3,\)" + ADVICE),
        (jnp.full((2, 3), 0.1), [0, 1, 1], r"friction has shape \(2, 3\)" + ADVICE),
        (jnp.full((1, 1), 0.1), None, r"friction has shape \(1, 1\)" + ADVICE),
        (SYMMETRIC[:2, :2], [0, 1, 1], r"friction has shape \(2, 2\).*here \(3, 3\)"),
        (SYMMETRIC, [0, 1, 3], r"friction has shape \(3, 3\).*here \(5, 5\)"),
        (SYMMETRIC, None, r"friction has shape \(3, 3\).*here \(2, 2\)"),
        (
            SYMMETRIC.at[0, 1].set(0.7),
            [0, 1, 1],
            r"friction\[0, 1\] = 0.7 and friction\[1, 0\] = 0.2: .* give a symmetric table",
        ),
        (SYMMETRIC.at[1, 1].set(-0.7), [0, 1, 1], "friction = -0.7 must be at least 0"),
        (SYMMETRIC, [0, 1], r"materials have shape \(2,\); give one for each particle"),
    ],
)
def test_tables_that_do_not_fit(leaf, materials, message):
    material = None if materials is None else jnp.array(materials)
    with pytest.raises(mrjax.InputError, match=message):
        checks.refuse_bad_parameters(GRAIN.replace(friction=leaf), 3, material)


def test_a_restitution_above_one_in_a_table():
    with pytest.raises(mrjax.InputError, match=r"restitution = 1.3 must be above 0, at most 1"):
        checks.refuse_bad_parameters(
            GRAIN.replace(restitution=SYMMETRIC.at[2, 2].set(1.3)), 3, jnp.array([0, 1, 1])
        )


@pytest.mark.parametrize("materials", [[0, -1], [0.0, 1.0], [0], [[0, 1]]])
def test_materials_are_whole_numbers_one_for_each(materials):
    with pytest.raises(mrjax.InputError, match=r"materials = .*: give a whole number from 0 for"):
        mrjax.place([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], materials=materials)


def test_like_particles_differ_by_kind_of_contact_only():
    """As the pairs of a list have it: two particles, and one with a wall."""
    tables = {name: np.array([[0.1, 0.7], [0.7, np.nan]]) for name in ("friction", "dissipation")}
    for ball in (BALL, BALL.replace(**tables)):
        kinds = effective.per_kind(ball, None, walled=True)
        pairs = effective.per_pair(ball, None, *listed([0, 1], [1, 7], particles=2).surfaces)
        for kind in (0, 1):
            assert numbers(kinds, kind) == numbers(pairs, kind)
        alone = effective.per_kind(ball, None, walled=False)
        assert numbers(alone, 0) == numbers(pairs, 0)
    assert numbers(kinds, 0) != numbers(kinds, 1)
    assert effective.per_kind(UNLIKE, None, walled=True) is None
    assert effective.per_kind(BALL, np.zeros(2, np.int32), walled=True) is None
