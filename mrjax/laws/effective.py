"""Effective properties of two surfaces in contact: Eqs. 5, 6 and 8, and tables by material."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.laws import normal, particle, rolling, tangential
from mrjax.laws.particle import CoatedParticle


class PairProperties(NamedTuple):
    """Constants of the contacts, (P,); () where equal for all."""

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
    """Properties of the contacts between these surfaces; a wall is of infinite radius and mass.

    Args:
      parameters: of the run.
      material: index of each particle, (N,); None where all are of one.
      first: ids of particles, (P,).
      second: ids of their partners, particles or walls, (P,).
      wall: whether the second is a wall, (P,); None in a box without.
      coated: the coated particles; left out, of the parameters.
    """
    coated = particle.coated_particle(parameters) if coated is None else coated

    def sides(leaf: Array, of_wall: Array | None = None) -> tuple[Array, Array]:
        # A wall's id is beyond the last particle's, which is read in its place.
        mine, theirs = (leaf, leaf) if jnp.ndim(leaf) == 0 else (leaf[first], leaf[second])
        if of_wall is not None and wall is not None:
            theirs = jnp.where(wall, of_wall, theirs)
        return mine, theirs

    def combined(leaf: Array) -> Array:
        mine, theirs = sides(leaf)
        between = normal.harmonic(mine, theirs)
        return between if wall is None else jnp.where(wall, mine, between)

    def table(leaf: Array) -> Array:
        if jnp.ndim(leaf) == 0:
            return leaf
        index = jnp.zeros(1, jnp.int32) if material is None else material
        at_wall = leaf[index[first], -1]
        mine, theirs = index[first], index[second]
        between = leaf[mine, theirs]
        return between if wall is None else jnp.where(wall, at_wall, between)

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
        combined(rolling.about_contact(moment, mass, radius)),
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
    """Constants of a contact of two particles and, in a box with walls, of one with a wall.

    Of shape (1,) or (2,), () where all are equal; None where particles differ, and so do the
    contacts of one kind.
    """
    coated = particle.coated_particle(parameters) if coated is None else coated
    of_each = coated.radius, coated.inertia, parameters.elastic_modulus, parameters.poisson_ratio
    if material is not None or any(jnp.ndim(leaf) for leaf in of_each):
        return None
    anyone = jnp.zeros(1 + walled, jnp.int32)
    wall = np.array([False, True]) if walled else None
    return per_pair(parameters, None, anyone, anyone, wall, coated=coated)


# Their names of before.
Surfaces = PairProperties
of_kinds = per_kind


def of(parameters: Parameters, material: Array | None, listed: Any) -> PairProperties:
    """`per_pair` by its name of before, for what has `first`, `second` and `wall`."""
    return per_pair(parameters, material, listed.first, listed.second, listed.wall)
