"""Induced moments: pairs, a chain, a lattice, saturation, forces, and derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax.laws import dipoles, magnetism
from mrjax.laws.induced_moments import Sphere, local_fields
from tests.laws.test_dipoles import cloud

near = partial(pytest.approx, abs=0.0)
VOLUME = 4.0 / 3.0 * np.pi
METAL = 1e12
"""Susceptibility of a sphere whose contrast is 1."""
UP = jnp.array([0.0, 0.0, 1.0])


def row(count, axis, susceptibility=METAL, saturation=None, strength=1.0):
    """Moments of touching spheres of radius 1 in a row, along z, over those of a metal alone."""
    position = jnp.zeros((3, count)).at[axis].set(2.0 * jnp.arange(float(count)))
    sphere = Sphere(VOLUME, susceptibility, saturation)
    field = local_fields(position, jnp.zeros_like(position), strength * UP, sphere)
    return np.asarray(sphere.moment(field)[2]) / (4.0 * np.pi * strength)


def lattice(edge, radius, spacing=2.0):
    """Places of a simple cubic lattice within a sphere."""
    along = spacing * np.arange(-edge, edge + 1.0)
    places = np.stack(np.meshgrid(along, along, along)).reshape(3, -1)
    return jnp.asarray(places[:, (places**2).sum(axis=0) <= radius**2])


# --- exact values ---------------------------------------------------------------------------------


def test_a_touching_pair_along_and_across_the_field():
    """4/3 and 8/9 (dipoles, beta = 1); conjugate gradients end at 1e-12."""
    np.testing.assert_allclose(row(2, 2), 4.0 / 3.0, rtol=1e-10)
    np.testing.assert_allclose(row(2, 0), 8.0 / 9.0, rtol=1e-10)


def test_the_middle_of_a_long_chain():
    """1 / (1 - zeta(3) / 2) = 2.506; the error of length falls as its square: extrapolated."""
    short, long = row(129, 2)[64], row(257, 2)[128]
    assert (4.0 * long - short) / 3.0 == near(1.0 / (1.0 - magnetism.CHAIN / 2.0), rel=1e-5)


def clausius_mossotti(radius, susceptibility, spacing=2.0):
    """Mean moment in a sphere of a lattice, over that of Clausius and Mossotti.

    That is 4 pi R^3 beta H / (1 - beta phi) with the macroscopic field H = H_0 - n m / 3: the
    depolarisation of a spherical sample is 1/3.
    """
    position = lattice(9, radius, spacing)
    sphere, beta = Sphere(VOLUME, susceptibility), float(magnetism.contrast(susceptibility))
    solved = jax.jit(lambda place: local_fields(place, jnp.zeros_like(place), UP, sphere))
    moment = float(jnp.mean(sphere.moment(solved(position))[2]))
    macroscopic = 1.0 - moment / spacing**3 / 3.0
    return moment / (4.0 * np.pi * beta * macroscopic) * (1.0 - beta * VOLUME / spacing**3)


@pytest.mark.parametrize("susceptibility, spacing", [(3.0, 2.0), (METAL, 2.6)])
def test_a_sphere_of_a_cubic_lattice_has_the_moment_of_clausius_and_mossotti(
    susceptibility, spacing
):
    """Within 1 %, of 485 spheres."""
    assert clausius_mossotti(4.95 * spacing, susceptibility, spacing) == near(1.0, rel=0.01)


@pytest.mark.slow
def test_touching_metal_spheres_reach_it_as_the_sample_grows():
    """The share of the surface, which deviates, falls as 1 / R; from 485 and 2103 spheres, 1 %."""
    small, large = 9.9, 15.9
    few, many = (clausius_mossotti(radius, METAL) for radius in (small, large))
    assert (large * many - small * few) / (large - small) == near(1.0, rel=0.01)


def test_remanent_moments_magnetise_other_particles():
    """Two spheres in line, one remanent: m_2 = a H(m_1), m_1 = m_r + a H(m_2), beta = 1."""
    position = jnp.array([[0.0, 0.0], [0.0, 0.0], [0.0, 2.0]])
    remanent = jnp.zeros((3, 2)).at[2, 0].set(1.0)
    sphere = Sphere(VOLUME, METAL)
    field = local_fields(position, remanent, jnp.zeros(3), sphere)
    moment = remanent + sphere.moment(field)
    # a T = 4 pi 2 / (4 pi 2^3) = 1/4
    np.testing.assert_allclose(moment[2], [1.0 / (1.0 - 1.0 / 16.0), 0.25 / (1.0 - 1.0 / 16.0)])


# --- saturation -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "susceptibility, strength",
    [(1.0, 0.3), (1.0, 1e6), (100.0, 1e-6), (100.0, 1.0), (1e6, 0.3), (1e6, 0.55), (1e6, 1.0)],
)
def test_a_saturating_chain_obeys_the_law_inside_each_sphere(susceptibility, strength):
    """M = chi H_in / (1 + chi H_in / M_s) with H_in = H - M / 3, for each in the field of all."""
    saturation, count = 1.7, 10
    position = jnp.zeros((3, count)).at[2].set(2.0 * jnp.arange(float(count)))
    sphere = Sphere(VOLUME, susceptibility, saturation)
    field = local_fields(position, jnp.zeros_like(position), strength * UP, sphere)
    moment = sphere.moment(field)
    np.testing.assert_allclose(
        field,
        strength * UP[:, None] + dipoles.fields(position, moment),
        rtol=0,
        atol=1e-9 * strength,
    )
    magnetisation = np.asarray(moment[2]) / VOLUME
    inside = np.asarray(field[2]) - magnetisation / 3.0
    share = magnetisation / saturation
    assert np.all(share < 1.0)
    # Near saturation 1 - M / M_s and H_in have lost digits, relative to those of H.
    np.testing.assert_allclose(
        magnetisation * (1.0 + susceptibility * inside / saturation),
        susceptibility * inside,
        rtol=1e-8,
        atol=1e-13 * susceptibility * float(field.max()),
    )


def test_a_weak_field_induces_the_moments_without_saturation():
    """The first correction is of the order of chi H / M_s."""
    np.testing.assert_allclose(row(5, 2, 10.0, 1e9), row(5, 2, 10.0), rtol=1e-7)


# --- forces ---------------------------------------------------------------------------------------


def scene(saturation=None, count=8):
    position, remanent = cloud(count, seed=3)
    return 1.2 * position, 0.3 * remanent, Sphere(VOLUME, 5.0, saturation)


def moments(position, remanent, applied, sphere):
    return remanent + sphere.moment(local_fields(position, remanent, applied, sphere))


def test_the_force_between_induced_moments_is_minus_the_gradient_of_their_energy():
    """U = -mu_0 sum [(p/2 + m_r).H_0 + m_r.H(m)/2], without saturation; mu_0 = 1."""
    position, remanent, sphere = scene()
    applied = jnp.array([0.2, -0.4, 1.0])

    def energy(position):
        moment = moments(position, remanent, applied, sphere)
        others = dipoles.fields(position, moment)
        outside = jnp.sum((0.5 * (moment + remanent)) * applied[:, None])
        return -outside - 0.5 * jnp.sum(remanent * others)

    force = dipoles.forces(position, moments(position, remanent, applied, sphere), 1.0)
    scale = float(jnp.abs(force).max())
    np.testing.assert_allclose(-jax.grad(energy)(position), force, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("saturation", [None, 0.8])
def test_force_and_moment_are_derivatives_of_one_energy(saturation):
    """dF_i / dH_0 = mu_0 d(sum_j m_j) / dx_i, a relation of Maxwell; mu_0 = 1."""
    position, remanent, sphere = scene(saturation)
    applied = jnp.array([0.2, -0.4, 1.0])

    def force(applied):
        return dipoles.forces(position, moments(position, remanent, applied, sphere), 1.0)

    def total(position):
        return jnp.sum(moments(position, remanent, applied, sphere), axis=1)

    by_field = jax.jacfwd(force)(applied)
    by_place = jax.jacrev(total)(position)
    scale = float(jnp.abs(by_field).max())
    np.testing.assert_allclose(by_field, np.moveaxis(by_place, 0, -1), rtol=0, atol=1e-9 * scale)


# --- derivatives ----------------------------------------------------------------------------------


def total_force(leaves, saturating):
    """One number of a scene in which all leaves matter."""
    position, remanent, sphere = scene()
    sphere = sphere._replace(
        susceptibility=leaves["susceptibility"],
        saturation=leaves["saturation"] if saturating else None,
    )
    place, applied = leaves["scale"] * position, leaves["field"] * jnp.array([0.2, -0.4, 1.0])
    moment = moments(place, leaves["remanence"] * remanent, applied, sphere)
    return jnp.sum(dipoles.forces(place, moment, 1.0)[:, 0] * jnp.array([1.0, 2.0, 3.0]))


LEAVES = {
    "scale": 1.0, "remanence": 1.0, "field": 1.0, "susceptibility": 5.0, "saturation": 0.8,
}  # fmt: skip


@pytest.mark.parametrize("saturating", [False, True])
def test_derivatives_agree_with_central_differences(saturating):
    """Errors of differences are of the square of the step, 1e-10, and of rounding over it."""
    law = partial(total_force, saturating=saturating)
    leaves = {name: jnp.asarray(value) for name, value in LEAVES.items()}
    law = jax.jit(law)
    reverse, forward = jax.jit(jax.grad(law))(leaves), jax.jit(jax.jacfwd(law))(leaves)
    for name in LEAVES if saturating else list(LEAVES)[:-1]:
        step = 1e-5 * LEAVES[name]
        above, below = (law({**leaves, name: leaves[name] + way * step}) for way in (1.0, -1.0))
        expected = float(above - below) / (2.0 * step)
        assert expected != 0.0
        assert float(reverse[name]) == near(expected, rel=1e-6)
        assert float(forward[name]) == near(float(reverse[name]), rel=1e-9)


@pytest.mark.parametrize("saturating", [False, True])
def test_second_derivatives_agree_with_differences_of_first_ones(saturating):
    law = partial(total_force, saturating=saturating)
    leaves = {name: jnp.asarray(value) for name, value in LEAVES.items()}
    curvature = jax.jit(jax.hessian(law))(leaves)
    slope = jax.jit(jax.grad(law))
    for name in LEAVES if saturating else list(LEAVES)[:-1]:
        step = 1e-5 * LEAVES[name]
        above, below = (slope({**leaves, name: leaves[name] + way * step}) for way in (1.0, -1.0))
        for other in LEAVES:
            expected = float(above[other] - below[other]) / (2.0 * step)
            assert float(curvature[other][name]) == near(expected, rel=1e-5) or expected == 0.0


@pytest.mark.parametrize(
    "susceptibility, field, saturation", [(0.0, 1.0, None), (0.0, 1.0, 0.8), (5.0, 0.0, 0.8)]
)
def test_derivatives_are_finite_and_exact_without_susceptibility_or_field(
    susceptibility, field, saturation
):
    position, _, sphere = scene()

    def law(susceptibility, field):
        own = sphere._replace(susceptibility=susceptibility, saturation=saturation)
        return jnp.sum(moments(position, jnp.zeros_like(position), field * UP, own)[2])

    slopes = jax.jit(jax.grad(law, (0, 1)))(susceptibility, field)
    curvatures = jax.jit(jax.hessian(law, (0, 1)))(susceptibility, field)
    assert np.isfinite([*slopes, *np.ravel(curvatures)]).all()
    # m = V chi H for a small susceptibility.
    if susceptibility == 0.0:
        assert float(slopes[0]) == near(8.0 * VOLUME * field, rel=1e-12, abs=1e-12)
        assert float(curvatures[0][1]) == near(8.0 * VOLUME, rel=1e-12)


def test_single_precision_is_as_good_as_it_can_be():
    position, remanent, sphere = scene(0.8)
    exact = local_fields(position, remanent, UP, sphere)
    single = [jnp.float32(leaf) for leaf in (position, remanent, UP)]
    found = local_fields(*single, Sphere(*(jnp.float32(leaf) for leaf in sphere)))
    assert found.dtype == jnp.float32
    assert np.abs(np.asarray(found) - np.asarray(exact)).max() < 1e-4 * np.abs(exact).max()


def test_spheres_that_magnetise_each_other_without_limit_give_nan():
    """Dipoles closer than 2^(1/3) radii: no state is stable, and none is returned."""
    position = jnp.zeros((3, 2)).at[2, 1].set(1.0)
    assert np.isnan(local_fields(position, jnp.zeros((3, 2)), UP, Sphere(VOLUME, METAL))).all()
