"""Effective properties of two surfaces in contact, from Eqs. 5, 6 and 8 and tables by material."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.laws import normal, particle, rolling, tangential
from mrjax.laws.particle import CoatedParticle


class PairProperties(NamedTuple):
    """Constants of P contacts, (P,), or () if they are the same for all."""

    modulus: Array  # E*, Pa
    shear_modulus: Array  # G*, Pa
    radius: Array  # R*, m
    mass: Array  # m*, kg
    rolling_inertia: Array  # I_r, kg m^2
    friction: Array  # mu
    damping: Array  # z of `normal.damping_ratio`
    dissipation: Array  # A, s
    tangential_dissipation: Array  # B, s
    rolling_friction: Array  # mu_r
    rolling_damping: Array  # h_r


def per_pair(
    parameters: Parameters,
    material: Array | None,
    first: ArrayLike,
    second: ArrayLike,
    wall: ArrayLike | None,
    *,
    coated: CoatedParticle | None = None,
) -> PairProperties:
    """Returns the properties of contacts; a wall has infinite radius and mass.

    Args:
      parameters: parameters of the run.
      material: material of each particle, (N,); None if all are of one material.
      first: ids of particles, (P,).
      second: ids of their partners, particles or walls, (P,).
      wall: True for a contact with a wall, (P,); None in a box without walls.
      coated: radius and inertia of the coated particles; computed from the parameters by default.
    """
    coated = particle.coated_particle(parameters) if coated is None else coated

    def sides(leaf: Array, wall_value: Array | None = None) -> tuple[Array, Array]:
        # A wall's id is out of bounds; JAX then reads the last particle, which is not used.
        leaf_i, leaf_j = (leaf, leaf) if jnp.ndim(leaf) == 0 else (leaf[first], leaf[second])
        if wall_value is not None and wall is not None:
            leaf_j = jnp.where(wall, wall_value, leaf_j)
        return leaf_i, leaf_j

    def combined(leaf: Array) -> Array:
        leaf_i, leaf_j = sides(leaf)
        reduced = normal.harmonic(leaf_i, leaf_j)
        return reduced if wall is None else jnp.where(wall, leaf_i, reduced)

    def table(leaf: Array) -> Array:
        if jnp.ndim(leaf) == 0:
            return leaf
        index = jnp.zeros(1, jnp.int32) if material is None else material
        wall_value = leaf[index[first], -1]
        material_i, material_j = index[first], index[second]
        value = leaf[material_i, material_j]
        return value if wall is None else jnp.where(wall, wall_value, value)

    (modulus_i, modulus_j), (poisson_i, poisson_j) = (
        sides(parameters.elastic_modulus, parameters.wall_elastic_modulus),
        sides(parameters.poisson_ratio, parameters.wall_poisson_ratio),
    )
    materials = (modulus_i, poisson_i, modulus_j, poisson_j)
    radius, mass, moment = coated
    return PairProperties(
        normal.effective_modulus(*materials),
        tangential.effective_shear_modulus(*materials),
        combined(radius),
        combined(mass),
        combined(rolling.contact_inertia(moment, mass, radius)),
        table(parameters.friction),
        table(normal.damping_ratio(parameters.restitution)),
        table(parameters.dissipation),
        table(parameters.tangential_dissipation),
        table(parameters.rolling_friction),
        table(parameters.rolling_damping),
    )


def per_kind(
    parameters: Parameters,
    material: Array | None,
    walled: bool,
    coated: CoatedParticle | None = None,
) -> PairProperties | None:
    """Returns the constants of a particle contact and, in a box with walls, of a wall contact.

    Returns:
      Properties of shape (1,) or (2,), or () if all contacts are the same; None if particles
      differ, so that contacts of one kind have different constants.
    """
    coated = particle.coated_particle(parameters) if coated is None else coated
    leaves = coated.radius, coated.inertia, parameters.elastic_modulus, parameters.poisson_ratio
    if material is not None or any(jnp.ndim(leaf) for leaf in leaves):
        return None
    first = jnp.zeros(1 + walled, jnp.int32)  # all particles are alike: take the first
    wall = np.array([False, True]) if walled else None
    return per_pair(parameters, None, first, first, wall, coated=coated)


# Their names of before.
Surfaces = PairProperties
of_kinds = per_kind


def of(parameters: Parameters, material: Array | None, listed: Any) -> PairProperties:
    """Calls `per_pair` under its name of before, with an object's `first`, `second` and `wall`."""
    return per_pair(parameters, material, listed.first, listed.second, listed.wall)
