"""The neighbour list against all pairs, wherever jax-md's own list would lose some.

The unit of length is the radius of a particle.
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

from mrjax import Box
from mrjax.dem import neighbours
from mrjax.dem.neighbours import CELLS_OVERFULL, PAIRS_DROPPED, ListPlan
from mrjax.simulation.disperse import spread

build = jax.jit(neighbours.build, static_argnames=("plan", "box"))

MIXES = list(itertools.product((False, True), repeat=3))
# Wide enough for its own cells along z, three cells made of y, and x narrower than three cells.
SIZE = (5.3, 6.6, 15.0)
CUTOFF = 2.2
ROOMY = ListPlan(cutoff=CUTOFF, cell=CUTOFF, capacity=60, cell_capacity=24, pairs=480)


def nearest(box: Box, position: np.ndarray) -> np.ndarray:
    """Vectors between all particles, from the second index to the first; (N, N, 3)."""
    vector = position[:, None, :] - position[None, :, :]
    size, periodic = np.array(box.size), np.array(box.periodic)
    return vector - np.where(periodic, size * np.round(vector / size), 0.0)


def check(plan: ListPlan, box: Box, position, dtype=np.float64) -> neighbours.Neighbours:
    """Lists the pairs, and compares with all of them."""
    position = np.asarray(position, dtype)
    listed = build(plan, box, jnp.asarray(position))
    assert int(listed.overflow) == 0
    compare(plan, box, position, listed)
    return listed


def compare(plan: ListPlan, box: Box, position: np.ndarray, listed: neighbours.Neighbours) -> None:
    slots, present = np.asarray(listed.partner), np.asarray(listed.present)
    _, particle = np.nonzero(present)
    found = list(zip(particle.tolist(), slots[present].tolist(), strict=True))
    assert len(found) == len(set(found)), "a pair is listed twice"
    assert all(one != other for one, other in found), "a particle is its own partner"

    # Rounding of coordinates, ten to a thousand units of least precision of the box.
    rounding = (1e-12 if position.dtype == np.float64 else 1e-5) * max(1.0, max(box.size) / 10)
    vector = nearest(box, position.astype(np.float64))
    distance = np.linalg.norm(vector, axis=-1)
    np.fill_diagonal(distance, np.inf)
    must = set(zip(*np.nonzero(distance < plan.cutoff - rounding), strict=True))
    may = set(zip(*np.nonzero(distance < plan.cutoff + rounding), strict=True))
    assert must <= set(found), f"missing: {sorted(must - set(found))[:5]}"
    assert set(found) <= may, f"too far apart: {sorted(set(found) - may)[:5]}"

    # Vectors point from partner to particle, to an image that no other is nearer than.
    separation = np.stack([np.asarray(component)[present] for component in listed.separation], -1)
    assert separation.dtype == position.dtype
    reached = np.linalg.norm(separation, axis=-1)
    np.testing.assert_allclose(reached, distance[particle, slots[present]], atol=rounding)
    plain = position[particle] - position[slots[present]]
    boxes_between = (separation - plain) / np.array(box.size)
    np.testing.assert_allclose(boxes_between, np.round(boxes_between), atol=rounding)
    np.testing.assert_allclose(boxes_between[:, list(box.walled_axes)], 0.0, atol=rounding)


def scattered(box: Box, particles: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(size=(particles, 3)) * box.size


@pytest.mark.parametrize("periodic", MIXES, ids=str)
def test_random_positions_in_any_mix_of_axes(periodic):
    box = Box(SIZE, periodic)
    position = scattered(box, 120)
    check(ROOMY, box, position)

    # A run lets positions go on beyond the box along periodic axes: lists must not lose them.
    beyond = np.random.default_rng(1).integers(-3, 4, (120, 3)) * np.array(box.periodic)
    check(ROOMY, box, position + beyond * np.array(box.size))

    # On faces, and on the boundaries between cells, from either side.
    cells = np.floor(np.array(SIZE) / CUTOFF)
    corner = np.random.default_rng(2).integers(0, 8, (120, 3)) % (cells + 1)
    edge = corner * np.array(SIZE) / cells
    check(ROOMY, box, np.minimum(edge, SIZE) + 1e-3 * (position - np.array(SIZE) / 2) / SIZE)
    side = np.random.default_rng(3).integers(-1, 2, (120, 3))
    nudged = np.where(side < 0, np.nextafter(edge, -1), np.where(side > 0, edge, edge + 1e-15))
    spread = position[:, :1] * 1e-2 * np.eye(3)[np.arange(120) % 3]
    check(ROOMY, box, nudged + spread)


@pytest.mark.parametrize("periodic", [(False, False, False), (True, False, True), (True,) * 3])
def test_single_precision(periodic):
    box = Box(SIZE, periodic)
    listed = check(ROOMY, box, scattered(box, 120), np.float32)
    assert listed.partner.dtype == np.int32
    with jax.enable_x64(False):  # as JAX is when nobody has set it
        check(ROOMY, box, scattered(box, 120, seed=5), np.float32)


@pytest.mark.parametrize("walls", [True, False], ids=["walled", "periodic"])
@pytest.mark.parametrize("diameters", [1.2, 2.0, 3.5])
def test_narrow_columns(diameters, walls):
    width = 2 * diameters
    box = Box((width, width, 120.0), (not walls, not walls, False))
    particles = int(0.3 * box.volume / 4.19)
    plan = neighbours.plan_list(box, particles, 2.0, 2.0, 0.2)
    check(replace(plan, capacity=60, cell_capacity=24), box, scattered(box, particles))


@pytest.mark.parametrize("particles", [1, 2, 3])
def test_a_handful_of_particles(particles):
    box = Box((6.0, 6.0, 6.0), (True, False, False))
    plan = neighbours.plan_list(box, particles, 2.0, 2.0, 0.2)
    position = np.array([[0.5, 3.0, 3.0], [5.5, 3.0, 3.0], [1.5, 3.0, 3.5]])[:particles]
    listed = check(plan, box, position)
    # All are partners of all, across the periodic face.
    assert listed.partner.shape == (particles - 1, particles)
    assert int(listed.present.sum()) == particles * (particles - 1)


def test_a_pair_apart_has_no_partners():
    box = Box((6.0, 6.0, 6.0))
    listed = check(
        neighbours.plan_list(box, 2, 2.0, 2.0, 0.2), box, [[0.5, 3.0, 3.0], [5.5, 3.0, 3.0]]
    )
    assert not listed.present.any()


@pytest.fixture(scope="module")
def dense_bed():
    """A relaxed random packing, pressed to a volume fraction of 0.6."""
    box = Box((9.0, 9.0, 13.0), (True, True, True))
    particles = int(0.45 * box.volume / (4 / 3 * np.pi))
    position = spread(jax.random.key(3), box, jnp.ones(particles))
    assert position is not None
    pressed = (0.45 / 0.6) ** (1 / 3)
    return box.scaled(pressed), position * pressed


def test_a_dense_random_packing_fits_in_the_list_as_planned(dense_bed):
    box, position = dense_bed
    for skin in (0.0, 0.2, 0.8):
        plan = neighbours.plan_list(box, position.shape[0], 2.0, 2.0, skin)
        listed = check(plan, box, position)
        assert int(listed.present.sum()) // 2 <= plan.pairs
        # Dense indeed: most particles have more than half a shell of twelve around them.
        assert float(listed.present.sum(0).mean()) > (6 if skin else 5)


def test_the_smallest_gap_is_that_of_all_pairs(dense_bed):
    box, position = dense_bed
    plan = neighbours.plan_list(box, position.shape[0], 2.0, 2.0, 0.2)
    radius = np.random.default_rng(0).uniform(0.5, 1.0, position.shape[0])
    distance = np.linalg.norm(nearest(box, np.asarray(position)), axis=-1)
    np.fill_diagonal(distance, np.inf)
    listed = distance < plan.cutoff
    gaps = np.where(listed, distance - radius[:, None] - radius[None, :], np.inf)
    found = neighbours.smallest_gap(build(plan, box, position), jnp.asarray(radius))
    np.testing.assert_allclose(float(found), gaps.min(), rtol=1e-12)


@pytest.mark.parametrize("pressed", [1.0, 0.95])
def test_the_densest_lattice_fits_in_the_list_as_planned(pressed):
    edge = 2 * np.sqrt(2) * pressed
    cells = (3, 4, 5)
    corners = np.array(list(itertools.product(*map(range, cells))))
    basis = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])
    position = (corners[:, None, :] + basis).reshape(-1, 3) * edge
    box = Box(tuple(edge * count for count in cells), (True, True, True))
    plan = neighbours.plan_list(box, len(position), 2.0, 2.0, 0.2)
    for offset in (0.0, 0.01, 0.3):
        listed = check(plan, box, position + offset)
        # Each sphere of a face-centred cubic lattice touches twelve.
        np.testing.assert_array_equal(listed.present.sum(0), 12)


def test_particles_of_two_sizes_fit_in_the_list_as_planned():
    box = Box((9.0, 9.0, 14.0), (True, False, False))
    radius = np.where(np.arange(150) % 2, 1.0, 0.6)
    position = spread(jax.random.key(0), box, jnp.asarray(radius))
    assert position is not None
    check(neighbours.plan_list(box, 150, 2.0, 1.2, 0.2), box, position)


@pytest.mark.parametrize(
    ("short", "flag"),
    [
        (replace(ROOMY, capacity=8), PAIRS_DROPPED),
        (replace(ROOMY, cell_capacity=4), CELLS_OVERFULL),
        (replace(ROOMY, capacity=5, cell_capacity=4), PAIRS_DROPPED | CELLS_OVERFULL),
    ],
)
def test_too_little_room_is_flagged_and_mended(short, flag):
    box = Box(SIZE, (True, False, False))
    position = scattered(box, 120)
    listed = build(short, box, jnp.asarray(position))
    assert int(listed.overflow) == flag
    plan = short
    for _ in range(12):
        overflow = int(listed.overflow)
        if not overflow:
            break
        grown = plan.grown(overflow, 120)
        # Room is made where it was lacking, and nowhere else.
        assert (grown.capacity > plan.capacity) == bool(overflow & PAIRS_DROPPED)
        assert (grown.pairs > plan.pairs) == bool(overflow & PAIRS_DROPPED)
        assert (grown.cell_capacity > plan.cell_capacity) == bool(overflow & CELLS_OVERFULL)
        plan = grown
        listed = build(plan, box, jnp.asarray(position))
    compare(plan, box, position, listed)
    assert int(listed.overflow) == 0


@pytest.mark.parametrize("skin", [0.0, 0.2, 0.8])
@pytest.mark.parametrize("particles", [1, 2, 5, 9, 40, 1000])
def test_planned_room_for_contacts(particles, skin):
    """What a settled bed needs, and never more than there can be, where that is more than a few."""
    for periodic in MIXES:
        found = neighbours.plan_list(Box(SIZE, periodic), particles, 2.0, 2.0, skin).pairs
        every = particles * (particles - 1) // 2 + 2 * periodic.count(False) * particles
        assert min(every, 3 * particles) <= found <= max(8, every)
        # The densest lattice has six contacts for each, and a second shell from 0.4 diameters on.
        assert found <= max(100, (9 if skin > 0.7 else 6) * particles)


def test_growth_ends_where_no_list_can_overflow():
    plan = ROOMY
    for _ in range(10):
        plan = plan.grown(PAIRS_DROPPED | CELLS_OVERFULL, 100)
    assert (plan.capacity, plan.cell_capacity) == (99, 100)
    assert plan.pairs == 100 * 99 // 2 + 6 * 100  # all with all and with six walls
    assert ROOMY.grown(0, 100) == ROOMY


def test_no_room_at_all_is_flagged():
    box = Box((6.0, 6.0, 6.0))
    touching = jnp.array([[3.0, 3.0, 3.0], [4.5, 3.0, 3.0]])
    assert int(build(replace(ROOMY, capacity=0), box, touching).overflow) & PAIRS_DROPPED


def largest_array(plan: ListPlan, box: Box, particles: int) -> int:
    """Elements of the largest array anywhere in the computation of a list."""

    def sizes(jaxpr):
        for equation in jaxpr.eqns:
            yield from (variable.aval.size for variable in equation.outvars)
            for value in jax.tree.leaves(list(equation.params.values())):
                inner = getattr(value, "jaxpr", value)
                if hasattr(inner, "eqns"):
                    yield from sizes(inner)

    position = jax.ShapeDtypeStruct((particles, 3), np.float64)
    traced = jax.make_jaxpr(lambda position: neighbours.build(plan, box, position))(position)
    return max(sizes(traced.jaxpr))


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("diameters", [1.2, 2.9])
def test_narrow_columns_do_not_fall_back_to_all_pairs(diameters, periodic):
    largest = {}
    for particles in (2000, 4000):
        width = 2 * diameters
        height = particles * 4.19 / 0.3 / width**2
        box = Box((width, width, height), (periodic, periodic, False))
        plan = neighbours.plan_list(box, particles, 2.0, 2.0, 0.2)
        largest[particles] = largest_array(plan, box, particles)
    # Vectors to all particles would be 3 N^2 elements, four times as many for twice as many.
    assert largest[2000] < 2000**2 / 3
    assert largest[4000] < 2.1 * largest[2000]


def test_a_tall_narrow_column_of_2000():
    box = Box((2.4, 2.4, 4900.0), (True, False, False))
    check(neighbours.plan_list(box, 2000, 2.0, 2.0, 0.2), box, scattered(box, 2000))


def test_vmap_gives_each_suspension_its_own_list():
    box = Box(SIZE, (True, False, False))
    position = np.stack([scattered(box, 120, seed) for seed in (6, 7)])
    build_each = jax.jit(jax.vmap(lambda position: neighbours.build(ROOMY, box, position)))
    lists = build_each(jnp.asarray(position))
    for row in range(2):
        compare(ROOMY, box, position[row], jax.tree.map(lambda leaf, row=row: leaf[row], lists))
    crowded = np.stack([position[0], position[0] * 0.2])
    overflow = build_each(jnp.asarray(crowded)).overflow
    assert int(overflow[0]) == 0
    assert int(overflow[1]) != 0


def test_derivatives_of_separations_are_central_differences():
    box = Box(SIZE, (True, False, True))
    position = jnp.asarray(scattered(box, 120, seed=8) - 2.0)  # some of them outside

    @jax.jit
    def energy(position):
        listed = neighbours.build(ROOMY, box, position)
        weights = (0.3, 1.0, -0.7)
        shown = jnp.where(listed.present, 1.0, 0.0)
        return sum(
            jnp.sum(shown * weight * component**2)
            for weight, component in zip(weights, listed.separation, strict=True)
        )

    gradient = jax.jit(jax.grad(energy))(position)
    assert np.isfinite(gradient).all()
    step = 1e-5  # no pair is that near the cutoff, and the energy is a parabola between
    for row, axis in itertools.product((0, 17, 60, 119), range(3)):
        move = jnp.zeros_like(position).at[row, axis].set(step)
        difference = (energy(position + move) - energy(position - move)) / (2 * step)
        # Rounding of an energy of order 1e3 over the step.
        np.testing.assert_allclose(gradient[row, axis], difference, atol=1e-6)
    assert np.abs(gradient).max() > 1.0


PARTICLES = 12
coordinates = st.one_of(
    st.floats(-2.0, 3.0, width=32),
    st.sampled_from([-1.0, 0.0, 0.25, 1 / 3, 0.5, 2 / 3, 0.75, 1.0, 2.0]),
)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    fraction=arrays.arrays(np.float64, (PARTICLES, 3), elements=coordinates),
    periodic=st.sampled_from([(True, True, True), (True, False, False), (False, False, False)]),
)
def test_any_positions_at_all(fraction, periodic):
    """Also coincident, on faces and cell boundaries, and boxes away along periodic axes."""
    box = Box((5.3, 6.6, 9.9), periodic)
    fraction = np.where(box.periodic, fraction, np.clip(fraction, 0.0, 1.0))
    plan = replace(ROOMY, capacity=PARTICLES - 1, cell_capacity=PARTICLES)
    check(plan, box, fraction * np.array(box.size))
