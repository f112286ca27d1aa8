"""Dipoles: pairs beside another code, energy, momentum, nearest images, and many at once."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax.laws import dipoles
from mrjax.laws.dipoles import VACUUM_PERMEABILITY

DATA = Path(__file__).parent / "data" / "dipole_pairs_lammps.csv"
APPLIED = jnp.array([0.3, -0.2, 0.9])


def cloud(count, seed=0):
    """Dipoles of random moments, at least about one unit of length apart."""
    random = np.random.default_rng(seed)
    edge = int(np.ceil(count ** (1 / 3)))
    places = np.stack(np.meshgrid(*[np.arange(edge)] * 3)).reshape(3, -1)[:, :count]
    position = 2.0 * places + random.uniform(-0.5, 0.5, (3, count))
    return jnp.asarray(position), jnp.asarray(random.normal(size=(3, count)))


def test_force_and_torque_of_a_hundred_pairs_are_those_of_lammps():
    """Both sum the same few terms in double precision; 1e-10 of the size of each vector."""
    separation, moment, partner, force, torque = np.split(
        np.loadtxt(DATA, delimiter=",").T, [3, 6, 9, 12]
    )
    assert separation.shape == (3, 100)
    unit = 4.0 * np.pi
    found = np.stack(dipoles.dipole_force(separation, moment, partner, unit))
    field = jnp.stack(dipoles.dipole_field(separation, partner))
    turning = np.asarray(dipoles.torques(moment, field, unit))
    for ours, theirs in ((found, force), (turning, torque)):
        error = np.linalg.norm(ours - theirs, axis=0) / np.linalg.norm(theirs, axis=0)
        assert error.max() < 1e-10


def test_two_dipoles_in_line_attract_each_other_by_the_textbook_force():
    """3 mu_0 m^2 / (2 pi d^4), and half as much repulsion side by side."""
    moment, distance = 2e-13, 4e-6
    size = 3.0 * VACUUM_PERMEABILITY * moment**2 / (2.0 * np.pi * distance**4)
    along = jnp.array([[0.0, 0.0], [0.0, 0.0], [moment, moment]])
    for axis, share in ((2, -1.0), (0, 0.5)):
        position = jnp.zeros((3, 2)).at[axis, 1].set(distance)
        force = dipoles.forces(position, along)
        expected = np.zeros((3, 2))
        expected[axis] = [-share * size, share * size]
        np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12 * size)


def test_the_force_is_minus_the_gradient_of_the_energy_and_the_torque_turns_against_it():
    """The derivative by JAX is exact; forces of 20 dipoles agree to rounding."""
    position, moment = cloud(20)

    def energy(position, angles):
        turned = moment + jnp.stack(list(_cross(angles, moment)))
        return dipoles.energy(position, turned, APPLIED, 2.0)

    by_place, by_angle = jax.grad(energy, (0, 1))(position, jnp.zeros_like(position))
    force = dipoles.forces(position, moment, 2.0)
    field = dipoles.fields(position, moment) + APPLIED[:, None]
    scale = float(jnp.max(jnp.abs(force)))
    np.testing.assert_allclose(-by_place, force, rtol=0.0, atol=1e-13 * scale)
    torque = dipoles.torques(moment, field, 2.0)
    np.testing.assert_allclose(-by_angle, torque, rtol=0.0, atol=1e-13 * float(torque.max()))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def test_dipoles_exert_no_total_force_and_no_total_torque_on_themselves():
    position, moment = cloud(30)
    force = dipoles.forces(position, moment)
    torque = dipoles.torques(moment, dipoles.fields(position, moment))
    lever = jnp.stack(list(_cross(position, force)))
    for total, parts in ((force, force), (torque + lever, torque)):
        assert np.abs(np.sum(total, axis=1)).max() < 1e-12 * np.abs(parts).max()


@pytest.mark.parametrize("count", [7, 64])
def test_blocks_of_rows_give_the_sums_and_derivatives_of_one_piece(monkeypatch, count):
    """Ten rows at once, with a last block that is not full; sums are in the same order."""
    position, moment = cloud(count)

    def sums(position):
        return dipoles.fields(position, moment), dipoles.forces(position, moment, 1.0)

    def slope(position):
        return jax.grad(lambda place: sum(jnp.sum(part**2) for part in sums(place)))(position)

    whole, slopes = sums(position), slope(position)
    monkeypatch.setattr(dipoles, "PAIRS_AT_ONCE", 10 * count)
    for ours, theirs in zip(sums(position), whole, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)
    np.testing.assert_allclose(slope(position), slopes, rtol=1e-9, atol=1e-9)


def test_a_dipole_acts_as_its_nearest_image():
    position = jnp.array([[0.5, 9.5], [1.0, 1.0], [1.0, 1.5]])
    moved = position.at[0, 1].set(-0.5)
    _, moment = cloud(2)
    period = jnp.array([10.0, 10.0, 0.0])
    for law in (dipoles.fields, lambda *given: dipoles.forces(*given[:2], 1.0, *given[2:])):
        np.testing.assert_allclose(law(position, moment, period), law(moved, moment), rtol=1e-12)
    assert not np.any(dipoles.fields(position, moment, period) == dipoles.fields(position, moment))


def test_a_periodic_cubic_lattice_is_a_cube_without_a_mean_field():
    """Its nearest images are a cube around each particle, whose field vanishes by symmetry.

    This is the statement on images: N = 1/3 of the cube cancels Lorentz' M / 3.
    """
    places = np.stack(np.meshgrid(*[np.arange(5.0)] * 3)).reshape(3, -1)
    moment = jnp.zeros((3, 125)).at[2].set(1.0)
    period = jnp.full(3, 5.0)
    field = dipoles.fields(jnp.asarray(places), moment, period)
    assert np.abs(field).max() < 1e-14


def test_dipoles_at_one_place_do_not_act_and_have_finite_derivatives():
    position = jnp.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    _, moment = cloud(3)
    energy = lambda place: dipoles.energy(place, moment)  # noqa: E731
    assert np.isfinite(jax.grad(energy)(position)).all()
    assert np.isfinite(jax.hessian(energy)(position)).all()
    alone = dipoles.forces(position[:, :1], moment[:, :1])
    assert not np.any(alone)


def test_single_precision_in_si_agrees_with_double_precision():
    position, moment = cloud(20)
    exact = dipoles.forces(4e-6 * position, 1e-13 * moment)
    single = dipoles.forces(
        jnp.float32(4e-6 * position), jnp.float32(1e-13 * moment), jnp.float32(VACUUM_PERMEABILITY)
    )
    assert single.dtype == jnp.float32
    assert np.abs(np.asarray(single) - np.asarray(exact)).max() < 1e-5 * np.abs(exact).max()
