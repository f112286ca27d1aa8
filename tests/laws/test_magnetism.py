"""Magnetisation of one sphere, and the dimensionless numbers of magnetic particles."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import magnetism
from mrjax.laws.dipoles import VACUUM_PERMEABILITY

near = partial(pytest.approx, abs=0.0)


def iron(**changes):
    """Bare iron of 4 um in oil, whose net weight is 2.14 pN."""
    return mrjax.Recipe.load("case2").parameters().replace(**changes)


@pytest.mark.parametrize("susceptibility", [0.0, 0.5, 10.0, 1e4])
@pytest.mark.parametrize("strength", [0.0, 1e2, 1e5, 5e5, 1e7])
def test_the_magnetisation_obeys_the_law_of_froehlich_and_kennelly_inside(susceptibility, strength):
    """The law and its inverse; H_in of a good conductor is the small difference of H and M / 3."""
    saturation = 1.7e6
    magnetisation = strength * float(
        magnetism.secant_susceptibility(strength, susceptibility, saturation)
    )
    inside = strength - magnetisation / 3.0
    expected = susceptibility * inside / (1.0 + susceptibility * inside / saturation)
    lost = 1e-15 * strength * susceptibility
    assert magnetisation == pytest.approx(expected, rel=1e-9, abs=lost)
    assert magnetisation <= saturation


def test_a_weak_field_magnetises_by_three_beta_and_a_strong_one_saturates():
    """Corrections are of the order of chi H / M_s and M_s / (chi H)."""
    beta = float(magnetism.contrast(10.0))
    assert beta == near(10.0 / 13.0)
    secant = magnetism.secant_susceptibility
    assert float(secant(1.0, 10.0)) == near(3.0 * beta, rel=1e-15)
    assert float(secant(1e-9, 10.0, 1.0)) == near(3.0 * beta, rel=1e-8)
    assert 1e9 * float(secant(1e9, 10.0, 1.0)) == near(1.0, rel=1e-9)


@pytest.mark.parametrize("saturation", [None, 2.0])
@pytest.mark.parametrize("strength", [1e-3, 0.7, 30.0])
def test_the_tangent_is_the_slope_of_the_magnetisation(strength, saturation):
    def magnetisation(strength):
        return strength * magnetism.secant_susceptibility(strength, 10.0, saturation)

    slope = magnetism.tangent_susceptibility(strength, 10.0, saturation)
    assert float(slope) == near(float(jax.grad(magnetisation)(strength)), rel=1e-12)


@pytest.mark.parametrize("remanence, bond", [(300.0, 0.11), (1e3, 1.2), (3e3, 11.0), (1e4, 123.0)])
def test_bond_numbers_of_remanent_iron(remanence, bond):
    """(pi mu_0 / 24) M_r^2 d^2 over the net weight; the table has two or three digits."""
    parameters = iron(remanence=remanence)
    number = float(mrjax.magnetic_bond_number(parameters))
    assert number == near(bond, rel=0.05)
    weight = float(mrjax.particle.net_weight(parameters))
    pull = np.pi * VACUUM_PERMEABILITY / 24.0 * remanence**2 * (4e-6) ** 2
    assert number == near(pull / weight, rel=1e-12)


def test_the_field_adds_its_magnetisation_and_a_coating_keeps_moments_apart():
    field = jnp.array([0.0, 3e3, 4e3])
    bare = iron(remanence=1e3, field=field, susceptibility=6.0)
    total = 1e3 + 3.0 * (6.0 / 9.0) * 5e3
    assert float(magnetism.magnetisation(bare)) == near(total, rel=1e-12)
    coated = bare.replace(f_r=1.5)
    pulls = [float(magnetism.touching_pull(one, total)) for one in (bare, coated)]
    assert pulls[1] == near(pulls[0] / 1.5**4, rel=1e-12)


def test_the_dipolar_coupling():
    """mu_0 m^2 / (4 pi d^3 k T)."""
    moment = 4.0 / 3.0 * np.pi * (2e-6) ** 3 * 1e3
    expected = VACUUM_PERMEABILITY * moment**2 / (4.0 * np.pi * (4e-6) ** 3 * 1.380649e-23 * 300.0)
    assert float(mrjax.dipolar_coupling(iron(remanence=1e3), 300.0)) == near(expected, rel=1e-12)


@pytest.mark.parametrize("saturation, share", [(None, 1.0), (1e3, 0.1)])
def test_the_largest_magnetisation_is_that_of_a_long_chain_or_of_saturation(saturation, share):
    field = jnp.array([0.0, 0.0, 1e5])
    parameters = iron(field=field, susceptibility=1e9, saturation=saturation)
    chain = 3e5 * 2.506444
    expected = chain if saturation is None else saturation
    assert float(magnetism.largest_magnetisation(parameters)) == near(expected, rel=1e-6)
    pull = float(magnetism.largest_pull(parameters))
    touching = float(magnetism.touching_pull(parameters, expected))
    assert pull == near(1.2020569 * touching, rel=1e-6)


def test_derivatives_of_the_numbers_are_finite_without_a_field():
    parameters = iron(
        remanence=1e3, field=jnp.zeros(3), susceptibility=jnp.array(10.0), saturation=jnp.array(1e6)
    ).astype(float)
    slopes = jax.grad(mrjax.magnetic_bond_number)(parameters)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
