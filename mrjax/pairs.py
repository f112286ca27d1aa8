"""What two surfaces in contact have in common: Eqs. 5, 6 and 8, and tables by material."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from mrjax import contact, friction, particle, rolling
from mrjax.parameters import Parameters


class Surfaces(NamedTuple):
    """Constants of the contacts in an array of slots; () where equal for all, else its shape."""

    modulus: Array  # E*, Pa
    shear_modulus: Array  # G*, Pa
    radius: Array  # R*, m
    mass: Array  # m*, kg
    rolling_inertia: Array  # I_r, kg m^2
    friction: Array  # mu
    damping: Array  # z of `contact.damping_ratio`
    dissipation: Array  # A, s
    tangential_dissipation: Array  # B, s
    rolling_friction: Array  # mu_r
    rolling_damping: Array  # h_r


def between_particles(parameters: Parameters, material: Array | None, partner: Array) -> Surfaces:
    """The contacts of every particle with its listed partners, () or (K, N).

    Args:
      parameters: of the run.
      material: index of each particle, (N,); None where all are of one.
      partner: ids, (K, N).
    """

    def sides(leaf: Array) -> tuple[Array, Array]:
        return (leaf, leaf) if jnp.ndim(leaf) == 0 else (leaf[None, :], leaf[partner])

    def table(leaf: Array) -> Array:
        if jnp.ndim(leaf) == 0:
            return leaf
        return leaf[0, 0] if leaf.shape == (2, 2) else leaf[material[None, :], material[partner]]

    (modulus_i, modulus_j), (poisson_i, poisson_j) = (
        sides(parameters.elastic_modulus),
        sides(parameters.poisson_ratio),
    )
    materials = (modulus_i, poisson_i, modulus_j, poisson_j)
    return Surfaces(
        contact.effective_modulus(*materials),
        friction.effective_shear_modulus(*materials),
        contact.harmonic(*sides(particle.outer_radius(parameters))),
        contact.harmonic(*sides(particle.inertia(parameters))),
        contact.harmonic(*sides(_about_contact(parameters))),
        *(table(leaf) for leaf in _tables(parameters)),
    )


def with_walls(parameters: Parameters, material: Array | None) -> Surfaces:
    """The contacts of every particle with a wall, of infinite radius and mass; () or (1, N)."""
    materials = (
        parameters.elastic_modulus,
        parameters.poisson_ratio,
        parameters.wall_elastic_modulus,
        parameters.wall_poisson_ratio,
    )

    def table(leaf: Array) -> Array:
        if jnp.ndim(leaf) == 0:
            return leaf
        return leaf[0, -1] if leaf.shape == (2, 2) else leaf[material, -1]

    surfaces = Surfaces(
        contact.effective_modulus(*materials),
        friction.effective_shear_modulus(*materials),
        particle.outer_radius(parameters),
        particle.inertia(parameters),
        _about_contact(parameters),
        *(table(leaf) for leaf in _tables(parameters)),
    )
    return Surfaces(*(leaf if jnp.ndim(leaf) == 0 else leaf[None, :] for leaf in surfaces))


def _about_contact(parameters: Parameters) -> Array:
    moment, mass = particle.moment_of_inertia(parameters), particle.inertia(parameters)
    return rolling.about_contact(moment, mass, particle.outer_radius(parameters))


def _tables(parameters: Parameters) -> tuple[Array, ...]:
    return (
        parameters.friction,
        contact.damping_ratio(parameters.restitution),
        parameters.dissipation,
        parameters.tangential_dissipation,
        parameters.rolling_friction,
        parameters.rolling_damping,
    )
