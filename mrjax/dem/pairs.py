"""Pair list: every possible contact once, with particles and with walls, from a neighbour list.

A neighbour list holds each contact twice, and gives every particle as many slots as the most
crowded particle needs. Laws are therefore evaluated once for each pair, and their results are added
to both of its surfaces.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.box import Box
from mrjax.dem.neighbours import PAIRS_DROPPED, Neighbours
from mrjax.laws import normal
from mrjax.laws.vectors import Vector

WALL_COUNT = 6
"""Number of wall ids, from N on: walls at the lower and upper end of x, then of y, then of z."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Pairs:
    """A list with P slots for pairs of surfaces that may touch before the next rebuild."""

    first: Array
    """Id of a particle, (P,); meaningless if not present."""
    second: Array
    """Id of a particle or wall, (P,); meaningless if not present."""
    present: Array
    """True if the slot holds a pair, (P,)."""
    wall: Array | None
    """True if the second surface is a wall, (P,); None in a box without walls."""
    separation: Vector
    """Vector from the second to the first when the list was built, (P,) each."""
    places: Array
    """Slots of the pairs of each particle, (S, N).

    The entry is p if the particle is the first of pair p, P + p if it is the second, and 2 P if the
    entry is empty.
    """
    overflow: Array
    """0 if every pair is listed, ()."""

    @property
    def axis(self) -> Array:
        """Axis of a wall's normal, 0 to 2; -1 if the second surface is a particle; (P,)."""
        particles = self.places.shape[1]
        return jnp.where(self.second < particles, -1, (self.second - particles) // 2)

    @property
    def count(self) -> Array:
        """Number of listed pairs, ()."""
        return jnp.sum(self.present, dtype=jnp.int32)

    @property
    def surfaces(self) -> tuple[Array, Array, Array | None]:
        """The arrays `first`, `second` and `wall`, (P,) each; the last may be None."""
        return self.first, self.second, self.wall

    def sum_over_pairs(self, of_first: Array, of_second: Array) -> Array:
        """Sums values of pairs for each particle, taken from its own side; (P,) to (N,)."""
        total = jnp.zeros(self.places.shape[1], of_first.dtype).at[self.first].add(of_first)
        return total.at[self.second].add(of_second, mode="drop")

    def greatest(self, of_pairs: Array) -> Array:
        """Largest value over the pairs of each particle, (P,) to (N,); at least 0."""
        nothing = jnp.zeros(self.places.shape[1], of_pairs.dtype)
        return nothing.at[self._ends].max(jnp.tile(of_pairs, 2), mode="drop")

    def by_particle(self, of_first: Array, of_second: Array, nothing: float = 0) -> Array:
        """Distributes values of pairs to the slots of each particle, from its own side.

        Args:
          of_first, of_second: values for the first and second surface of each pair, (P,).
          nothing: value of empty slots.

        Returns:
          the values, (S, N).
        """
        end = jnp.full(1, nothing, of_first.dtype)
        return jnp.concatenate([of_first, of_second, end])[self.places]

    @property
    def _ends(self) -> Array:
        return jnp.concatenate([self.first, self.second])


def list_pairs(
    neighbours: Neighbours, box: Box, position: Array, radius: Array, skin: Array, room: int
) -> Pairs:
    """Lists the pairs whose surfaces are within the skin of each other.

    Args:
      neighbours: neighbour list of all particles, each pair twice, with at least this skin.
      box: the container.
      position: centres, (3, N).
      radius: contact radii, (N,).
      skin: largest gap of a listed pair, ().
      room: capacity P of the list. If there are more pairs, `overflow` is set.
    """
    particles = len(radius)
    ids = jnp.arange(particles, dtype=neighbours.partner.dtype)[None, :]
    x, y, z = (lax.stop_gradient(part) for part in neighbours.separation)
    reach = lax.stop_gradient(radius[None, :] + radius[neighbours.partner] + skin)
    near = (x**2 + y**2 + z**2 < reach**2) & neighbours.present & (neighbours.partner > ids)
    walls = [(axis, end) for axis in box.walled_axes for end in (0, 1)]
    partners, nears = [neighbours.partner], [near]
    separations: list[Vector] = [neighbours.separation]
    for axis, end in walls:
        beyond = position[axis : axis + 1] - end * box.size[axis]
        # A centre exactly on the wall counts as inside: a zero distance has no direction.
        inside = (-1.0 if end else 1.0) * normal.LEAST_DISTANCE * radius[None, :]
        beyond = jnp.where(beyond == 0.0, inside, beyond)
        nothing = jnp.zeros_like(beyond)
        partners.append(jnp.full_like(ids, particles + 2 * axis + end))
        separations.append(tuple(beyond if other == axis else nothing for other in range(3)))
        nears.append(abs(lax.stop_gradient(beyond)) < lax.stop_gradient(radius + skin)[None, :])
    if not walls and not len(neighbours.partner):  # no candidates: one dummy avoids empty arrays
        partners.append(ids)
        separations.append((jnp.zeros_like(position[:1]),) * 3)
        nears.append(ids < 0)
    partner, near = jnp.concatenate(partners), jnp.concatenate(nears)

    # In the order of the particles, for cache locality.
    (chosen,) = jnp.nonzero(near.T.reshape(-1), size=room, fill_value=0)
    present = jnp.arange(room) < jnp.sum(near)
    first, slot = (index.astype(ids.dtype) for index in jnp.divmod(chosen, len(partner)))
    second = partner[slot, first]
    wall = second >= particles
    separation = tuple(
        jnp.concatenate(part)[slot, first] for part in zip(*separations, strict=True)
    )
    too_many = jnp.where(jnp.sum(near) > room, PAIRS_DROPPED, 0).astype(jnp.int32)
    return Pairs(
        first,
        second,
        present,
        wall if walls else None,
        separation,
        _places(first, second, present, particles, neighbours.partner.shape[0] + len(walls)),
        neighbours.overflow | too_many,
    )


def _places(first: Array, second: Array, present: Array, particles: int, slots: int) -> Array:
    room = len(first)
    ends = jnp.where(jnp.tile(present, 2), jnp.concatenate([first, second]), particles)
    order = jnp.argsort(ends).astype(ends.dtype)
    begin = jnp.searchsorted(ends[order], jnp.arange(particles + 1, dtype=ends.dtype))
    begin = begin.astype(ends.dtype)
    places = begin[None, :-1] + jnp.arange(slots, dtype=begin.dtype)[:, None]
    order = jnp.concatenate([order, jnp.zeros(slots, order.dtype)])
    return jnp.where(places < begin[None, 1:], order[places], 2 * room).astype(jnp.int32)
