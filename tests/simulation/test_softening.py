"""Softer contacts: what Hertz says of them, what stays as it was, and what is refused."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import drag, particle, time_scales
from mrjax.simulation import softening

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
EXACT = 1e-12  # some ten roundings, powers of 3/2 among them
MODULI = ("elastic_modulus", "wall_elastic_modulus")
DASHPOTS = {"restitution": 1.0, "dissipation": 0.0, "tangential_dissipation": 0.0}


def softened(recipe, overlap, **changes):
    parameters = recipe.parameters().replace(**changes)
    return parameters, mrjax.softened(parameters, recipe.box, recipe.particle_count, overlap)


def test_half_the_overlap_takes_moduli_of_two_to_the_three_halves(case):
    for factor in (2.0, 5.0):
        _, soft = softened(case, 0.05)
        _, stiffer = softened(case, 0.05 / factor)
        for name in MODULI:
            ratio = getattr(stiffer, name) / getattr(soft, name)
            assert float(ratio) == near(factor**1.5, rel=EXACT)


def test_the_modulus_by_hand(case2):
    """Case 2: 314 spheres of 4 um over 25 x 25 um, 8.04 of them above each 4 x 4 um."""
    stiff, soft = softened(case2, 0.05)
    weight = 4 / 3 * np.pi * 2e-6**3 * (7470 - 950) * 9.81
    load = softening.FORCE_CHAINS * 314 * weight * 4e-6**2 / 25e-6**2
    # 4/3 E* sqrt(R*) d^1.5 carries it at d = 0.05 R; pairs or walls of iron, E* = E / 2 (1 - nu^2)
    # and R* up to R.
    modulus = 3 * load / (4 * np.sqrt(2e-6) * (0.05 * 2e-6) ** 1.5)
    assert float(soft.elastic_modulus) == near(modulus * 2 * (1 - 0.31**2), rel=1e-9)
    # A rigid wall takes all of the overlap on the particle's side: the same E* with half the E.
    _, walled = softened(case2, 0.05, wall_elastic_modulus=jnp.asarray(jnp.inf))
    assert float(walled.elastic_modulus) == near(modulus * (1 - 0.31**2), rel=1e-9)
    assert walled.wall_elastic_modulus == jnp.inf
    assert float(stiff.elastic_modulus / soft.elastic_modulus) > 1e7


def test_one_particle_bears_at_least_itself(case2):
    """In a wide box the load is that of one particle, not the thinner layer of its weight."""
    wide = mrjax.Box((1e-3, 1e-3, 50e-6))
    parameters = case2.parameters()
    expected = softening.resting_overlap(parameters, wide, 1)
    of_one = time_scales.expected_overlap(
        parameters, softening.FORCE_CHAINS * particle.net_weight(parameters), 0.0
    )
    assert expected == near(float(of_one), rel=EXACT)


@pytest.mark.parametrize("name", ["case2", "case3"])
def test_nothing_else_changes(name):
    stiff, soft = softened(mrjax.Recipe.load(name), 0.03)
    for field in dataclasses.fields(stiff):
        before, after = getattr(stiff, field.name), getattr(soft, field.name)
        if field.name in MODULI:
            assert after < before
            ratio = after / before
            assert float(ratio) == near(float(soft.elastic_modulus / stiff.elastic_modulus))
        elif field.name in DASHPOTS:
            assert after == DASHPOTS[field.name]
        else:
            np.testing.assert_array_equal(after, before)


def test_never_stiffer_than_it_was(case2):
    """Jelly that rests deeper than asked keeps its modulus."""
    jelly = dict(elastic_modulus=jnp.asarray(1e2), wall_elastic_modulus=jnp.asarray(1e2))
    stiff, soft = softened(case2, 1e-3, **jelly)
    for name in MODULI:
        assert getattr(soft, name) == getattr(stiff, name) == 1e2


def test_dashpots_stay_where_drag_does_not_outweigh_them(case2):
    def kept(**changes):
        stiff, soft = softened(case2, 0.05, **changes)
        same = [getattr(soft, name) == getattr(stiff, name) for name in DASHPOTS]
        idle = [getattr(soft, name) == value for name, value in DASHPOTS.items()]
        assert all(same) != all(idle)
        return all(same)

    dissipating = dict(dissipation=jnp.asarray(1e-9), tangential_dissipation=jnp.asarray(1e-9))
    assert not kept(**dissipating)
    assert kept(viscosity=jnp.asarray(0.0), **dissipating)  # dry: a particle bounces
    # The border is at a thousandth of the drag; here A alone gives the dashpot, 2/3 K A.
    _, soft = softened(case2, 0.05)
    elastic = dict(restitution=jnp.asarray(1.0))
    trial = soft.replace(dissipation=jnp.asarray(1.0))
    per_second = float(time_scales.dashpots(trial, 0.05 * 2e-6))
    border = 1e-3 * float(drag.coefficient(soft)) / per_second
    assert not kept(dissipation=jnp.asarray(0.99 * border), **elastic)
    assert kept(dissipation=jnp.asarray(1.01 * border), **elastic)


def test_a_table_of_materials_is_left_out_as_a_whole(case2):
    """One damped pair that matters keeps the restitution of all."""
    table = jnp.array([[0.5, 0.9], [0.9, 1.0]])
    stiff, soft = softened(case2, 0.05, restitution=table)
    assert soft.restitution == 1.0
    dry = dict(viscosity=jnp.asarray(0.0), restitution=table)
    stiff, soft = softened(case2, 0.05, **dry)
    np.testing.assert_array_equal(soft.restitution, stiff.restitution)


@pytest.mark.parametrize("overlap", [0.0, -0.01, 0.11, np.nan, np.inf, "0.05"])
def test_an_overlap_that_means_nothing_is_refused(case2, overlap):
    with pytest.raises(mrjax.InputError, match="overlap"):
        softened(case2, overlap)
    softened(case2, 0.1)  # the most


@pytest.mark.parametrize("leaf", ["elastic_modulus", "radius", "gravity"])
def test_traced_parameters_are_refused(case2, leaf):
    parameters = case2.parameters()

    @jax.jit
    def of(value):
        changed = parameters.replace(**{leaf: value})
        return mrjax.softened(changed, case2.box, 314, 0.05).elastic_modulus

    with pytest.raises(mrjax.InputError, match="traced by jit or vmap; soften them outside"):
        of(getattr(parameters, leaf))


def test_a_gradient_sees_the_factor_as_a_number(case2):
    """d E_soft / d E is the factor: as documented, not the zero of an E that is chosen."""
    parameters = case2.parameters()

    def of(modulus):
        changed = parameters.replace(elastic_modulus=modulus, wall_elastic_modulus=modulus)
        return mrjax.softened(changed, case2.box, 314, 0.05).elastic_modulus

    value, slope = jax.value_and_grad(of)(parameters.elastic_modulus)
    assert float(slope) == near(float(value / parameters.elastic_modulus), rel=EXACT)


def test_hertz_bears_the_load_and_the_pull_off_force(case2):
    """The modulus is proportional to the sum of both forces."""
    layers = dict(hamaker=1e-19, layer_thickness=2e-9)
    plain, weakly, strongly = (
        softened(case2, 0.05, **changes)[1]
        for changes in ({}, {**layers, "layer_thickness": 2e-7}, layers)
    )
    load = softening.FORCE_CHAINS * 314 * 4e-6**2 / 25e-6**2
    bond = float(mrjax.bond_number(case2.parameters().replace(**layers)))
    # In net weights; at a wall the pull-off force has twice that.
    for soft, pull_off in ((strongly, 2.0 * bond), (weakly, 2e-4 * bond)):
        ratio = soft.elastic_modulus / plain.elastic_modulus
        assert float(ratio) == near(1.0 + pull_off / load, rel=1e-9)
    assert float(strongly.attraction_range) == near(softening.RANGE, rel=EXACT)
    stated = softened(case2, 0.05, **layers, attraction_range=0.1)[1]
    assert stated.attraction_range == 0.1 and plain.attraction_range is None
