"""The history of contacts: tangential displacements, rotated with the plane, by partner's id.

A neighbour list is rebuilt and its slots reordered many times during one contact. The history is
therefore found again by the id of the partner. Walls are partners with ids of their own.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.state import NOBODY, WALLS, ContactHistory, widened
from mrjax.dem.pairs import Pairs
from mrjax.laws.vectors import Vector, cross, dot, plus, times


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PairHistory:
    """History of every pair, as the first of its two surfaces sees it."""

    sliding: Vector | None  # (3, P), or three scalars of one contact; None where no law reads it
    rolling: Vector | None


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ParticleHistory:
    """`ContactHistory` in the kernel's layout and units: what a rebuild of the list finds again."""

    partner: Array  # (S, N)
    sliding: Vector | None  # (S, N)
    rolling: Vector | None  # (S, N)

    def of_pairs(self, holder: Array, partner: Array) -> PairHistory:
        """History of each (holder, partner) pair, ids (P,); zero without earlier contact."""
        # At most one slot holds each partner.
        same = self.partner[:, holder] == partner[None, :]
        slots = jnp.arange(len(same), dtype=holder.dtype)[:, None]
        met, slot = jnp.any(same, axis=0), jnp.sum(jnp.where(same, slots, 0), axis=0)

        def rows(vector: Vector | None) -> Vector | None:
            if vector is None:
                return None
            if not len(same):
                return jnp.zeros((3, len(holder)), vector[0].dtype)
            return jnp.stack([jnp.where(met, part[slot, holder], 0.0) for part in vector])

        return PairHistory(rows(self.sliding), rows(self.rolling))


def pairs_from_particles(history: ParticleHistory, pairs: Pairs) -> PairHistory:
    """History of the pairs of a list, (P,); that of others is dropped."""
    _, partner = _surface_ids(pairs)
    return history.of_pairs(pairs.first, jnp.where(pairs.present, partner, NOBODY - 1 - len(WALLS)))


def particles_from_pairs(history: PairHistory, pairs: Pairs) -> ParticleHistory:
    """History of both surfaces of every pair, each in a slot of its own."""

    def both(vector: Vector | None) -> Vector | None:
        return None if vector is None else tuple(pairs.by_particle(part, -part) for part in vector)

    first, second = _surface_ids(pairs)
    return ParticleHistory(
        pairs.by_particle(second, first, nothing=NOBODY),
        both(history.sliding),
        both(history.rolling),
    )


def _surface_ids(pairs: Pairs) -> tuple[Array, Array]:
    """Ids of the firsts and of the seconds, as `ContactHistory` has them; (P,) each."""
    walls = jnp.array(WALLS, pairs.second.dtype)
    particles = pairs.places.shape[1]
    wall = walls[jnp.maximum(pairs.second - particles, 0)]
    return pairs.first, jnp.where(pairs.second < particles, pairs.second, wall)


def from_state(
    contacts: ContactHistory | None,
    like: Array,
    *,
    slots: int,
    sliding: bool,
    rolling: bool,
    unit_length: float = 1.0,
) -> ParticleHistory:
    """History of a state in `slots` slots; blank where the state brings none.

    Args:
      contacts: of the state, or None.
      like: an array (N, ...) that gives the number of particles and the dtype.
      slots: S, at least as many as the state brings.
      sliding, rolling: whether a law reads these.
      unit_length: of the history, m.
    """
    held = widened(contacts, slots)
    if held is None:
        nobody = np.full((like.shape[0], slots), NOBODY, np.int32)  # filled without a program
        held = ContactHistory(jnp.asarray(nobody), None, None)

    def vector(rows: Array | None, unit: float) -> Vector:
        if rows is None:
            return (jnp.zeros((slots, like.shape[0]), like.dtype),) * 3
        return tuple(rows[..., axis].T / unit for axis in range(3))

    return ParticleHistory(
        held.partner.T,
        vector(held.sliding, unit_length) if sliding else None,
        vector(held.rolling, 1.0) if rolling else None,
    )


def to_state(
    history: ParticleHistory, nan_if_faulty: Array, unit_length: float
) -> ContactHistory | None:
    """History as part of a state, times a factor; None where there is none.

    Args:
      history: in the kernel's units.
      nan_if_faulty: 1, or NaN where a fault was found, ().
      unit_length: of the history, m.
    """
    if history.sliding is None and history.rolling is None:
        return None

    def rows(vector: Vector | None, unit: float) -> Array | None:
        if vector is None:
            return None
        return nan_if_faulty * unit * jnp.stack([component.T for component in vector], axis=-1)

    return ContactHistory(
        history.partner.T, rows(history.sliding, unit_length), rows(history.rolling, 1.0)
    )


def rotate_into_tangent_plane(vector: Vector, normal: Vector, turn: Vector, twist: Array) -> Vector:
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
