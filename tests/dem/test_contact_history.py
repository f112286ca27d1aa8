"""What contacts remember: turned with them, found again by id, and carried from run to run."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.state import NOBODY, WALLS
from mrjax.dem import contact_history
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.pairs import Pairs
from mrjax.laws import vectors
from tests.builders.particles import glass

near = partial(pytest.approx, rel=1e-13, abs=0.0)  # its own abs passes all within 1e-12

# --- turned with the contact ----------------------------------------------------------------------


def rotated(vector, axis, angle):
    """Rodrigues' rotation of rows about rows of unit length."""
    along = (axis * vector).sum(axis=1, keepdims=True) * axis
    across = np.cross(axis, vector)
    return along + np.cos(angle) * (vector - along) + np.sin(angle) * across


def unit(vector):
    return vector / np.linalg.norm(vector, axis=1, keepdims=True)


RANDOM = np.random.default_rng(0).normal(size=(4, 100, 3))
OLD_NORMAL = unit(RANDOM[0])
TILT = unit(np.cross(OLD_NORMAL, RANDOM[1]))  # axis about which the normal turns
VECTOR = unit(np.cross(OLD_NORMAL, RANDOM[2]))  # in the old tangent plane


def turned(angle, twist):
    """Errors of the direction and of the length, and what is left along the normal."""
    normal = rotated(OLD_NORMAL, TILT, angle)
    exact = rotated(rotated(VECTOR, TILT, angle), normal, twist)
    # Of the distance D n, D dn/dt is the velocity across n; D (n - n_old) is what was travelled.
    turn = np.cos(angle) * normal - OLD_NORMAL
    found = np.stack(
        contact_history.rotate_into_tangent_plane(
            tuple(VECTOR.T), tuple(normal.T), tuple(turn.T), np.full(100, twist)
        ),
        axis=1,
    )
    return (
        np.abs(found - exact).max(),
        np.abs(np.linalg.norm(found, axis=1) - 1.0).max(),
        np.abs((found * normal).sum(axis=1)).max(),
    )


def test_a_memory_turns_with_the_contact():
    for angle, twist in ((0.2, 0.0), (0.0, 0.3), (0.2, 0.3)):
        errors = np.array([turned(angle / 2**k, twist / 2**k) for k in range(4)])
        direction, length = np.log2(errors[:-1] / errors[1:])[:, :2].T
        assert (direction > 2.75).all()  # third order in one step, second over a path
        assert (length > 3.75).all()
        assert errors[-1, 0] < 2e-5
        assert (errors[:, 2] < 1e-15).all()


def test_a_wall_does_not_turn_it_but_spin_about_its_normal_does():
    normal, vector = (0.0, 0.0, 1.0), (0.6, 0.8, 0.0)
    none = (0.0, 0.0, 0.0)
    assert contact_history.rotate_into_tangent_plane(vector, normal, none, 0.0) == vector
    x, y, z = contact_history.rotate_into_tangent_plane(vector, normal, none, 1e-3)
    # (0.6 - 0.8 t, 0.8 + 0.6 t) and the second order.
    assert x == near(0.6 - 0.8e-3 - 0.3e-6)
    assert y == near(0.8 + 0.6e-3 - 0.4e-6)
    assert z == 0.0


# --- shortened to a limit -------------------------------------------------------------------------


def shortening(vector, longest):
    return vectors.clip_factor(tuple(vector), longest)


@pytest.mark.parametrize(
    "vector, longest, factor",
    [
        ([3.0, 0.0, -4.0], 2.5, 0.5),
        ([3.0, 0.0, -4.0], 10.0, 1.0),
        ([3.0, 0.0, -4.0], 5.001, 1.0),
        ([2.0, -3.0, 6.0], 1.75, 0.25),
        ([3.0, 0.0, -4.0], 0.0, 0.0),
        ([0.0, 0.0, 0.0], 2.0, 1.0),
        ([0.0, 0.0, 0.0], 0.0, 0.0),
    ],
)
def test_shortening(vector, longest, factor):
    found = float(shortening(jnp.array(vector), jnp.array(longest)))
    assert found == near(factor) and (factor != 1.0 or found == 1.0)


SCALES = np.array([1e-12, 1e-9, 1e-3, 1.0, 1e3, 1e9])


@pytest.mark.parametrize("dtype", [jnp.float32, float])
def test_shortening_of_tiny_and_huge_vectors(dtype):
    vector = jnp.asarray(SCALES[:, None] * [3.0, 0.0, -4.0], dtype)
    for limit, factor in ((2.5, 0.5), (10.0, 1.0), (0.0, 0.0)):
        found = jax.vmap(shortening)(vector, jnp.asarray(limit * SCALES, dtype))
        np.testing.assert_allclose(found, factor, rtol=4 * jnp.finfo(dtype).eps)


@pytest.mark.parametrize("dtype", [jnp.float32, float])
def test_derivatives_of_the_shortened_vector(dtype):
    """Finite wherever it is; tested on what is used, the vector times the factor."""

    def shortened(point):
        return point[:3] * shortening(point[:3], point[3])

    # A spring yields by less than its limit in a step. Beyond this, squares leave the range of
    # single precision.
    farthest = np.inf if dtype is float else 1e7
    vectors = [*SCALES[:, None] * np.array([[3.0, 0.0, -4.0]]), np.zeros(3)]
    points = [
        [*vector, limit]
        for vector in vectors
        for limit in (0.0, *SCALES)
        if limit == 0.0 or np.linalg.norm(vector) <= farthest * limit
    ]
    points = jnp.asarray(points, dtype)
    for of in (
        jax.jacfwd(shortened),
        jax.jacrev(shortened),
        jax.jacfwd(jax.jacrev(shortened)),
        jax.jacfwd(jax.jacfwd(shortened)),
    ):
        assert jnp.isfinite(jax.jit(jax.vmap(of))(points)).all()
    # d/dv of L v/|v| is L (1 - n n)/|v|, d/dL is n, also where L = 0.
    at = jnp.asarray([3.0, 0.0, -4.0, 2.5], dtype)
    n = np.array([0.6, 0.0, -0.8])
    expected = np.concatenate([0.5 * (np.eye(3) - np.outer(n, n)), n[:, None]], axis=1)
    rounding = 4 * float(jnp.finfo(dtype).eps)
    np.testing.assert_allclose(jax.jacfwd(shortened)(at), expected, atol=rounding)
    for of in (jax.jacfwd(shortened), jax.jacrev(shortened)):
        np.testing.assert_allclose(of(at.at[3].set(0.0))[:, 3], n, atol=rounding)


# --- found again by the partner's id --------------------------------------------------------------

COUNT = 6


def listed(contacts, slots=6):
    """A list of these pairs, ids of firsts and seconds (walls from COUNT on), at shuffled places.

    Between and behind them are places that hold no pair, but look as if they did.
    """
    random = np.random.default_rng(len(contacts))
    room = len(contacts) + 4
    first, second = random.integers(0, COUNT, room), random.integers(0, COUNT + 6, room)
    place = random.permutation(room)[: len(contacts)]
    first[place], second[place] = np.transpose(contacts)
    places = np.full((slots, COUNT), 2 * room)
    for one in range(COUNT):
        ends = [*place[first[place] == one], *(room + place[second[place] == one])]
        places[: len(ends), one] = ends
    return Pairs(
        *(jnp.asarray(of, jnp.int32) for of in (first, second)),
        jnp.isin(jnp.arange(room), place),
        jnp.asarray(second >= COUNT),
        (jnp.zeros(room),) * 3,
        jnp.asarray(places, jnp.int32),
        jnp.zeros((), jnp.int32),
    )


LOWER_X, UPPER_Y, LOWER_Z, UPPER_Z = COUNT, COUNT + 3, COUNT + 4, COUNT + 5
CONTACTS = {
    (0, 3): 3.1,
    (0, 5): 5.1,
    (1, 4): 4.2,
    (1, 2): 2.2,
    (2, 5): 5.3,
    (0, LOWER_X): 0.7,
    (1, UPPER_Y): 0.8,
    (2, LOWER_Z): 0.9,
    (2, UPPER_Z): 0.6,
    (3, LOWER_Z): 0.5,
}
FACTORS = (1.0, 2.0, -1.0)  # of x, y and z


def values(contacts, found, elsewhere=0.0):
    """Of listed pairs, at their places."""
    value = np.full(len(found.present), elsewhere)
    for place in np.flatnonzero(found.present):
        value[place] = contacts[int(found.first[place]), int(found.second[place])]
    return value


def remembered(contacts):
    """The memory of listed pairs, with something else where no pair is present."""
    found = listed([*contacts])
    value = jnp.asarray(values(contacts, found, elsewhere=9.9))
    sliding = jnp.stack([factor * value for factor in FACTORS])
    return {"sliding": sliding, "rolling": 10.0 * sliding, "met": value}, found


def test_both_surfaces_note_what_a_contact_remembers():
    """The second has slid and rolled the opposite way; walls take no notes."""
    memory, found = remembered(CONTACTS)
    notes = contact_history.particles_from_pairs(memory, found)
    expected = [{} for _ in range(COUNT)]
    for (one, other), value in CONTACTS.items():
        expected[one][other if other < COUNT else WALLS[other - COUNT]] = value
        if other < COUNT:
            expected[other][one] = -value
    partner = np.asarray(notes.partner)
    for one, known in enumerate(expected):
        held = partner[:, one] != NOBODY
        assert sorted(partner[held, one]) == sorted(known)
        value = np.array([known[other] for other in partner[held, one].tolist()])
        for unit, vector in ((1.0, notes.memory["sliding"]), (10.0, notes.memory["rolling"])):
            for factor, part in zip(FACTORS, vector, strict=True):
                np.testing.assert_array_equal(part[held, one], unit * (factor * value))
                assert not part[~held, one].any()
    for name in memory:
        alone = contact_history.particles_from_pairs({name: memory[name]}, found)
        assert list(alone.memory) == [name]


def test_the_walls_have_six_ids_of_their_own():
    contacts = {(wall - COUNT, wall): 1.0 for wall in range(COUNT, COUNT + 6)}
    memory, found = remembered(contacts)
    notes = contact_history.particles_from_pairs(memory, found)
    # Lower and upper end of x, then of y, then of z.
    np.testing.assert_array_equal(jnp.min(notes.partner, axis=0), [-2, -3, -4, -5, -6, -7])
    assert WALLS == (-2, -3, -4, -5, -6, -7)


def test_a_new_list_finds_every_memory_again():
    """Columns are particles: slots permuted, a partner lost, one new, walls, an empty slot.

    Empty slots hold a value that must not be found.
    """
    old = jnp.array(
        [
            [3, 2, 5, -5, 1, -1],
            [5, 4, 1, 0, -1, 0],
            [-1, -5, -6, -1, -1, 2],
            [-2, -1, -7, -1, -1, -1],
        ],
        jnp.int32,
    )
    value = jnp.array(
        [
            [3.1, 2.2, 5.3, 0.5, -4.2, 9.9],
            [5.1, 4.2, -2.2, -3.1, 9.9, -5.1],
            [9.9, 0.8, 0.9, 9.9, 9.9, -5.3],
            [0.7, 9.9, 0.6, 9.9, 9.9, 9.9],
        ]
    )
    sliding = tuple(factor * value for factor in FACTORS)
    notes = ParticleHistory(old, {"sliding": sliding})
    contacts = {
        (5, 0): -5.1,  # 0 and 5, now seen from 5
        (4, 1): -4.2,
        (1, 2): 2.2,
        (0, 4): 0.0,  # new; 0 and 3 have parted
        (5, 2): -5.3,
        (0, LOWER_X): 0.7,
        (1, LOWER_Z): 0.0,  # new; 1 and the upper end of y have parted
        (2, LOWER_Z): 0.9,
        (3, UPPER_Y): 0.5,
    }
    new = listed([*contacts])
    memory = contact_history.pairs_from_particles(notes, new)
    np.testing.assert_array_equal(
        memory["sliding"], np.multiply.outer(FACTORS, values(contacts, new)), strict=True
    )
    assert list(memory) == ["sliding"]

    # What was not listed is forgotten for good.
    known = {(0, 5): 5.1, (1, 4): 4.2, (0, 3): 0.0, (1, UPPER_Y): 0.0, (2, UPPER_Z): 0.0}
    later = listed([*known])
    back = contact_history.pairs_from_particles(
        contact_history.particles_from_pairs(memory, new), later
    )["sliding"][0]
    np.testing.assert_array_equal(back, values(known, later))


def test_a_memory_survives_any_number_of_lists():
    """Noted and begun again, in lists of other order, with other room and seen from either end."""
    seen = [(other, one) if other < COUNT else (one, other) for one, other in CONTACTS]
    memory, found = remembered(CONTACTS)
    for order, slots in ((seen, 4), ([*CONTACTS], 9), (sorted(seen), 5)):
        notes = contact_history.particles_from_pairs(memory, found)
        found = listed(order, slots)
        memory = contact_history.pairs_from_particles(notes, found)
    opposite = {pair: CONTACTS.get(pair, -CONTACTS.get(pair[::-1], 0.0)) for pair in seen}
    expected = np.multiply.outer(FACTORS, values(opposite, found))
    np.testing.assert_array_equal(memory["sliding"], expected)
    np.testing.assert_array_equal(memory["rolling"], 10.0 * expected)
    # A number is the same from either side.
    same = {pair: CONTACTS.get(pair, CONTACTS.get(pair[::-1])) for pair in seen}
    np.testing.assert_array_equal(memory["met"], values(same, found))


# --- from run to run ------------------------------------------------------------------------------

STEP = 4e-6
FLOOR = WALLS[4]  # the lower end of z
BOX = mrjax.Box((8e-3, 8e-3, 12e-3), (True, True, False))
GRAINS = glass(
    radius=jnp.array([1.0, 0.8, 0.9, 1.0, 0.7, 1.0, 0.9]) * 1e-3,
    gravity=200.0,
    elastic_modulus=1e6,
    friction=0.4,
    restitution=0.6,
    rolling_friction=0.05,
    rolling_damping=0.2,
).astype(float)


def thrown():
    """A heap of seven, thrown onto the floor and across it."""
    position = [[2, 2, 1], [3.85, 2.2, 0.8], [3, 3.9, 0.9], [2.9, 2.7, 2.75], [4.7, 3.8, 0.7]]
    position += [[3.5, 2.9, 4.8], [1.2, 3.7, 3.5]]
    velocity = np.random.default_rng(1).normal(size=(7, 3)) * 0.1 + [0.2, 0.1, -0.4]
    spin = np.random.default_rng(2).normal(size=(7, 3)) * 100.0
    return mrjax.place(1e-3 * np.array(position), velocity, spin, contact_diameter=2e-3)


def go(state, steps, capacity=5):
    return mrjax.simulate(
        state,
        GRAINS,
        BOX,
        duration=steps * STEP,
        time_step=STEP,
        rebuild_every=10,
        capacity=capacity,
    ).state


def differences(state, other):
    """Largest of positions, velocities and spins, as fractions of the largest value."""
    return [
        float(jnp.max(jnp.abs(getattr(state, name) - getattr(other, name))))
        / float(jnp.max(jnp.abs(getattr(other, name))))
        for name in ("position", "velocity", "spin")
    ]


@pytest.fixture(scope="module")
def whole_and_cut():
    """A run of 1200 steps, and the state after every third of it."""
    first = go(thrown(), 400)
    second = go(first, 400)
    return go(thrown(), 1200), first, second, go(second, 400)


# Roundings, 1e-16, that some ten contacts have stretched.
SAME = 1e-12


def test_a_run_in_parts_is_the_run(whole_and_cut):
    whole, first, second, last = whole_and_cut
    for state in (first, second, last):
        partner = state.contacts.partner
        assert partner.shape == (7, 7)  # five particles, two walls
        held = jnp.any(state.contacts.sliding != 0.0, axis=2)
        assert (partner[held] != NOBODY).all()
        for met in (partner == FLOOR, partner >= 0):
            assert int((held & met).sum()) >= 2
        assert ((partner >= 0) | (partner == FLOOR) | (partner == NOBODY)).all()
    assert max(differences(last, whole)) < SAME
    np.testing.assert_array_equal(last.contacts.partner, whole.contacts.partner)
    for name, unit_of in (("sliding", 1e-3), ("rolling", 1.0)):
        found, expected = (getattr(state.contacts, name) for state in (last, whole))
        np.testing.assert_allclose(found, expected, atol=SAME * unit_of)
    # Contacts do matter there.
    forgetful = go(replace(second, contacts=None), 400)
    assert min(differences(forgetful, whole)) > 1e-6


def test_both_sides_of_a_contact_remember_the_opposite_and_roll_alike(whole_and_cut):
    contacts = whole_and_cut[1].contacts
    partner, sliding, rolling = (
        np.asarray(leaf) for leaf in (contacts.partner, contacts.sliding, contacts.rolling)
    )
    seen = 0
    for one, slot in zip(*np.nonzero(partner >= 0), strict=True):
        other = partner[one, slot]
        (back,) = np.flatnonzero(partner[other] == one)
        np.testing.assert_allclose(sliding[one, slot], -sliding[other, back], atol=1e-18)
        np.testing.assert_allclose(rolling[one, slot], -rolling[other, back], atol=1e-15)
        seen += np.any(sliding[one, slot] != 0.0)
    assert seen >= 2


def test_the_memory_moves_to_a_list_with_more_room(whole_and_cut):
    whole, first, *_ = whole_and_cut
    roomy = go(first, 400, capacity=6)
    assert roomy.contacts.partner.shape == (7, 8)
    last = go(roomy, 400)  # keeps the room that the memory needs
    assert last.contacts.partner.shape == (7, 8)
    assert max(differences(last, whole)) < SAME


def test_a_state_with_contacts_is_an_argument_of_jit(whole_and_cut):
    _, first, second, _ = whole_and_cut
    compiled = jax.jit(partial(go, steps=400))(first)
    assert max(differences(compiled, second)) < SAME


def test_without_friction_nothing_is_remembered():
    ball = mrjax.place([[4e-3, 4e-3, 1e-3]], [[0.1, 0.0, -0.1]])
    smooth = GRAINS.replace(radius=1e-3, friction=0.0, rolling_friction=0.0)
    assert mrjax.simulate(ball, smooth, BOX, duration=1e-5, time_step=1e-6).state.contacts is None


def test_a_spring_stretches_from_the_moment_of_contact():
    """Wherever in a step that is, and so says the derivative.

    For so few steps that the ball has lost but a thousandth of its velocities.
    """
    ball = GRAINS.replace(radius=1e-3, friction=50.0, rolling_friction=0.1, gravity=0.0)
    step, falls, slides = 1e-8, 0.1, 0.4

    def remembered(gap):
        height = jnp.array([[4e-3, 4e-3, 1e-3]]) + gap * jnp.array([[0.0, 0.0, 1.0]])
        start = mrjax.place(height, [[slides, 0.0, -falls]], [[0.0, 100.0, 0.0]])
        contacts = mrjax.simulate(
            start, ball, BOX, duration=8 * step, time_step=step
        ).state.contacts
        return contacts.sliding[0, 0, 0], contacts.rolling[0, 0, 1]

    for steps in (3.0, 3.1, 3.499, 3.6, 5.9):
        gap = steps * step * falls
        (slid, rolled), (by_slid, by_rolled) = jax.jvp(remembered, (gap,), (1.0,))
        touching = (7.5 - steps) * step  # up to the middle of the last step, where forces act
        slip = slides - 100.0 * 1e-3
        assert float(slid) == pytest.approx(slip * touching, rel=1e-3)
        assert float(rolled) == pytest.approx(100.0 * touching, rel=1e-3)
        assert float(by_slid) == pytest.approx(-slip / falls, rel=3e-3)
        assert float(by_rolled) == pytest.approx(-100.0 / falls, rel=3e-3)


def test_a_spinning_ball_takes_its_spring_halfway_along():
    """The spring is between ball and floor: about the normal it turns by the mean of their spins.

    So fast that the ball has hardly begun to swing on the spring, by 1e-2 of a period.
    """
    ball = GRAINS.replace(radius=1e-3, friction=5.0, rolling_friction=0.0, gravity=0.0)
    step, rate = 1e-8, 5e6
    stretch = jnp.array([[[1e-6, 0.0, 0.0]]])
    start = replace(
        mrjax.place([[4e-3, 4e-3, 0.99e-3]], spins=[[0.0, 0.0, rate]]),
        contacts=mrjax.Contacts(jnp.array([[FLOOR]], jnp.int32), stretch, None),
    )
    run = mrjax.simulate(start, ball, BOX, duration=20 * step, time_step=step)
    angle = 0.5 * rate * 20 * step
    expected = 1e-6 * np.array([np.cos(angle), np.sin(angle), 0.0])
    np.testing.assert_allclose(run.state.contacts.sliding[0, 0], expected, rtol=0, atol=1e-9)


def test_a_turning_pair_takes_its_spring_along():
    """In one step whose middle is where the forces act, turned by 0.02 rad and twisted by 0.01."""
    angle, twist, step, distance = 0.02, 0.01, 1e-7, 1.98e-3
    before = np.array([1.0, 0.0, 0.0])
    normal, tangent = rotated_about_z(before, angle), rotated_about_z([0.0, 1.0, 0.0], angle)
    velocity = distance * (normal - before) / step
    along = velocity - (velocity @ normal) * normal
    # Both spin so that nothing slips, and about the normal alike.
    spin = np.cross(normal, along) / distance + twist / step * normal
    apart = distance * 0.5 * (normal + before)  # half a step after the old normal, before the new
    slid = 1e-6 * np.array([[[0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0]]])
    pair = GRAINS.replace(radius=1e-3, friction=5.0, rolling_friction=0.0, restitution=1.0)
    start = replace(
        mrjax.place(
            4e-3 + 0.5 * np.stack([apart, -apart]),
            0.5 * np.stack([velocity, -velocity]),
            np.stack([spin, spin]),
        ),
        contacts=mrjax.Contacts(jnp.array([[1], [0]], jnp.int32), jnp.asarray(slid), None),
    )
    box = mrjax.Box((8e-3, 8e-3, 8e-3), (True, True, True))
    run = mrjax.simulate(start, pair, box, duration=step, time_step=step, skin=0.5)
    expected = 1e-6 * (np.cos(twist) * tangent + np.sin(twist) * np.cross(normal, tangent))
    # The products of three of the angles.
    found = np.asarray(run.state.contacts.sliding)[:, 0]
    np.testing.assert_allclose(found, [expected, -expected], rtol=0, atol=1e-5 * 1e-6)


def rotated_about_z(vector, angle):
    return rotated(np.array([vector]), np.array([[0.0, 0.0, 1.0]]), angle)[0]
