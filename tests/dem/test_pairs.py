"""Every contact once, walls included, against brute force; sums over pairs against plain loops.

The unit of length is the radius of a large particle.
"""

import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import mrjax
from mrjax import Box
from mrjax.dem import kinematics, neighbours, pairs
from mrjax.dem.kinematics import ParticleState
from mrjax.dem.neighbours import CELLS_OVERFULL, PAIRS_DROPPED, ListPlan
from mrjax.dem.pairs import Pairs
from mrjax.laws import normal
from tests.builders.particles import glass

MIXES = list(itertools.product((False, True), repeat=3))
SIZE = (5.3, 6.6, 9.9)
SKIN = 0.2
CUTOFF = 2.0 + SKIN
COUNT = 80
ROOMY = ListPlan(cutoff=CUTOFF, cell=CUTOFF, capacity=COUNT - 1, cell_capacity=COUNT, pairs=1200)


def of_suspension(plan: ListPlan, box: Box, position, radius) -> Pairs:
    """The pairs of positions (N, 3), as in a run."""
    found = neighbours.build(plan, box, position)
    return pairs.list_pairs(
        found, box, position.T, radius, jnp.full_like(radius, SKIN)[0], plan.pairs
    )


listing = jax.jit(of_suspension, static_argnames=("plan", "box"))


def scattered(box: Box, particles: int = COUNT, seed: int = 0) -> np.ndarray:
    """Some of them boxes away along periodic axes."""
    random = np.random.default_rng(seed)
    beyond = random.integers(-3, 4, (particles, 3)) * np.array(box.periodic)
    return (random.uniform(size=(particles, 3)) + beyond) * box.size


def sizes(particles: int = COUNT, seed: int = 0) -> np.ndarray:
    radius = np.random.default_rng(seed).uniform(0.2, 1.0, particles)
    radius[particles // 2] = 1.0
    return radius


def every_surface(box: Box, position: np.ndarray, radius: np.ndarray) -> dict:
    """From a particle and a partner's or wall's id, to the vector and the gap between them."""
    count, found = len(position), {}
    for one, other in itertools.combinations(range(count), 2):
        vector = position[one] - position[other]
        vector -= np.where(box.periodic, np.round(vector / box.size), 0.0) * box.size
        found[one, other] = vector, np.linalg.norm(vector) - radius[one] - radius[other]
    for one, axis, end in itertools.product(range(count), range(3), range(2)):
        if not box.periodic[axis]:
            vector = np.zeros(3)
            vector[axis] = position[one, axis] - end * box.size[axis]
            if vector[axis] == 0.0:  # on the wall: just inside
                vector[axis] = (-1.0 if end else 1.0) * normal.LEAST_DISTANCE * radius[one]
            found[one, count + 2 * axis + end] = vector, abs(vector[axis]) - radius[one]
    return found


def shown(listed: Pairs) -> list[tuple[int, int, int]]:
    """Place, first and second of all that are present."""
    (place,) = np.nonzero(np.asarray(listed.present))
    ends = (np.asarray(of)[place].tolist() for of in (listed.first, listed.second))
    return list(zip(place.tolist(), *ends, strict=True))


def check(box: Box, position, radius, listed: Pairs) -> set[tuple[int, int]]:
    """Compares a list with all pairs; what it holds."""
    # Rounding of coordinates of some tens, ten to a hundred units of least precision.
    rounding = 1e-13 if np.asarray(position).dtype == np.float64 else 1e-4
    assert int(listed.overflow) == 0
    held = [(first, second) for _, first, second in shown(listed)]
    assert len(held) == len(set(held)), "a pair is listed twice"
    every = every_surface(box, np.asarray(position, float), np.asarray(radius, float))
    must = {pair for pair, (_, gap) in every.items() if gap < SKIN - rounding}
    may = {pair for pair, (_, gap) in every.items() if gap < SKIN + rounding}
    assert must <= set(held), f"missing: {sorted(must - set(held))[:5]}"
    assert set(held) <= may, f"no pair, or too far apart: {sorted(set(held) - may)[:5]}"

    particles = len(position)
    separation = np.stack(listed.separation, axis=1)
    for place, first, second in shown(listed):
        vector, _ = every[first, second]
        np.testing.assert_allclose(separation[place], vector, rtol=0, atol=rounding)
    if not box.walled_axes:
        assert listed.wall is None and (listed.axis == -1)[listed.present].all()
    else:
        walls = np.asarray(listed.second) >= particles
        np.testing.assert_array_equal(listed.wall, walls)
        along = (np.asarray(listed.second) - particles) // 2
        np.testing.assert_array_equal(listed.axis, np.where(walls, along, -1))
    return set(held)


# --- who is listed --------------------------------------------------------------------------------


@pytest.mark.parametrize("periodic", MIXES, ids=str)
def test_every_near_pair_once_and_no_far_one(periodic):
    box = Box(SIZE, periodic)
    position, radius = scattered(box), sizes()
    held = check(box, position, radius, listing(ROOMY, box, position, radius))
    # It is the gap that counts, not the distance of the centres.
    distance = {
        pair: np.linalg.norm(vector)
        for pair, (vector, _) in every_surface(box, position, radius).items()
        if pair[1] < COUNT
    }
    listed = {pair for pair in held if pair[1] < COUNT}
    nearest_left_out = min(distance[pair] for pair in distance.keys() - listed)
    assert max(distance[pair] for pair in listed) > 1.5 * nearest_left_out
    # Both ends of every walled axis, and none of a periodic one.
    walls = {second - COUNT for _, second in held if second >= COUNT}
    assert walls == {2 * axis + end for axis in box.walled_axes for end in (0, 1)}


@pytest.mark.parametrize("periodic", [(False,) * 3, (True, False, True), (True,) * 3], ids=str)
def test_single_precision(periodic):
    box = Box(SIZE, periodic)
    position, radius = (
        jnp.asarray(of, jnp.float32) for of in (scattered(box, seed=3), sizes(seed=3))
    )
    for x64 in (True, False):  # and as JAX is when nobody has set it
        with jax.enable_x64(x64):
            listed = listing(ROOMY, box, position, radius)
        check(box, position, radius, listed)
        assert {of.dtype for of in listed.separation} == {np.dtype(np.float32)}
        whole = (listed.first, listed.second, listed.axis, listed.places, listed.overflow)
        assert {of.dtype for of in whole} == {np.dtype(np.int32)}


@pytest.mark.parametrize("axis", range(3))
def test_both_walls_of_a_narrow_axis(axis):
    """Hardly wider than a particle: all of them are near both walls."""
    size = np.full(3, 12.0)
    size[axis] = 2.05
    box = Box(tuple(size), (False, False, False))
    position = scattered(box, 12, seed=4)
    position[:, axis] = np.random.default_rng(4).uniform(0.95, 1.1, 12)
    radius = np.full(12, 1.0)
    plan = replace(ROOMY, capacity=11, cell_capacity=12)
    held = check(box, position, radius, listing(plan, box, position, radius))
    both = {(one, 12 + 2 * axis + end) for one in range(12) for end in (0, 1)}
    assert both <= held


FEW = 10
EVERY_PAIR = FEW * (FEW - 1) // 2 + 6 * FEW
coordinates = st.one_of(
    st.floats(-2.0, 3.0, width=32),
    st.sampled_from([-1.0, 0.0, 0.25, 1 / 3, 0.5, 2 / 3, 0.75, 1.0, 2.0]),
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    fraction=arrays.arrays(np.float64, (FEW, 3), elements=coordinates),
    radius=arrays.arrays(
        np.float64, FEW, elements=st.sampled_from([0.1, 0.5, 1.0]) | st.floats(0.01, 1.0)
    ),
    periodic=st.sampled_from(MIXES),
)
def test_any_positions_and_sizes_at_all(fraction, radius, periodic):
    """Also coincident, on faces, and boxes away along periodic axes."""
    box = Box((5.3, 6.6, 4.5), periodic)
    fraction = np.where(box.periodic, fraction, np.clip(fraction, 0.0, 1.0))
    plan = replace(ROOMY, capacity=FEW - 1, cell_capacity=FEW, pairs=EVERY_PAIR)
    position = fraction * np.array(box.size)
    check(box, position, radius, listing(plan, box, position, radius))


def test_there_is_room_for_every_pair():
    """All in one place, in a box that each of them fills: N (N - 1) / 2 and six walls each."""
    box = Box((2.1, 2.1, 2.1))
    position, radius = np.full((FEW, 3), 1.05), np.full(FEW, 1.0)
    plan = neighbours.plan_list(box, FEW, 2.0, 2.0, SKIN)
    for _ in range(20):
        plan = plan.grown(PAIRS_DROPPED | CELLS_OVERFULL, FEW)
    assert plan.pairs == EVERY_PAIR
    assert len(check(box, position, radius, listing(plan, box, position, radius))) == EVERY_PAIR


def test_vmap_gives_each_suspension_its_own_pairs():
    box = Box(SIZE, (True, False, False))
    position, radius = (
        np.stack([of(seed) for seed in (5, 6)])
        for of in (lambda seed: scattered(box, seed=seed), lambda seed: sizes(seed=seed))
    )
    each = jax.jit(jax.vmap(lambda *of: of_suspension(ROOMY, box, *of)))(position, radius)
    for row in range(2):
        listed = jax.tree.map(lambda leaf, row=row: leaf[row], each)
        check(box, position[row], radius[row], listed)


# --- little room, and little to put there ---------------------------------------------------------


@pytest.mark.slow
def test_too_little_room_is_flagged_and_mended():
    box = Box(SIZE, (True, False, False))
    position, radius = scattered(box, seed=7), sizes(seed=7)
    held = check(box, position, radius, listing(ROOMY, box, position, radius))
    exact = replace(ROOMY, pairs=len(held))
    assert check(box, position, radius, listing(exact, box, position, radius)) == held
    for missing in (1, len(held) - 1, len(held) // 2):
        plan = replace(ROOMY, pairs=len(held) - missing)
        listed = listing(plan, box, position, radius)
        assert int(listed.overflow) == PAIRS_DROPPED
        assert {(first, second) for _, first, second in shown(listed)} < held
    while int(listed.overflow):
        assert plan.pairs < len(held)
        grown = plan.grown(int(listed.overflow), COUNT)
        assert grown.pairs > plan.pairs
        plan = grown
        listed = listing(plan, box, position, radius)
    assert check(box, position, radius, listed) == held


@pytest.mark.parametrize("short", [dict(capacity=3), dict(cell_capacity=3)], ids=str)
@pytest.mark.parametrize("room", [1200, 8])
def test_what_the_neighbour_list_lacks_is_passed_on(short, room):
    box = Box(SIZE, (True, False, False))
    position, radius = scattered(box, seed=7), sizes(seed=7)
    found = neighbours.build(replace(ROOMY, **short), box, jnp.asarray(position))
    flag = CELLS_OVERFULL if "cell_capacity" in short else PAIRS_DROPPED
    assert int(found.overflow) & flag
    plan = replace(ROOMY, **short, pairs=room)
    overflow = int(listing(plan, box, position, radius).overflow)
    assert overflow == int(found.overflow) | (PAIRS_DROPPED if room == 8 else 0)


def check_empty(listed: Pairs, particles: int) -> None:
    """Nothing is present, and sums over nothing are nothing."""
    assert not listed.present.any() and int(listed.overflow) == 0
    zero = jnp.zeros(len(listed.present))
    np.testing.assert_array_equal(listed.sum_over_pairs(zero, zero), np.zeros(particles))
    np.testing.assert_array_equal(listed.greatest(zero - 1.0), np.zeros(particles))
    assert (listed.by_particle(zero + 1.0, zero + 1.0, nothing=-7.0) == -7.0).all()
    for part in listed.separation:
        assert part.shape == zero.shape and jnp.isfinite(part).all()


@pytest.mark.parametrize("periodic", [(True,) * 3, (True, False, True), (False,) * 3], ids=str)
def test_particles_far_from_all_have_no_pairs(periodic):
    box = Box((8.0, 8.0, 8.0), periodic)
    position = np.array([[2.0, 2.0, 2.0], [6.0, 6.0, 2.0], [2.0, 6.0, 6.0]])
    plan = neighbours.plan_list(box, 3, 2.0, 2.0, SKIN)
    listed = listing(plan, box, position, np.ones(3))
    assert check(box, position, np.ones(3), listed) == set()
    check_empty(listed, 3)


@pytest.mark.parametrize("periodic", MIXES, ids=str)
def test_a_single_particle_meets_walls_alone(periodic):
    box = Box((4.0, 5.0, 6.0), periodic)
    plan = neighbours.plan_list(box, 1, 2.0, 2.0, SKIN)
    radius = np.ones(1)
    corner = np.array([[1.1, 3.95, 0.9]])
    held = check(box, corner, radius, listing(plan, box, corner, radius))
    expected = {(0, 1), (0, 4), (0, 5)}  # lower x, upper y, lower z
    assert held == {(0, wall) for _, wall in expected if not periodic[(wall - 1) // 2]}
    middle = np.array([[2.0, 2.5, 3.0]])
    check_empty(listing(plan, box, middle, radius), 1)


def test_a_single_particle_in_a_periodic_box_flies_on():
    """Nobody to meet, nothing to remember, no wall."""
    box = Box((1e-2, 1e-2, 1e-2), (True, True, True))
    ball = glass(friction=0.5, rolling_friction=0.1).astype(float)
    state = mrjax.place([[5e-3, 5e-3, 5e-3]], [[3.0, -2.0, 1.0]], [[100.0, 0.0, 50.0]])
    run = mrjax.simulate(state, ball, box, duration=5e-3, time_step=1e-5)
    # Roundings of 500 steps.
    expected = [[20e-3, -5e-3, 10e-3]]
    np.testing.assert_allclose(run.state.position, expected, rtol=0, atol=500 * 4e-18)
    np.testing.assert_allclose(run.state.spin, state.spin, rtol=1e-15)  # there and back in units
    force, torque = mrjax.contact_forces(state, ball, box)
    assert force.shape == torque.shape == (1, 3)
    assert not force.any() and not torque.any()


# --- sums over pairs, against plain loops ---------------------------------------------------------

TRAY = Box(SIZE, (True, False, False))


@pytest.fixture(scope="module")
def crowd() -> Pairs:
    """With places that hold no pair."""
    listed = listing(ROOMY, TRAY, scattered(TRAY, seed=9), sizes(seed=9))
    assert 100 < int(listed.present.sum()) < 1100
    assert int((listed.wall & listed.present).sum()) > 20
    return listed


@pytest.fixture(scope="module")
def values(crowd) -> tuple[np.ndarray, np.ndarray]:
    """For both sides of every pair; 0 where there is none, as the laws give."""
    both = np.random.default_rng(10).normal(size=(2, len(crowd.present)))
    return tuple(np.where(crowd.present, both, 0.0))


ROUNDING = 1e-14  # of sums of some ten terms of order one


def test_summed(crowd, values):
    mine, theirs = values
    together = np.zeros(COUNT)
    for place, first, second in shown(crowd):
        together[first] += mine[place]
        if second < COUNT:
            together[second] += theirs[place]
    found = crowd.sum_over_pairs(jnp.asarray(mine), jnp.asarray(theirs))
    np.testing.assert_allclose(found, together, rtol=0, atol=ROUNDING)


def test_deepest(crowd):
    """The least that counts is 0; where no pair is present, overlaps are negative."""
    overlap = np.random.default_rng(11).normal(size=len(crowd.present)) - 0.5
    overlap = np.where(crowd.present, overlap, -0.1)
    expected = np.zeros(COUNT)
    for place, first, second in shown(crowd):
        expected[first] = max(expected[first], overlap[place])
        if second < COUNT:
            expected[second] = max(expected[second], overlap[place])
    np.testing.assert_array_equal(crowd.greatest(jnp.asarray(overlap)), expected)
    assert (expected == 0).any() and (expected > 0).sum() > COUNT / 2


def test_seen(crowd):
    """In one slot of each particle the same pair, whatever is asked for; others are empty."""
    mine, theirs = np.random.default_rng(12).normal(size=(2, len(crowd.present)))  # all places
    expected = [[] for _ in range(COUNT)]
    for place, first, second in shown(crowd):
        expected[first].append((second, mine[place]))
        if second < COUNT:
            expected[second].append((first, theirs[place]))
    partner = np.asarray(crowd.by_particle(crowd.second, crowd.first, nothing=-9))
    value = np.asarray(crowd.by_particle(jnp.asarray(mine), jnp.asarray(theirs)))
    assert partner.shape == value.shape == (ROOMY.capacity + 4, COUNT)  # two walled axes
    assert partner.dtype == crowd.first.dtype
    for one in range(COUNT):
        held = partner[:, one] != -9
        np.testing.assert_array_equal(value[~held, one], 0.0)
        found = zip(partner[held, one].tolist(), value[held, one].tolist(), strict=True)
        assert sorted(found) == sorted(expected[one])


def separated(listed, displacement):
    """The separations after displacements (3, N), as the forces see them."""
    mine = tuple(part[listed.first] for part in displacement)
    theirs = tuple(part.at[listed.second].get(mode="fill", fill_value=0.0) for part in displacement)
    moved = (ParticleState(way, None, None, None, None) for way in (mine, theirs))
    return kinematics.separation(*moved, listed.separation, listed.axis)


def test_separated(crowd):
    """Walls stay, and what moves along one comes no nearer."""
    moved = np.random.default_rng(14).normal(size=(3, COUNT))
    found = separated(crowd, jnp.asarray(moved))
    for axis, (place, first, second) in itertools.product(range(3), shown(crowd)):
        partner = moved[axis, second] if second < COUNT else 0.0
        counts = second < COUNT or (second - COUNT) // 2 == axis
        change = moved[axis, first] - partner if counts else 0.0
        expected = crowd.separation[axis][place] + change
        np.testing.assert_allclose(found[axis][place], expected, rtol=0, atol=ROUNDING)


def test_separations_after_a_way_are_those_of_a_new_list(crowd):
    radius, old = sizes(seed=9), scattered(TRAY, seed=9)
    new = old + np.random.default_rng(15).uniform(-0.15, 0.15, (COUNT, 3))
    moved = np.stack(separated(crowd, jnp.asarray((new - old).T)), axis=1)
    again = listing(ROOMY, TRAY, new, radius)
    separation = np.stack(again.separation, axis=1)
    expected = {(first, second): separation[place] for place, first, second in shown(again)}
    found = {(first, second): moved[place] for place, first, second in shown(crowd)}
    both = found.keys() & expected.keys()
    assert 0.7 * len(found) < len(both) < len(found)
    for pair in both:
        np.testing.assert_allclose(found[pair], expected[pair], rtol=0, atol=10 * ROUNDING)


# --- derivatives ----------------------------------------------------------------------------------


@pytest.mark.parametrize("periodic", [(True, False, False), (True,) * 3], ids=str)
def test_derivatives_of_what_is_summed(periodic):
    """Of squares of the separations, weighed; by positions as by what has been travelled since."""
    box = Box(SIZE, periodic)
    position, radius = (jnp.asarray(of) for of in (scattered(box, seed=16), sizes(seed=16)))
    both_weights = np.random.default_rng(17).normal(size=(2, 3, COUNT))
    travelled = 0.01 * np.random.default_rng(18).normal(size=(COUNT, 3))

    @jax.jit
    def weighed(position, travelled):
        listed = of_suspension(ROOMY, box, position, radius)
        total = 0.0
        for axis, part in enumerate(separated(listed, travelled.T)):
            square = jnp.where(listed.present, part**2, 0.0)
            total += both_weights[0, axis] @ listed.sum_over_pairs(square, 3.0 * square)
            total += both_weights[1, axis] @ listed.sum_over_pairs(square, -square)
        return total

    listed = listing(ROOMY, box, position, radius)
    apart = np.stack(separated(listed, jnp.asarray(travelled.T)), axis=1)
    expected = np.zeros((COUNT, 3))
    for place, first, second in shown(listed):
        weight = both_weights[0, :, first] + both_weights[1, :, first]
        if second < COUNT:
            weight = weight + 3.0 * both_weights[0, :, second] - both_weights[1, :, second]
            expected[second] -= 2.0 * apart[place] * weight
        # Along a wall the separation is 0, and so is the derivative.
        expected[first] += 2.0 * apart[place] * weight
    assert np.abs(expected).max() > 1.0
    for argument in (0, 1):
        gradient = jax.grad(weighed, argument)(position, travelled)
        # Roundings of sums of some twenty terms of order ten.
        np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-12)
    directions = np.random.default_rng(19).normal(size=(2, COUNT, 3))
    _, along = jax.jvp(weighed, (position, jnp.asarray(travelled)), tuple(jnp.asarray(directions)))
    np.testing.assert_allclose(along, np.sum(expected * directions.sum(axis=0)), rtol=1e-12)
