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

    modulus: Array
    """Effective modulus E*, Pa."""
    shear_modulus: Array
    """Effective shear modulus G*, Pa."""
    radius: Array
    """Effective radius R*, m."""
    mass: Array
    """Reduced mass m*, kg."""
    rolling_inertia: Array
    """Moment of inertia I_r about the contact point, kg m^2."""
    friction: Array
    """Coulomb's coefficient mu; 1."""
    damping: Array
    """Damping ratio z of `normal.damping_ratio`; 1."""
    dissipation: Array
    """A of Eq. 4, s."""
    tangential_dissipation: Array
    """B of Eq. 7, s."""
    rolling_friction: Array
    """Coefficient mu_r of rolling friction; 1."""
    rolling_damping: Array
    """Fraction h_r of critical damping of rolling; 1."""
    pull_off: Array | None = None
    """Pull-off force F_c, N; None without attraction."""


class SurfacePairs(NamedTuple):
    """Pairs of surfaces, and how values of particles become values of pairs; P pairs."""

    first: ArrayLike
    """Ids of particles, (P,)."""
    second: ArrayLike
    """Ids of their partners, particles or walls, (P,)."""
    wall: ArrayLike | None
    """True where the second is a wall, (P,); None in a box without walls."""
    material: Array | None
    """Index of each particle into tables by material, (N,); None where all are of one."""
    coated: CoatedParticle
    """The coated particles."""

    @staticmethod
    def by_kind(walled: bool, coated: CoatedParticle) -> "SurfacePairs":
        """One pair of two particles and, in a box with walls, one with a wall; all are alike.

        Args:
          walled: True for a box with walls.
          coated: the coated particles.
        """
        first = jnp.zeros(1 + walled, jnp.int32)
        wall = np.array([False, True]) if walled else None
        return SurfacePairs(first, first, wall, None, coated)

    def sides(self, leaf: Array, of_wall: Array | None = None) -> tuple[Array, Array]:
        """A leaf, () or (N,), of the first and of the second surface; (P,), or () where equal.

        Args:
          leaf: of the particles.
          of_wall: of the walls; left out, the value at walls means nothing.
        """
        # A wall's id is beyond the last particle's, which is read in its place.
        equal = jnp.ndim(leaf) == 0
        mine, theirs = (leaf, leaf) if equal else (leaf[self.first], leaf[self.second])
        if of_wall is not None and self.wall is not None:
            theirs = jnp.where(self.wall, of_wall, theirs)
        return mine, theirs

    def harmonic(self, leaf: Array) -> Array:
        """1/(1/a + 1/b) of a leaf, () or (N,), as for R* and m*; at a wall the particle's own."""
        mine, theirs = self.sides(leaf)
        between = normal.harmonic(mine, theirs)
        return between if self.wall is None else jnp.where(self.wall, mine, between)

    def by_material(self, leaf: Array) -> Array:
        """Entries of a table by material, the walls last; (P,), or () for one number."""
        if jnp.ndim(leaf) == 0:
            return leaf
        index = jnp.zeros(1, jnp.int32) if self.material is None else self.material
        at_wall = leaf[index[self.first], -1]
        mine, theirs = index[self.first], index[self.second]
        between = leaf[mine, theirs]
        return between if self.wall is None else jnp.where(self.wall, at_wall, between)

    @property
    def reduced_radius(self) -> Array:
        """R* of Eq. 6, m; (P,) or ()."""
        return self.harmonic(self.coated.radius)


def of_surfaces(parameters: Parameters, surfaces: SurfacePairs) -> PairProperties:
    """Properties of the contacts between surfaces; a wall is of infinite radius and mass."""
    sides, table = surfaces.sides, surfaces.by_material
    (modulus_i, modulus_j), (poisson_i, poisson_j) = (
        sides(parameters.elastic_modulus, parameters.wall_elastic_modulus),
        sides(parameters.poisson_ratio, parameters.wall_poisson_ratio),
    )
    materials = (modulus_i, poisson_i, modulus_j, poisson_j)
    radius, mass, moment = surfaces.coated
    return PairProperties(
        normal.effective_modulus(*materials),
        tangential.effective_shear_modulus(*materials),
        surfaces.harmonic(radius),
        surfaces.harmonic(mass),
        surfaces.harmonic(rolling.contact_inertia(moment, mass, radius)),
        table(parameters.friction),
        table(normal.damping_ratio(parameters.restitution)),
        table(parameters.dissipation),
        table(parameters.tangential_dissipation),
        table(parameters.rolling_friction),
        table(parameters.rolling_damping),
    )


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
    return of_surfaces(parameters, SurfacePairs(first, second, wall, material, coated))


def alike(parameters: Parameters, material: Array | None) -> bool:
    """True if all particles are of one material, size and mass."""
    radius, inertia, _ = particle.coated_particle(parameters)
    leaves = radius, inertia, parameters.elastic_modulus, parameters.poisson_ratio
    return material is None and not any(jnp.ndim(leaf) for leaf in leaves)


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
    if not alike(parameters, material):
        return None
    coated = particle.coated_particle(parameters) if coated is None else coated
    return of_surfaces(parameters, SurfacePairs.by_kind(walled, coated))


Surfaces = PairProperties
"""The old name of `PairProperties`."""
of_kinds = per_kind
"""The old name of `per_kind`."""


def of(parameters: Parameters, material: Array | None, listed: Any) -> PairProperties:
    """The old name of `per_pair`, for an object with `first`, `second` and `wall`."""
    return per_pair(parameters, material, listed.first, listed.second, listed.wall)
