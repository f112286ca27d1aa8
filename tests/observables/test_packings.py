"""Observables of packings: stress, coordination, clusters, directions of contacts, looseness."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.observables import packing
from tests.builders.particles import unit_spheres

ROUNDING = 1e-12  # roundings of sums over some tens of contacts
PERIODIC = (True, True, True)
SMOOTH = 1e-6  # central differences of a smooth force at a step of 1e-5: second order


def hertz(overlap, modulus=1000.0, poisson=0.3, radius=0.5):
    """Hertz's force of two equal spheres of 1 m, N: 4/3 E* sqrt(R*) d^(3/2)."""
    return 4 / 3 * modulus / (2 * (1 - poisson**2)) * np.sqrt(radius) * overlap**1.5


def network_of(positions, box, parameters=None):
    parameters = unit_spheres() if parameters is None else parameters
    state = mrjax.place(positions, contact_diameter=2.0)
    return mrjax.contact_network(state, parameters, box)


def by_hand(particles, first, second, branch=None):
    """A network of contacts that are given; walls follow from N on."""
    first, second = jnp.asarray(first), jnp.asarray(second)
    branch = jnp.zeros((len(first), 3)) if branch is None else jnp.asarray(branch)
    return mrjax.ContactNetwork(
        first=first,
        second=second,
        touching=jnp.ones(len(first), bool),
        centre=jnp.zeros((len(first), 3)),
        branch=branch,
        force=jnp.zeros((len(first), 3)),
        volume=jnp.asarray(1.0),
        particles=particles,
        box=mrjax.Box((1.0, 1.0, 1.0)),
    )


def lattice(edge, spacing):
    """Simple cubic lattice of edge^3 spheres, in a periodic box that it fills."""
    points = spacing * np.stack(np.meshgrid(*[np.arange(edge)] * 3), -1).reshape(-1, 3)
    return points + 0.5 * spacing, mrjax.Box((edge * spacing,) * 3, PERIODIC)


def test_two_spheres_pressed_onto_each_other_have_the_stress_of_their_force():
    box = mrjax.Box((10.0, 10.0, 10.0))
    direction = np.array([1.0, 2.0, 2.0]) / 3
    network = network_of([[4, 4, 4], [4, 4, 4] + 1.9 * direction], box)
    expected = hertz(0.1) * 1.9 * np.outer(direction, direction) / box.volume
    assert np.asarray(mrjax.stress_tensor(network)) == pytest.approx(expected, rel=ROUNDING)


@pytest.mark.parametrize("attraction", [0.0, 3.0])
def test_a_compressed_cubic_lattice_is_under_its_pressure(attraction):
    points, box = lattice(4, 1.96)
    # Pull-off A R* / (6 h_0^2) = 3 N of DMT; each sphere has three contacts of its own.
    layers = {"hamaker": 12 * attraction * 0.1**2, "layer_thickness": 0.05, "attraction_range": 0.0}
    network = network_of(points, box, unit_spheres(**layers))
    expected = (hertz(0.04) - attraction) * 1.96 / 1.96**3
    stress = np.asarray(mrjax.stress_tensor(network))
    assert stress == pytest.approx(expected * np.eye(3), rel=1e-9, abs=1e-9)
    assert np.asarray(mrjax.coordination(network).number).tolist() == [6] * 64
    assert np.asarray(mrjax.fabric_tensor(network)) == pytest.approx(np.eye(3) / 3, abs=ROUNDING)


def test_the_tail_of_an_attraction_counts_across_gaps():
    points, box = lattice(8, 2.04)
    layers = {"hamaker": 12 * 3.0 * 0.1**2, "layer_thickness": 0.05, "attraction_range": 0.05}
    stress = mrjax.stress_tensor(network_of(points, box, unit_spheres(**layers)))
    tail = 3.0 * (1 - (0.8 / 10) ** 4) ** 3 / 1.8**2
    assert np.asarray(jnp.diag(stress)) == pytest.approx(-tail / 2.04**2, rel=1e-9)


def column(count, **changes):
    """A column of unit spheres on a floor, each overlap that of Hertz under the weight above."""
    parameters = unit_spheres(gravity=1.0, wall_elastic_modulus=1000.0, **changes)
    parameters = parameters.replace(wall_poisson_ratio=0.3)
    loads = np.arange(count, 0, -1) * 1.0
    between = (loads[1:] / hertz(1.0)) ** (2 / 3)
    floor = (loads[0] / hertz(1.0, radius=1.0)) ** (2 / 3)
    height = 1.0 - floor + np.concatenate([[0.0], np.cumsum(2.0 - between)])
    return np.stack([np.full(count, 5.0), np.full(count, 5.0), height], 1), parameters


def test_a_column_at_rest_carries_the_weight_above_each_plane():
    points, parameters = column(6)
    box = mrjax.Box((10.0, 10.0, 20.0))
    network = network_of(points, box, parameters)
    levels = np.concatenate([[1e-6], 0.5 * (points[1:, 2] + points[:-1, 2]), [points[-1, 2] + 0.1]])
    stress = np.asarray(mrjax.vertical_stress(network, levels))
    # The spheres weigh 1 N each; nothing presses above the last centre.
    assert stress == pytest.approx(np.arange(6, -1, -1) / 100.0, rel=1e-9, abs=1e-12)
    # Virial theorem: V sigma_zz is the sum of weights times heights of the centres.
    total = float(mrjax.stress_tensor(network)[2, 2]) * box.volume
    assert total == pytest.approx(points[:, 2].sum(), rel=1e-9)


def test_the_virial_theorem_holds_for_any_state_between_walls():
    rng = np.random.default_rng(3)
    points = rng.uniform(0.8, 4.2, (12, 3))
    box = mrjax.Box((5.0, 5.0, 5.0))
    state = mrjax.place(points, rng.normal(size=(12, 3)), rng.normal(size=(12, 3)))
    parameters = unit_spheres(friction=0.4, restitution=0.6)
    network = mrjax.contact_network(state, parameters, box)
    force, _ = mrjax.contact_forces(state, parameters, box)
    # sum f l over contacts = sum F x over particles - sum over walls of their force f times where
    # it acts.
    stress = np.asarray(mrjax.stress_tensor(network)) * box.volume
    on_wall = np.asarray(network.second) >= 12
    acts = np.asarray(network.centre - network.branch)[on_wall]
    virial = np.asarray(force).T @ points - np.asarray(network.force)[on_wall].T @ acts
    assert stress == pytest.approx(virial, rel=1e-9, abs=1e-9 * abs(virial).max())


@pytest.mark.parametrize("leaf", ["elastic_modulus", "radius", "hamaker", "layer_thickness"])
def test_the_stress_has_its_derivatives_by_the_parameters(leaf):
    points, box = lattice(3, 1.96)
    points = points + np.random.default_rng(1).normal(0, 0.01, points.shape)
    layers = {"hamaker": 1.08, "layer_thickness": 0.05, "attraction_range": 0.05}
    parameters = unit_spheres(**layers)
    state = mrjax.place(points, contact_diameter=2.1)

    def pressure(value):
        changed = parameters.replace(**{leaf: value})
        return jnp.trace(mrjax.stress_tensor(mrjax.contact_network(state, changed, box)))

    value = float(getattr(parameters, leaf))
    step = 1e-5 * value
    central = (pressure(value + step) - pressure(value - step)) / (2 * step)
    assert float(jax.grad(pressure)(value)) == pytest.approx(float(central), rel=SMOOTH)
    assert float(jax.jvp(pressure, (value,), (1.0,))[1]) == pytest.approx(
        float(jax.grad(pressure)(value)), rel=ROUNDING
    )
    assert np.isfinite(jax.grad(jax.grad(pressure))(value))


def test_rattlers_are_taken_away_until_all_others_are_held():
    # A ring of four; a tail of two, of which the first is held only by the second; one alone.
    network = by_hand(7, [0, 1, 2, 0, 1, 4], [1, 2, 3, 3, 4, 5])
    result = mrjax.coordination(network)
    assert np.asarray(result.number).tolist() == [2, 3, 2, 2, 2, 1, 0]
    assert float(result.mean) == pytest.approx(12 / 7)
    assert float(result.mean_without_rattlers) == pytest.approx(2.0)
    assert float(result.rattlers) == pytest.approx(3 / 7)
    assert np.asarray(result.distribution)[:4] == pytest.approx(np.array([1, 1, 4, 1]) / 7)
    assert mrjax.cluster_sizes(network).tolist() == [6, 1]


def test_a_sphere_on_the_floor_is_held_by_it_but_counts_no_neighbour():
    network = by_hand(2, [0, 0], [1, 2 + 4])
    result = mrjax.coordination(network)
    assert np.asarray(result.number).tolist() == [1, 1]
    assert float(result.rattlers) == 1.0  # the upper one hangs on one contact, then the lower too
    assert float(mrjax.coordination(network, least=1).rattlers) == 0.0
    apart = by_hand(2, [0, 1], [2 + 4, 2 + 4])
    assert mrjax.cluster_sizes(apart).tolist() == [1, 1]  # a common wall connects nothing


def test_a_chain_has_its_contacts_along_its_axis():
    branch = [[0.0, 0.0, -1.9]] * 3 + [[0.9, 0.0, 0.0]]  # and one with a wall, which does not count
    network = by_hand(4, [0, 1, 2, 0], [1, 2, 3, 4], branch)
    assert np.asarray(mrjax.fabric_tensor(network)) == pytest.approx(np.diag([0.0, 0.0, 1.0]))
    assert float(mrjax.share_along(network, 2)) == 1.0
    assert float(mrjax.share_along(network, 0)) == 0.0


def test_isotropic_contacts_have_the_share_of_the_cap():
    direction = np.random.default_rng(0).normal(size=(40_000, 3))
    ids = np.arange(40_000)
    network = by_hand(40_001, ids, ids + 1, direction)
    share = 1 - np.cos(np.deg2rad(30.0))
    deviation = np.sqrt(share * (1 - share) / 40_000)
    assert float(mrjax.share_along(network)) == pytest.approx(share, abs=4 * deviation)


@pytest.mark.parametrize(
    ("fraction", "name"), [(0.2, "loose"), (0.55, "random loose"), (0.62, "dense")]
)
def test_a_bed_is_named_by_its_volume_fraction(fraction, name):
    edge, count = 10.0, 400
    area = count * 4 / 3 * np.pi / (fraction * edge)  # layers that fill the fraction on the whole
    width = np.sqrt(area)
    run = SimpleNamespace(
        heights=jnp.asarray(np.linspace(0.0, edge, count))[None],
        radius=jnp.ones(count),
        box=mrjax.Box((width, width, 2 * edge)),
        rising=False,
        initial_height=2 * edge,
        check=lambda: None,
    )
    bed = mrjax.bed_packing(run, by_hand(count, [0], [1]))
    # Cuts of spheres at the ends of the bulk: the centres are on 400 levels.
    assert float(bed.volume_fraction) == pytest.approx(fraction, rel=0.01)
    assert bed.name == name
    limits = packing.DENSE - packing.ADHESIVE
    assert float(bed.openness) == pytest.approx((packing.DENSE - fraction) / limits, abs=0.02)


def test_what_cannot_be_read_is_refused():
    points, box = lattice(3, 1.96)
    network = network_of(points, box)
    with pytest.raises(mrjax.InputError, match="periodic along z"):
        mrjax.vertical_stress(network, [1.0])
    with pytest.raises(mrjax.InputError, match="axis = 3"):
        mrjax.share_along(network, 3)
    with pytest.raises(mrjax.InputError, match="least"):
        mrjax.coordination(network, least=0)


def test_a_stretched_box_is_as_the_box_of_that_size():
    from mrjax.dem.contact_network import network_of as stretched
    from mrjax.dem.plan import System

    rng = np.random.default_rng(5)
    large = mrjax.Box((6.0, 6.0, 9.0), PERIODIC)
    state = mrjax.place(rng.uniform(-3, 12, (40, 3)))
    parameters = unit_spheres()
    plain = mrjax.contact_network(state, parameters, large)
    small = mrjax.Box((6.0, 6.0, 6.0), PERIODIC)
    other = stretched(System.of(state, parameters, small), [1.0, 1.0, 1.5])
    assert float(other.volume) == pytest.approx(large.volume, rel=ROUNDING)
    assert np.asarray(mrjax.stress_tensor(other)) == pytest.approx(
        np.asarray(mrjax.stress_tensor(plain)), rel=1e-9
    )
