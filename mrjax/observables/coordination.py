"""Coordination: how many others each particle of a packing touches, with and without rattlers.

A rattler takes no part in the network: it has too few contacts to be held. Particles with fewer
than `least` contacts, walls counted, are taken away until none is left, because a rattler may be
the only support of another.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core import checks
from mrjax.core.network import ContactNetwork

MOST = 24
"""Greatest number of contacts that the distribution tells apart; more count as so many."""


class Coordination(NamedTuple):
    """Numbers of contacts of a packing, walls not counted; they have no derivative."""

    number: Array
    """Number of particles that each particle touches, (N,)."""
    mean: Array
    """Mean number; 1, ()."""
    mean_without_rattlers: Array
    """Mean number of the particles that are no rattlers, rattlers not counted; 0 if all are; ()."""
    rattlers: Array
    """Share of rattlers; 1, ()."""
    distribution: Array
    """Share of the particles with 0, 1, 2, ... contacts; 1, (25,)."""


def coordination(network: ContactNetwork, *, least: int = 2) -> Coordination:
    """Coordination of a packing: mean, distribution, and the mean without rattlers.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.
      least: contacts, walls counted, below which a particle is a rattler: 2 for particles that
        stick or rub, which a chain of contacts holds; 4 for spheres without friction.

    Raises:
      InputError: `least` is no whole number above 0.
    """
    least = checks.whole(least, "least")
    everybody = jnp.ones(network.particles, bool)
    number = _contacts(network, everybody, network.between_particles)

    def without(kept: Array) -> Array:
        return kept & (_contacts(network, kept, network.touching) >= least)

    def goes_on(both: tuple[Array, Array]) -> Array:
        return jnp.any(both[0] != both[1])

    def again(both: tuple[Array, Array]) -> tuple[Array, Array]:
        return both[1], without(both[1])

    _, kept = lax.while_loop(goes_on, again, (everybody, without(everybody)))
    inner = jnp.where(kept, _contacts(network, kept, network.between_particles), 0)
    remaining = jnp.sum(kept)
    shares = jax.nn.one_hot(jnp.minimum(number, MOST), MOST + 1).mean(axis=0)
    return Coordination(
        number,
        jnp.mean(number, dtype=float),
        jnp.sum(inner) / jnp.maximum(remaining, 1),
        (network.particles - remaining) / network.particles,
        shares,
    )


def _contacts(network: ContactNetwork, kept: Array, counted: Array) -> Array:
    """Number of counted contacts with surfaces that are kept, of each particle; (N,)."""
    with_walls = jnp.concatenate([kept, jnp.ones(6, bool)])
    one = (counted & with_walls[network.first] & with_walls[network.second]).astype(jnp.int32)
    ends = jnp.zeros(network.particles + 6, jnp.int32).at[network.first].add(one)
    return ends.at[network.second].add(one)[: network.particles]
