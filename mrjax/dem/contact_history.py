"""What contacts remember: displacements along the tangent plane, turned with it, by partner's id.

A neighbour list is rebuilt and its slots reordered many times during one contact. Memories are
therefore found again by the id of the partner. Walls are partners with ids of their own.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import DTypeLike

from mrjax.laws.vectors import Vector, cross, dot, plus, times

if TYPE_CHECKING:
    from mrjax.dem.pairs import Pairs  # which comes with jax-md, that a state does without

NOBODY = -1
WALLS = (-2, -3, -4, -5, -6, -7)
"""Ids of an empty slot, and of the walls at the lower and upper end of x, y and z."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Contacts:
    """The memory of every contact of a state, each held by both particles; S slots for each.

    `sliding` and `rolling` are None where no law reads them.
    """

    partner: Array
    """Ids: of a particle, -1 in an empty slot, -2 to -7 for the walls at the lower and
    upper end of x, y and z; (N, S)."""
    sliding: Array | None
    """Displacement of the particle's surface along its partner's, (N, S, 3) in m."""
    rolling: Array | None
    """Angle rolled on the partner, (N, S, 3) in rad."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Memory:
    """What contacts remember, each as the first of its two surfaces sees it."""

    sliding: Vector | None  # (3, P), or three scalars of one contact; None where no law reads it
    rolling: Vector | None


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Notes:
    """`Contacts` in the kernel's layout and units: what a rebuild of the list finds again."""

    partner: Array  # (S, N)
    sliding: Vector | None  # (S, N)
    rolling: Vector | None  # (S, N)

    def of(self, holder: Array, partner: Array) -> Memory:
        """What the holders know of their partners, ids (P,); 0 of those they never met."""
        # At most one slot knows each partner.
        same = self.partner[:, holder] == partner[None, :]
        slots = jnp.arange(len(same), dtype=holder.dtype)[:, None]
        known, slot = jnp.any(same, axis=0), jnp.sum(jnp.where(same, slots, 0), axis=0)

        def found(vector: Vector | None) -> Vector | None:
            if vector is None:
                return None
            if not len(same):
                return jnp.zeros((3, len(holder)), vector[0].dtype)
            return jnp.stack([jnp.where(known, part[slot, holder], 0.0) for part in vector])

        return Memory(found(self.sliding), found(self.rolling))


def begun(notes: Notes, listed: "Pairs") -> Memory:
    """The memory of the listed pairs, (P,); others are forgotten."""
    _, partner = _ids(listed)
    return notes.of(listed.first, jnp.where(listed.present, partner, NOBODY - 1 - len(WALLS)))


def noted(memory: Memory, listed: "Pairs") -> Notes:
    """What both surfaces of every contact remember, in a slot of their own."""

    def both(vector: Vector | None) -> Vector | None:
        return None if vector is None else tuple(listed.seen(part, -part) for part in vector)

    first, second = _ids(listed)
    return Notes(
        listed.seen(second, first, nothing=NOBODY),
        both(memory.sliding),
        both(memory.rolling),
    )


def _ids(listed: "Pairs") -> tuple[Array, Array]:
    """Of the firsts and of the seconds, as `Contacts` has them; (P,) each."""
    walls = jnp.array(WALLS, listed.second.dtype)
    particles = listed.places.shape[1]
    wall = walls[jnp.maximum(listed.second - particles, 0)]
    return listed.first, jnp.where(listed.second < particles, listed.second, wall)


def recalled(
    contacts: Contacts | None,
    like: Array,
    *,
    slots: int,
    sliding: bool,
    rolling: bool,
    unit_length: float = 1.0,
) -> Notes:
    """The memory of a state in `slots` slots; blank where the state brings none.

    Args:
      contacts: of the state, or None.
      like: an array (N, ...) that gives the number of particles and the dtype.
      slots: S, at least as many as the state brings.
      sliding, rolling: whether a law reads these.
      unit_length: of the memory, m.
    """
    held = widened(contacts, slots)
    if held is None:
        nobody = np.full((like.shape[0], slots), NOBODY, np.int32)  # filled without a program
        held = Contacts(jnp.asarray(nobody), None, None)

    def vector(rows: Array | None, unit: float) -> Vector:
        if rows is None:
            return (jnp.zeros((slots, like.shape[0]), like.dtype),) * 3
        return tuple(rows[..., axis].T / unit for axis in range(3))

    return Notes(
        held.partner.T,
        vector(held.sliding, unit_length) if sliding else None,
        vector(held.rolling, 1.0) if rolling else None,
    )


def blank(
    particles: int, slots: int, dtype: DTypeLike, *, sliding: bool, rolling: bool
) -> Contacts | None:
    """Contacts with room for what a run will remember; None where it remembers nothing."""
    if not sliding and not rolling:
        return None
    nothing = jnp.zeros((particles, slots, 3), dtype)
    nobody = jnp.full((particles, slots), NOBODY, jnp.int32)
    return Contacts(nobody, nothing if sliding else None, nothing if rolling else None)


def widened(contacts: Contacts | None, slots: int) -> Contacts | None:
    """The same with room for `slots` contacts of each particle."""
    if contacts is None:
        return None
    spare = ((0, 0), (0, slots - contacts.partner.shape[1]))

    def wide(rows: Array | None) -> Array | None:
        return None if rows is None else jnp.pad(rows, (*spare, (0, 0)))

    partner = jnp.pad(contacts.partner, spare, constant_values=NOBODY)
    return Contacts(partner, wide(contacts.sliding), wide(contacts.rolling))


def recorded(notes: Notes, sound: Array, unit_length: float) -> Contacts | None:
    """The memory as part of a state, times a factor; None where there is none.

    Args:
      notes: in the kernel's units.
      sound: 1, or NaN where a fault was found, ().
      unit_length: of the memory, m.
    """
    if notes.sliding is None and notes.rolling is None:
        return None

    def rows(vector: Vector | None, unit: float) -> Array | None:
        if vector is None:
            return None
        return sound * unit * jnp.stack([component.T for component in vector], axis=-1)

    return Contacts(notes.partner.T, rows(notes.sliding, unit_length), rows(notes.rolling, 1.0))


def turned(vector: Vector, normal: Vector, turn: Vector, twist: Array) -> Vector:
    """A vector of the old tangent plane, turned into the new one with the contact.

    It stays perpendicular to the normal, and keeps its length to the fourth power of the angles.

    Args:
      vector: perpendicular to the normal of the step before.
      normal: of this step.
      turn: how the normal changed since.
      twist: angle by which the two surfaces together turned about the normal, rad.
    """
    # Perpendicular to the old normal, n - turn: R v = v - (v.n)(n + n_old) / (1 + n.n_old).
    vector = plus(vector, -dot(vector, normal), plus(normal, -0.5, turn))
    return plus(times(1.0 - 0.5 * twist**2, vector), twist, cross(normal, vector))


def shortening(vector: Vector, longest: Array) -> Array:
    """The factor, 0 to 1, that shortens a vector to a length; 0 where nothing is allowed.

    Its derivatives are finite. A common scale does not change it, and keeps squares in the range of
    single precision.
    """
    size = jnp.abs(vector[0]) + jnp.abs(vector[1]) + jnp.abs(vector[2]) + longest
    scale = 1.0 / lax.stop_gradient(jnp.where(size > 0.0, size, 1.0))
    vector, limit = times(scale, vector), scale * longest
    square = dot(vector, vector)
    longer = square > limit**2
    # Not where(longer, square, 1): a compiler may round this comparison differently in each place
    # that it copies it to, and a vector just shortened has exactly the limit's length.
    safe = jnp.where(size > 0.0, jnp.maximum(square, limit**2), 1.0)
    shortened = limit / jnp.sqrt(safe)
    return jnp.where(longer, shortened, jnp.where(longest > 0.0, 1.0, 0.0))
