"""Attraction of surfaces: exact forces, rest, a hanging chain, impacts, and derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.dem.force_bounds import force_bounds, plan_reach
from mrjax.dem.forces import ActiveLaws, Contact, VanDerWaals, active_forces
from mrjax.dem.kinematics import ParticleState, pair_kinematics
from mrjax.dem.plan import System
from mrjax.figures.contacts import force_chains
from mrjax.laws import attraction as attraction_law
from mrjax.laws import effective, normal
from mrjax.laws.attraction import CUT_OFF, attraction
from tests.builders.particles import DRY, glass

near = partial(pytest.approx, abs=0.0)
RADIUS, LAYER, PULL_OFF = 1e-3, 1e-6, 1e-4
ROOM = mrjax.Box((1e-2, 1e-2, 1e-2))
MIDDLE = 5e-3
HAMAKER = PULL_OFF * 12.0 * (2.0 * LAYER) ** 2 / RADIUS
"""Of two spheres with layers of `LAYER`, whose pull-off force is `PULL_OFF`."""


def sticky(**changes):
    """Beads of glass that attract each other by `PULL_OFF`."""
    leaves = dict(hamaker=HAMAKER, layer_thickness=LAYER)
    return glass(**(leaves | changes)).astype(float)


def pull(gap, parameters, wall=False, law=VanDerWaals()):  # noqa: B008
    """Attraction of two surfaces at a gap by the law alone; repulsive forces are negative."""
    return pulls(gap, parameters, wall, law)[0]


def pulls(gap, parameters, wall=False, law=VanDerWaals(), **memory):  # noqa: B008
    """Attraction of two surfaces, and the history of the pair after it."""
    coated = mrjax.particle.coated_particle(parameters)
    pairs = effective.SurfacePairs(jnp.array([0]), jnp.array([1]), jnp.array([wall]), None, coated)
    own = jax.tree.map(jnp.ravel, law.coefficients(parameters, pairs))
    still, zero = (jnp.zeros(1),) * 3, jnp.zeros(1)
    surface = ParticleState(still, still, still, jnp.full(1, RADIUS), still)
    distance = jnp.full(1, (1.0 if wall else 2.0) * RADIUS + gap)
    kinematics = pair_kinematics(
        surface, surface, (distance, zero, zero), jnp.full(1, 0 if wall else -1)
    )
    wrench, new = law(kinematics, own, {**law.blank_memory(zero), **memory}, 0.0)
    assert not np.any(wrench.force[1:])
    return -float(wrench.force[0][0]), new


# --- exact forces ---------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [-1e-5, 2e-6, 1e-5, 1.999e-5])
def test_two_spheres_attract_each_other_as_derjaguin_has_it(gap):
    """A R* / (6 (h + h_0)^2), times the factor that ends it at ten steric gaps."""
    h, gap_0 = max(gap, 0.0), 2.0 * LAYER
    ends = (1.0 - (h / (CUT_OFF * gap_0)) ** 4) ** 3
    expected = ends * HAMAKER * (RADIUS / 2.0) / (6.0 * (h + gap_0) ** 2)
    assert pull(gap, sticky()) == near(expected, rel=1e-9)


@pytest.mark.parametrize("changes, reach", [({}, 2e-5), ({"attraction_range": 0.05}, 5e-4)])
def test_it_ends_smoothly_at_ten_ranges(changes, reach):
    parameters = sticky(**changes)
    assert float(VanDerWaals().reach(parameters)) == near(reach, rel=1e-12)
    before, after = (pull(share * reach, parameters) for share in (0.99, 1.001))
    assert 0.0 < before < 1e-5 * PULL_OFF and after == 0.0


@pytest.mark.parametrize(
    "changes, factor",
    [
        ({}, 2.0),
        ({"wall_layer_thickness": 3.0 * LAYER}, 2.0 / 4.0),
        ({"hamaker": HAMAKER * np.array([[1.0, 3.0], [3.0, 0.0]])}, 6.0),
    ],
)
def test_a_wall_has_twice_the_effective_radius_and_a_layer_of_its_own(changes, factor):
    parameters = sticky(**changes)
    assert pull(0.0, parameters, wall=True) == near(factor * PULL_OFF, rel=1e-9)
    assert pull(0.0, parameters) == near(PULL_OFF, rel=1e-9)


def test_a_stated_range_changes_the_tail_and_not_the_pull_off():
    """Half the pull-off force is reached at (sqrt 2 - 1) ranges, in radii; walls included."""
    soft = sticky(attraction_range=0.02)
    half = (np.sqrt(2.0) - 1.0) * 0.02 * RADIUS
    for wall, size in ((False, PULL_OFF), (True, 2.0 * PULL_OFF)):
        assert pull(-1e-6, soft, wall) == near(size, rel=1e-9)
        assert pull(half, soft, wall) == near(0.5 * size, rel=1e-5)
    in_contact_only = sticky(attraction_range=0.0)
    assert pull(-1e-6, in_contact_only) == near(PULL_OFF, rel=1e-9)
    assert pull(1e-9, in_contact_only) == 0.0 == VanDerWaals().reach(in_contact_only)


def test_layers_sizes_and_walls_count_in_the_sum_over_all_pairs():
    """Two spheres that differ touch each other, the first the floor; the numbers are by pair."""
    radius, layer = np.array([1.0, 0.5]) * RADIUS, np.array([1.0, 3.0]) * LAYER
    state = mrjax.place([[MIDDLE, MIDDLE, RADIUS], [MIDDLE, MIDDLE, 2.5 * RADIUS]])
    parameters = sticky(radius=radius, layer_thickness=layer)
    forces, torques = mrjax.contact_forces(state, parameters, ROOM, forces=[VanDerWaals()])
    between = HAMAKER * (RADIUS / 3.0) / (6.0 * (4.0 * LAYER) ** 2)
    expected = [[0.0, 0.0, between - 2.0 * PULL_OFF], [0.0, 0.0, -between]]
    np.testing.assert_allclose(forces, expected, rtol=1e-9, atol=1e-20)
    assert not np.any(torques)


def test_a_pair_rests_at_the_overlap_of_dmt():
    """delta = (3 F_c / (4 E* sqrt R*))^(2/3)."""
    parameters = sticky()
    modulus = 1e7 / (2.0 * (1.0 - 0.3**2))
    rest = (3.0 * PULL_OFF / (4.0 * modulus * np.sqrt(RADIUS / 2.0))) ** (2 / 3)
    contact = Contact().active(parameters)
    for share, side in ((0.999, 1.0), (1.001, -1.0)):
        net = sum(pull(-share * rest, parameters, law=law) for law in (contact, VanDerWaals()))
        assert side * net > 0.0


def test_friction_and_rolling_feel_the_pull_off_force():
    """At the limits mu (N + 2 F_c) and mu_r R* (N + 2 F_c), with N = F_Hertz - F_c; not apart."""
    parameters = sticky(friction=0.3, rolling_friction=0.2)
    _, contact, _ = active_forces(None, parameters)
    surfaces = effective.SurfacePairs.by_kind(False, mrjax.particle.coated_particle(parameters))
    own = jax.tree.map(jnp.ravel, contact.coefficients(parameters, surfaces))
    still, zero = (jnp.zeros(1),) * 3, jnp.zeros(1)
    blank = {"sliding": still, "rolling": still}
    for overlap in (1e-6, -1e-9):
        sides = [
            ParticleState(still, (zero, zero + way, zero), (zero, zero, zero + way), r, still)
            for way, r in ((1.0, jnp.full(1, RADIUS)), (-1.0, jnp.full(1, RADIUS)))
        ]
        between = (jnp.full(1, 2.0 * RADIUS - overlap), zero, zero)
        kinematics = pair_kinematics(*sides, between, jnp.full(1, -1))
        wrench, memory = contact(kinematics, own, blank, 1e-2)
        pressing = float(normal.normal_force(overlap, 0.0, own.modulus[0], own.radius[0], 1.0))
        pressing += PULL_OFF if overlap > 0.0 else 0.0
        sliding = np.linalg.norm(np.ravel(wrench.force[1:]))
        assert sliding == near(0.3 * pressing, rel=1e-9)
        turning = 0.5 * (np.ravel(wrench.torque) - np.ravel(wrench.partner_torque))
        assert np.linalg.norm(turning) == near(0.2 * RADIUS / 2.0 * pressing, rel=1e-9)
        assert np.any(memory["sliding"]) == np.any(memory["rolling"]) == (overlap > 0.0)


# --- runs -----------------------------------------------------------------------------------------


def hanging_chains(bond_numbers, parameters, box):
    """Chains of 1, 3 and 10 spheres below the lid, at rest if they hold; the chain of each."""
    weight = float(mrjax.particle.net_weight(parameters))
    plane = float(parameters.elastic_modulus) / (1.0 - float(parameters.poisson_ratio) ** 2)
    position, chain = [], []
    for number, (spheres, bond_number) in enumerate(zip(LENGTHS, bond_numbers, strict=True)):
        z = box.height + RADIUS
        for above in range(spheres):
            modulus, radius = (plane / 2.0, RADIUS / 2.0) if above else (plane, RADIUS)
            load = max(0.0, (bond_number - (spheres - above)) * weight)
            overlap = (3.0 * load / (4.0 * modulus * np.sqrt(radius))) ** (2 / 3)
            z -= 2.0 * RADIUS - overlap
            position.append([(2.0 + 3.0 * number) * RADIUS, MIDDLE, z])
            chain.append(number)
    return mrjax.place(position, contact_diameter=2.0 * RADIUS), np.array(chain)


LENGTHS = (1, 3, 10)


def test_chains_that_hang_from_the_lid_break_at_as_many_spheres_as_the_bond_number():
    """The contact with the lid bears them all; its pull-off force is that of two spheres."""
    box = mrjax.Box((1e-2, 1e-2, 2.2e-2))
    oil = glass(elastic_modulus=1e6, viscosity=1.0, fluid_density=900.0, gravity=9.81).astype(float)
    weight = float(mrjax.particle.net_weight(oil))

    def sinks_by(share):
        bond_numbers = share * np.array(LENGTHS)
        chains, number = hanging_chains(bond_numbers, oil, box)
        layer = LAYER * np.sqrt(PULL_OFF / (bond_numbers[number] * weight))
        table = np.array([[HAMAKER, HAMAKER / 2.0], [HAMAKER / 2.0, 0.0]])
        bonded = oil.replace(hamaker=table, layer_thickness=layer, attraction_range=0.01)
        np.testing.assert_allclose(mrjax.bond_number(bonded), bond_numbers[number], rtol=1e-12)
        run = mrjax.simulate(chains, bonded.astype(float), box, duration=0.1, time_step=5e-5)
        return np.asarray(chains.position[:, 2] - run.state.position[:, 2]) / RADIUS

    assert np.abs(sinks_by(1.02)).max() < 1e-3
    assert sinks_by(0.98).min() > 0.2


@pytest.fixture(scope="module", params=[125, pytest.param(1000, marks=pytest.mark.slow)])
def impacts(request):
    """Pairs, far from each other, that meet at random angles, speeds and spins.

    One half has a restitution of 0.7, the other of 0.95.
    """
    count, spacing, box = request.param, 20.0 * RADIUS, round(request.param ** (1 / 3))
    rng = np.random.default_rng(0)
    cell = np.stack(np.unravel_index(np.arange(count), (box,) * 3), axis=1)
    middle = (cell + 0.5) * spacing
    towards = rng.normal(size=(count, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    aside = np.cross(towards, rng.normal(size=(count, 3)))
    speed = 10.0 ** rng.uniform(-2.0, -1.0, (count, 1))
    velocity = speed * (towards + 0.3 * aside)
    spin = 0.3 * np.tile(speed, (2, 1)) / RADIUS * rng.normal(size=(2 * count, 3))
    position = [middle - 1.1 * RADIUS * towards, middle + 1.1 * RADIUS * towards]
    state = mrjax.place(
        np.concatenate(position),
        np.concatenate([velocity, -velocity]),
        spin,
        materials=np.tile(np.arange(count) % 2, 2),
        contact_diameter=2.0 * RADIUS,
    )
    restitution = np.array([[0.7, 0.7, 1.0], [0.7, 0.95, 1.0], [1.0, 1.0, 1.0]])
    dry = sticky(
        **DRY,
        elastic_modulus=1e6,
        restitution=restitution,
        friction=0.3,
        rolling_friction=0.05,
        attraction_range=0.02,
    )
    room = mrjax.Box((box * spacing,) * 3, (True,) * 3)
    run = mrjax.simulate(state, dry, room, duration=0.03, frames=20, trajectory=True, skin=1.0)
    return state, dry, run


def energies(parameters, position, velocity, spin):
    """Kinetic energy of pairs with that of their normal forces, which is 0 far apart; (P,)."""
    mass = float(mrjax.particle.mass(parameters))
    moving = 0.5 * mass * (velocity**2).sum(-1) + 0.2 * mass * RADIUS**2 * (spin**2).sum(-1)
    count = len(position) // 2
    gap = np.linalg.norm(position[:count] - position[count:], axis=1) - 2.0 * RADIUS
    modulus = 1e6 / (2.0 * (1.0 - 0.3**2))
    hertz = 8.0 / 15.0 * modulus * np.sqrt(RADIUS / 2.0) * np.maximum(-gap, 0.0) ** 2.5
    h = np.linspace(0.0, 0.2 * RADIUS, 20001)
    force = np.asarray(attraction(h, PULL_OFF, 0.02 * RADIUS))
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(h))])
    bond = np.interp(gap, h, work - work[-1]) + PULL_OFF * np.minimum(gap, 0.0)
    return moving[:count] + moving[count:] + hertz + bond


def test_impacts_stick_or_rebound_and_gain_no_energy(impacts):
    state, dry, run = impacts
    count = len(state.position) // 2
    trajectory = jax.tree.map(np.asarray, run.trajectory)
    assert all(np.isfinite(part).all() for part in jax.tree.leaves(trajectory))
    momentum = trajectory.velocity[:, :count] + trajectory.velocity[:, count:]
    assert np.abs(momentum).max() < 1e-12 * np.abs(state.velocity).max()
    distance = np.linalg.norm(
        trajectory.position[-1, :count] - trajectory.position[-1, count:], axis=1
    )
    stuck = distance < 2.0 * RADIUS
    assert 0.05 * count < stuck.sum() < 0.5 * count
    moments = zip(trajectory.position, trajectory.velocity, trajectory.spin, strict=True)
    over_time = np.array([energies(dry, *moment) for moment in moments])
    impact = over_time[0]
    assert ((over_time - impact) / impact).max() < 1e-3


# --- derivatives ----------------------------------------------------------------------------------

COEFFICIENTS = ("hamaker", "layer_thickness", "wall_layer_thickness", "attraction_range")
TRIO = mrjax.place(
    [[4e-3, MIDDLE, 1.05e-3], [4e-3, MIDDLE, 3.02e-3], [6.04e-3, MIDDLE, 3.5e-3]],
    [[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]],
    contact_diameter=2.0 * RADIUS,
)

OIL = sticky(
    viscosity=1.0,
    fluid_density=900.0,
    gravity=9.81,
    friction=0.3,
    elastic_modulus=1e6,
    attraction_range=0.05,
)


@jax.jit
def end(values):
    """A smooth function of the end of a run in which the first two touch and slide."""
    return _end(*values)


def _end(*values):
    named = dict(zip(COEFFICIENTS[: len(values)], values, strict=True))
    oil = OIL.replace(**named)
    run = mrjax.simulate(TRIO, oil, ROOM, duration=3e-3, time_step=3e-5)
    return 1e3 * jnp.sum(run.state.position[:, 2]) + 1e-2 * run.state.spin[0, 1]


def test_gradients_by_coefficients_are_central_differences_in_both_modes():
    values = jnp.array([HAMAKER, LAYER, 2.0 * LAYER])
    slopes = np.asarray(jax.grad(end)(values))
    _, forward = jax.jvp(end, (values,), (values,))
    assert float(forward) == near(float(slopes @ values), rel=1e-9)
    for n, value in enumerate(values):
        step = 1e-3 * value * jnp.eye(3)[n]
        near_by, far = (float(end(values + k * step) - end(values - k * step)) for k in (1, 2))
        slope = (8.0 * near_by - far) / (12.0 * 1e-3 * float(value))
        assert slopes[n] == near(slope, rel=1e-5) and slope != 0.0
    without = jax.grad(end)(jnp.array([0.0, LAYER, LAYER]))
    assert np.isfinite(without).all() and without[0] != 0.0 == without[1]


@pytest.mark.slow
def test_the_gradient_by_the_range_is_a_central_difference():
    def at(range_):
        return _end(HAMAKER, LAYER, 2.0 * LAYER, range_)

    slope = float(jax.grad(at)(0.05))
    assert slope == near(float(at(0.0501) - at(0.0499)) / 2e-4, rel=1e-5)


def test_the_range_fixes_the_neighbour_list():
    words = r"the reach of VanDerWaals is traced.*: keep attraction_range out of jit"
    with pytest.raises(mrjax.InputError, match=words):
        jax.jit(lambda range_: _end(HAMAKER, LAYER, LAYER, range_))(0.05)


@pytest.mark.parametrize("law", ["dmt", "jkr"])
def test_a_derivative_passes_a_first_touch_at_which_the_force_jumps(law):
    """A heavy sphere sinks onto a wall; the moment of touch depends on its weight."""
    vdw, soft, step, drag = VanDerWaals(law=law), sticky(attraction_range=0.0), 1e-5, 0.02
    coated = mrjax.particle.coated_particle(soft)
    wall = effective.SurfacePairs.by_kind(True, coated)
    own = jax.tree.map(lambda values: jnp.ravel(values)[0], vdw.coefficients(soft, wall))
    zero = jnp.zeros(())
    still = ParticleState((zero,) * 3, (zero,) * 3, (zero,) * 3, jnp.asarray(RADIUS), (zero,) * 3)

    @jax.jit
    def gap_after(weight):
        def advance(moment, _):
            gap, velocity, memory = moment
            moving = still._replace(velocity=(velocity, zero, zero))
            pair = pair_kinematics(moving, still, (RADIUS + gap, zero, zero), jnp.asarray(0))
            wrench, memory = vdw(pair, own, memory, step)
            spring = 50.0 * jnp.maximum(-gap, 0.0)
            mass = 1e-6
            velocity += step / mass * (spring - weight - drag * velocity + wrench.force[0])
            return (gap + step * velocity, velocity, memory), None

        begin = jnp.asarray(2e-5), -weight / drag, vdw.blank_memory(zero)
        (gap, _, _), _ = jax.lax.scan(advance, begin, length=430)
        return gap

    weight = 1e-4 * jnp.array([1.02, 1.03, 1.04])  # steps of touch that differ by one
    gaps, slopes = jax.vmap(lambda value: jax.jvp(gap_after, (value,), (1.0,)))(weight)
    assert float(slopes[1]) == near(float(gaps[2] - gaps[0]) / 2e-6, rel=0.02)


def test_second_derivatives_are_finite_at_contact_at_the_cut_off_and_without_attraction():

    @jax.jit
    @jax.vmap
    def derivatives(at):
        slope = jax.grad(lambda values: attraction(*values))
        return slope(at), jax.jacfwd(slope)(at)

    gaps = np.array([-1e-6, 0.0, 1e-5, CUT_OFF * 1e-5, 1.0])
    for size in (0.0, PULL_OFF):
        values = jnp.stack([gaps, np.full(5, size), np.full(5, 1e-5)], axis=1)
        first, second = derivatives(values)
        assert np.isfinite(first).all() and np.isfinite(second).all()
        assert first[2, 1] > 0.2
        assert np.abs(first[3:]).max() < 1e-25 and np.abs(second[3:]).max() < 1e-9


def test_derivatives_of_soft_contacts_are_finite_in_single_precision():
    """At the end of the neck, beyond it and in contact; without attraction it is the limit."""
    values = [np.float32(value) for value in (1e-7, 1e9, 1e-6)]
    neck = attraction_law.tear_off_gap(*values)

    @jax.jit
    @jax.vmap
    def slopes(overlap):
        return jax.grad(attraction_law.jkr_force, argnums=(0, 1, 2, 3))(overlap, *values)

    found = slopes(neck * jnp.array([-1e4, -1.0, -1.0 + 1e-7, 0.0, 1.0, 1e4], jnp.float32))
    assert all(np.isfinite(slope).all() and slope.dtype == np.float32 for slope in found)

    def size(pull_off):
        return attraction_law.attraction_in_contact("jkr", 1e-2, pull_off, **SOFT)

    assert float(jax.grad(size)(0.0)) == near(float(size(1e-2)) / 1e-2, rel=2e-3)


# --- in the list of forces ------------------------------------------------------------------------


def test_it_is_in_the_default_list_unless_its_coefficient_is_zero():
    kinds = [type(force) for force in active_forces(None, sticky())]
    assert kinds == [mrjax.Gravity, Contact, VanDerWaals]
    for hamaker in (None, 0.0, np.zeros((2, 2))):
        _, contact = active_forces(None, sticky(hamaker=hamaker))
        assert contact == Contact(ActiveLaws(sliding=False, rolling=False, damped=False))
    _, alone = active_forces([mrjax.Gravity(), Contact()], sticky())
    assert alone.laws.attraction is None


def test_the_step_follows_the_steepest_slope_of_a_short_tail():
    """2 F_c / eps just beside contact, of a particle and a wall, where eps is 1e-5 radii."""
    bare = sticky(layer_thickness=5e-9, hamaker=1e-19)
    system = System.of(TRIO, bare, ROOM)
    bounds = force_bounds(system, bare, plan_reach(system, bare))
    pull_off = 1e-19 * RADIUS / (6.0 * 1e-8**2)
    assert bounds.stiffness == near(2.0 * pull_off / 1e-8, rel=0.05)


def test_the_step_follows_the_attraction_of_unlike_surfaces():
    """Only particles of different materials attract each other: the third row is of the walls."""
    table = HAMAKER * np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    state = mrjax.place(np.asarray(TRIO.position), materials=[0, 1, 0])
    unlike = sticky(hamaker=table)
    system = System.of(state, unlike, ROOM)
    bounds = force_bounds(system, unlike, plan_reach(system, unlike))
    # F_c, and 2 F_c / h_0 beside contact.
    assert bounds.pair_force == near(PULL_OFF, rel=1e-9)
    assert bounds.stiffness == near(2.0 * PULL_OFF / (2.0 * LAYER), rel=0.05)


def test_normal_forces_leave_attraction_out_and_say_so():
    state = mrjax.place([[MIDDLE, MIDDLE, 3e-3], [MIDDLE, MIDDLE, 4.999e-3]])
    figure = force_chains(state, sticky(), ROOM)
    hertz = 4.0 / 3.0 * 1e7 / (2.0 * (1.0 - 0.3**2)) * np.sqrt(RADIUS / 2.0) * 1e-6**1.5
    assert figure.axes[0].get_title().startswith("1 contacts, mean repulsive force ")
    assert mrjax.normal_forces(state, sticky(), ROOM).force == near(hertz, rel=1e-3)


def test_a_period_shorter_than_the_reach_is_refused_without_a_run():
    narrow = mrjax.Box((4.1e-3, 1e-2, 1e-2), (True, False, False))
    with pytest.raises(mrjax.InputError, match="could reach two images"):
        mrjax.contact_forces(TRIO, sticky(attraction_range=0.05), narrow)


def test_a_missing_coefficient_is_refused():
    with pytest.raises(mrjax.InputError, match="layer_thickness is missing"):
        active_forces(None, sticky(layer_thickness=None))
    with pytest.raises(mrjax.InputError, match="hamaker is missing"):
        mrjax.bond_number(glass(layer_thickness=LAYER))
    with pytest.raises(mrjax.InputError, match=r"layer_thickness = 0\.0 must be above 0"):
        mrjax.contact_forces(TRIO, sticky(layer_thickness=0.0), ROOM)


# --- soft surfaces --------------------------------------------------------------------------------


SOFT = dict(modulus=1e6 / (2.0 * (1.0 - 0.3**2)), radius=0.5)
"""Two spheres of 1 m and 1 MPa, as a peer was measured, with w = 100 J/m^2."""
TEAR_OFF = 0.75 * (
    (0.5 * PULL_OFF / (RADIUS / 2.0)) ** 2 * (RADIUS / 2.0) / (1e5 / (2.0 * (1.0 - 0.3**2))) ** 2
) ** (1 / 3)
"""3/4 (pi^2 w^2 R* / E*^2)^(1/3) of two beads of 0.1 MPa, as DMT has F_c = 2 pi w R*."""
JKR_PULL_OFF = 1.5 * np.pi * 100.0 * 0.5


def test_jkr_has_its_exact_values():
    """Pull-off, first touch, rest and tear-off; LAMMPS' pull-off for the same spheres is 235.58."""
    modulus, radius = SOFT["modulus"], SOFT["radius"]
    adhesion = np.pi * 100.0 * radius
    tear = 0.75 * (np.pi**2 * 100.0**2 * radius / modulus**2) ** (1 / 3)
    force = jax.jit(partial(attraction_law.jkr_force, pull_off=JKR_PULL_OFF, **SOFT))
    assert float(attraction_law.tear_off_gap(JKR_PULL_OFF, **SOFT)) == near(tear, rel=1e-12)
    # 3e-5 of F_c, as the slope is infinite there.
    assert float(force(-tear)) == near(-5.0 / 6.0 * adhesion, rel=1e-4)
    assert float(force(0.0)) == near(-4.0 / 3.0 * adhesion, rel=1e-12)
    deep = np.linspace(-tear, 0.0, 100001)
    assert float(np.min(force(deep))) == near(-235.62, rel=1e-5)
    # The contact radius a, by the two equations of the law at any overlap.
    a = np.geomspace(1.001, 1e3, 50) * (adhesion * radius / (8.0 * modulus)) ** (1 / 3)
    overlap = a**2 / radius - np.sqrt(2.0 * np.pi * a * 100.0 / modulus)
    expected = 4.0 * modulus * a**3 / (3.0 * radius) - np.sqrt(
        8.0 * adhesion / radius * modulus * a**3
    )
    np.testing.assert_allclose(force(overlap), expected, rtol=1e-9, atol=1e-9 * JKR_PULL_OFF)


def test_a_soft_contact_holds_until_its_neck_tears():
    """It acts from the first touch on; apart for the first time, or torn, nothing acts."""
    parameters = sticky(elastic_modulus=1e5)
    law, contact = VanDerWaals(law="jkr"), Contact().active(parameters)
    reach = float(law.reach(parameters))
    touched, found = 0.0, []
    for gap in (0.5 * reach, -1e-5, 0.5 * reach, 1.01 * reach, 0.5 * reach):
        size, memory = pulls(gap, parameters, law=law, touched=jnp.full(1, touched))
        touched = float(memory["touched"][0])
        found.append(size + pull(gap, parameters, law=contact))
    modulus = 1e5 / (2.0 * (1.0 - 0.3**2))
    neck, deep = (
        -float(attraction_law.jkr_force(depth, 0.75 * PULL_OFF, modulus, RADIUS / 2.0))
        for depth in (-0.5 * reach, 1e-5)
    )
    np.testing.assert_allclose(found, [0.0, deep, neck, 0.0, 0.0], rtol=1e-9)
    assert reach == near(1.001 * TEAR_OFF, rel=1e-9) and neck > 0.0


def test_the_reach_covers_unlike_pairs_and_single_precision():
    """The neck of a soft particle and a hard one with a thin layer is longer than of like ones."""
    unlike = sticky(
        radius=2e-6 * np.ones(2),
        hamaker=1e-19,
        elastic_modulus=np.array([1e11, 1e6]),
        layer_thickness=np.array([2e-10, 4e-9]),
    )
    coated = mrjax.particle.coated_particle(unlike)
    law = VanDerWaals(law="jkr")
    pair = effective.SurfacePairs(jnp.array([0]), jnp.array([1]), None, None, coated)
    own = law.coefficients(unlike, pair)
    neck = attraction_law.tear_off_gap(own["pull_off"], own["modulus"], own["radius"])
    assert float(law.reach(unlike)) > float(neck[0]) > 4e-9
    hard = sticky(radius=1e-6, hamaker=1e-20, layer_thickness=2e-9, elastic_modulus=2e11)
    single = law.reach(hard.astype(np.float32))
    assert single.dtype == np.float32
    assert float(single) == near(float(law.reach(hard)), rel=1e-5)


@pytest.mark.slow
def test_a_soft_pair_tears_at_its_exact_gap_across_a_periodic_side():
    """Pulled apart slowly in thick oil: the force on both is that of JKR until the neck tears."""
    room = mrjax.Box((1e-2,) * 3, (True, True, True))
    soft = sticky(
        elastic_modulus=1e5, viscosity=100.0, particle_density=np.array([2900.0, 900.0]),
        fluid_density=1900.0, gravity=9.81,
    )  # fmt: skip
    state = mrjax.place(
        [[2e-4, MIDDLE, MIDDLE], [1e-2 + 2e-4 - 2.0 * RADIUS + 1e-6, MIDDLE, MIDDLE]],
        contact_diameter=2.0 * RADIUS,
    )
    forces = [mrjax.Gravity(jnp.array([30.0, 0.0, 0.0])), Contact(), VanDerWaals(law="jkr")]
    run = mrjax.simulate(
        state, soft, room, duration=0.2, time_step=1e-3, forces=forces,
        frames=200, trajectory=True, skin=0.001,
    )  # fmt: skip
    x, v = (np.asarray(at)[1:, :, 0] for at in (run.trajectory.position, run.trajectory.velocity))
    gap, speed = x[:, 0] - x[:, 1] + 1e-2 - 2.0 * RADIUS, v[:, 0]
    drag, alone = 6.0 * np.pi * 100.0 * RADIUS, speed[-1]
    bound = speed < 0.9 * alone
    assert gap[bound].max() < TEAR_OFF < gap[~bound].min() < TEAR_OFF + 2e-3 * alone
    assert alone == near(4.0 / 3.0 * np.pi * RADIUS**3 * 1000.0 * 30.0 / drag, rel=1e-6)
    # The velocity between two frames is that by the force at the first.
    modulus = 1e5 / (2.0 * (1.0 - 0.3**2))
    force = attraction_law.jkr_force(-gap[bound], 0.75 * PULL_OFF, modulus, RADIUS / 2.0)
    slow = gap[bound] < 0.8 * TEAR_OFF
    np.testing.assert_allclose(drag * (speed[bound] - alone)[slow], force[slow], rtol=0.02)


def test_friction_of_soft_surfaces_feels_their_pull_off_force():
    parameters = sticky(friction=0.3, elastic_modulus=1e5)
    contact, law = active_forces([Contact(), VanDerWaals(law="jkr")], parameters)
    assert contact.laws.attraction == "jkr" and law.memory()["touched"].size == 1
    coated = mrjax.particle.coated_particle(parameters)
    own = contact.coefficients(parameters, effective.SurfacePairs.by_kind(False, coated))
    assert float(own.pull_off) == near(0.75 * PULL_OFF, rel=1e-12)
    net = pull(-1e-5, parameters, law=contact) + pull(-1e-5, parameters, law=law)
    modulus = 1e5 / (2.0 * (1.0 - 0.3**2))
    exact = attraction_law.jkr_force(1e-5, 0.75 * PULL_OFF, modulus, RADIUS / 2.0)
    assert -net == near(float(exact), rel=1e-9)


def test_an_unknown_law_is_refused():
    with pytest.raises(mrjax.InputError, match="law = 'hertz': give 'dmt' or 'jkr'"):
        active_forces([VanDerWaals(law="hertz")], sticky())
