"""Many particles in the order of where they are: the same run, given back in their own order."""

import sys
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.dem import sorting
from tests.builders.particles import unit_spheres

BOX = mrjax.Box((16.0, 12.0, 30.0), (True, False, False))
NUMBER = 60


def suspension():
    """Particles of three sizes and two materials on their way into a pile, in no order."""
    random = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(range(5), range(4), range(3), indexing="ij"), -1).reshape(-1, 3)
    places = 1.2 + 2.6 * grid + random.uniform(-0.1, 0.1, (NUMBER, 3))
    mix = random.permutation(NUMBER)
    table = np.array([[0.3, 0.5, 0.4], [0.5, 0.2, 0.6], [0.4, 0.6, 0.0]])
    parameters = mrjax.Parameters(
        radius=random.choice([0.8, 0.9, 1.0], NUMBER),
        particle_density=0.3,
        fluid_density=0.1,
        viscosity=0.02,
        gravity=0.5,
        elastic_modulus=2000.0,
        poisson_ratio=0.3,
        friction=table,
        restitution=0.7,
        rolling_friction=0.1,
    ).astype(float)
    state = mrjax.place(
        places[mix],
        random.normal(size=(NUMBER, 3)),
        materials=random.integers(2, size=NUMBER),
        contact_diameter=2.0,
    )
    return state, parameters


def runs(monkeypatch, function):
    """What a function gives with and without the order of space."""
    found = []
    for many in (1, sys.maxsize):
        monkeypatch.setattr(sorting, "SORT_FROM", many)
        found.append(function())
    return found


@pytest.mark.slow
def test_a_run_in_order_of_space_is_the_same_run(monkeypatch):
    """Sizes, materials, heights, and what contacts remember of whom, of a run and its sequel."""
    state, parameters = suspension()

    def followed():
        first = mrjax.simulate(state, parameters, BOX, duration=1.5, frames=3)
        return first, mrjax.simulate(first.state, parameters, BOX, duration=0.5)

    sorted_, plain = runs(monkeypatch, followed)
    assert int(jnp.sum(plain[1].state.contacts.partner >= 0)) > 10
    assert int(jnp.sum(plain[1].state.contacts.partner < -1)) > 10
    for one, other in zip(sorted_, plain, strict=True):
        for part in ("heights", "radius", "mean_velocity"):
            found, expected = getattr(one, part), getattr(other, part)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
        assert met(one.state.contacts) == met(other.state.contacts)
        for part in ("position", "velocity", "spin"):
            found, expected = getattr(one.state, part), getattr(other.state, part)
            # Sums in another order, whose differences impacts make larger.
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)
        np.testing.assert_array_equal(one.state.material, state.material)


def met(contacts) -> dict:
    """What each particle knows of each partner, to seven digits."""
    partner, sliding = np.asarray(contacts.partner), np.asarray(contacts.sliding)
    return {
        (who, int(partner[who, slot])): tuple(np.round(sliding[who, slot], 7) + 0.0)
        for who, slot in zip(*np.nonzero(partner != -1), strict=True)
    }


@pytest.mark.slow
def test_so_is_its_derivative(monkeypatch):
    state, parameters = suspension()
    step = float(mrjax.time_step(parameters))

    def gradient():
        def fallen(parameters):
            run = mrjax.simulate(state, parameters, BOX, duration=0.3, time_step=step)
            return jnp.sum(run.state.position[:, 2] * jnp.arange(float(NUMBER)))

        return jax.grad(fallen)(parameters)

    sorted_, plain = runs(monkeypatch, gradient)
    assert np.unique(plain.radius).size > 50
    for one, other in zip(*map(jax.tree.leaves, (sorted_, plain)), strict=True):
        if one.ndim == 2:  # which of two materials comes first depends on the order
            one, other = one + one.T, other + other.T
        scale = np.abs(np.asarray(other)).max(initial=0.0)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-8 * scale)


@pytest.mark.parametrize("periodic", [True, False])
def test_the_order_is_that_of_cells(periodic):
    """Up, then along y, then along x; beyond a periodic side as on the other."""
    box = mrjax.Box((9.0, 6.0, 3.0), (periodic, False, False))
    random = np.random.default_rng(1)
    position = random.uniform(0.0, 1.0, (500, 3)) * box.size
    shifted = position + np.array([9.0 * periodic, 0.0, 0.0])
    places = np.asarray(sorting.spatial_order(jnp.asarray(shifted), box, 1.0))
    assert sorted(places) == list(range(500))
    x, y, z = np.floor(position[places]).T
    rows = 100 * x + 10 * y + z
    assert (np.diff(rows) >= 0).all() and len(set(rows)) > 100


def test_partners_are_renamed_with_the_particles():
    """Three in a ring of orders, so that an order and its inverse differ; walls keep their ids."""
    partner = jnp.array([[1, -2], [0, 2], [1, -1]], jnp.int32)
    sliding = jnp.arange(18.0).reshape(3, 2, 3)
    state = mrjax.place(np.arange(9.0).reshape(3, 3), materials=[5, 6, 7])
    state = replace(state, contacts=mrjax.core.state.ContactHistory(partner, sliding, None))
    order = np.array([1, 2, 0])
    moved = sorting.permute_state(state, jnp.asarray(order))
    np.testing.assert_array_equal(moved.position, np.asarray(state.position)[order])
    np.testing.assert_array_equal(moved.material, [6, 7, 5])
    # Who was 0, 1, 2 stands at 2, 0, 1.
    np.testing.assert_array_equal(moved.contacts.partner, [[2, 1], [0, -1], [0, -2]])
    np.testing.assert_array_equal(moved.contacts.sliding, np.asarray(sliding)[order])


def test_parameters_of_each_particle_follow_it():
    order = jnp.array([2, 0, 1])
    radius = jnp.array([1.0, 2.0, 3.0])
    table = jnp.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.5], [0.3, 0.5, 0.0]])
    moved = sorting.permute_parameters(unit_spheres(radius=radius, friction=table), order)
    np.testing.assert_array_equal(moved.radius, [3.0, 1.0, 2.0])
    np.testing.assert_array_equal(moved.friction, table)
    assert moved.viscosity.shape == ()
