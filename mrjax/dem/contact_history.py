"""Contact history: the values that a pair carries from step to step, such as tangential springs.

The neighbour list is rebuilt and reordered many times during one contact. The history is therefore
stored with the id of the partner, and looked up by that id after a rebuild. Each wall has an id of
its own. Vectors of the history rotate with the tangent plane of the contact.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.quantities import dimension
from mrjax.core.state import NOBODY, WALLS, ContactHistory, widened
from mrjax.core.units import SI, Units
from mrjax.dem.pairs import Pairs
from mrjax.laws.vectors import Vector, cross, dot, plus, times

History = dict[str, Array]
"""History of every pair, by name, in the sense of its first surface: (3, P) or (P,)."""


class Remembered(NamedTuple):
    """Size and unit of one entry of the history of a pair, as `PairForce.memory` names it.

    Example:
      >>> mrjax.Remembered(1, "s"), mrjax.Remembered(3, "m").size
      (Remembered(size=1, unit='s'), 3)
    """

    size: int
    """3 for a vector, whose sign is reversed for the partner; 1 for a number, the same for both."""
    unit: str = "1"
    """SI unit, written as for `mrjax.quantity`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ParticleHistory:
    """`ContactHistory` in the layout and units of the engine, with S slots for each particle.

    After a rebuild of the neighbour list, the history of each pair is looked up here.
    """

    partner: Array  # id of the partner in each slot, (S, N)
    memory: dict[str, tuple[Array, ...]]  # history by name, (S, N) for each component

    def of_pairs(self, holder: Array, partner: Array) -> History:
        """History of each (holder, partner) pair, ids (P,); zero without earlier contact."""
        # At most one slot holds each partner.
        same = self.partner[:, holder] == partner[None, :]
        slots = jnp.arange(len(same), dtype=holder.dtype)[:, None]
        met, slot = jnp.any(same, axis=0), jnp.sum(jnp.where(same, slots, 0), axis=0)

        def rows(components: tuple[Array, ...]) -> Array:
            if len(same):
                values = [jnp.where(met, part[slot, holder], 0.0) for part in components]
            else:
                values = [jnp.zeros(len(holder), part.dtype) for part in components]
            return jnp.stack(values) if len(values) > 1 else values[0]

        return {name: rows(components) for name, components in self.memory.items()}


def pairs_from_particles(history: ParticleHistory, pairs: Pairs) -> History:
    """Looks up the history of the pairs of a list, (P,); the history of other pairs is dropped."""
    _, partner = _surface_ids(pairs)
    return history.of_pairs(pairs.first, jnp.where(pairs.present, partner, NOBODY - 1 - len(WALLS)))


def particles_from_pairs(history: History, pairs: Pairs) -> ParticleHistory:
    """Stores the history of every pair for both of its surfaces, each in a slot of its own.

    For the second surface the sign of a vector is reversed, and a number is unchanged.
    """

    def both(rows: Array) -> tuple[Array, ...]:
        if rows.ndim == 1:
            return (pairs.by_particle(rows, rows),)
        return tuple(pairs.by_particle(part, -part) for part in rows)

    first, second = _surface_ids(pairs)
    return ParticleHistory(
        pairs.by_particle(second, first, nothing=NOBODY),
        {name: both(rows) for name, rows in history.items()},
    )


def _surface_ids(pairs: Pairs) -> tuple[Array, Array]:
    """Ids of first and second surfaces, numbered as in `ContactHistory`; (P,) each."""
    walls = jnp.array(WALLS, pairs.second.dtype)
    particles = pairs.places.shape[1]
    wall = walls[jnp.maximum(pairs.second - particles, 0)]
    return pairs.first, jnp.where(pairs.second < particles, pairs.second, wall)


def from_state(
    contacts: ContactHistory | None,
    like: Array,
    *,
    slots: int,
    memory: Mapping[str, Remembered],
    units: Units = SI,
) -> ParticleHistory:
    """Converts the contact history of a state to S slots; entries without history are zero.

    Args:
      contacts: contact history of the state, or None.
      like: an array (N, ...) that gives the number of particles and the dtype.
      slots: number S of slots, at least as many as the state has.
      memory: size and unit of each entry of the history, by name.
      units: units of the result.
    """
    held = widened(contacts, slots)
    if held is None:
        nobody = np.full((like.shape[0], slots), NOBODY, np.int32)  # numpy: nothing to compile
        held = ContactHistory(jnp.asarray(nobody), None, None)

    def components(name: str, kind: Remembered) -> tuple[Array, ...]:
        rows, unit = held.by_name.get(name), units.scale(dimension(kind.unit))
        if rows is None:
            return (jnp.zeros((slots, like.shape[0]), like.dtype),) * kind.size
        if kind.size == 1:
            return (rows.T / unit,)
        return tuple(rows[..., axis].T / unit for axis in range(kind.size))

    return ParticleHistory(
        held.partner.T, {name: components(name, kind) for name, kind in memory.items()}
    )


def to_state(
    history: ParticleHistory,
    nan_if_faulty: Array,
    *,
    memory: Mapping[str, Remembered],
    units: Units = SI,
) -> ContactHistory | None:
    """Converts a history to SI, as part of a state; None if pairs have no history.

    Args:
      history: the history, in the units of the engine.
      nan_if_faulty: factor on all values: 1, or NaN if the run has a fault, ().
      memory: size and unit of each entry of the history, by name.
      units: units of `history`.
    """
    if not history.memory:
        return None

    def rows(name: str) -> Array:
        components, unit = history.memory[name], units.scale(dimension(memory[name].unit))
        if len(components) == 1:
            return nan_if_faulty * unit * components[0].T
        return nan_if_faulty * unit * jnp.stack([part.T for part in components], axis=-1)

    return ContactHistory.of_names(history.partner.T, {name: rows(name) for name in history.memory})


def rotate_into_tangent_plane(vector: Vector, normal: Vector, turn: Vector, twist: Array) -> Vector:
    """Rotates a vector of the old tangent plane, with the contact, into the new tangent plane.

    The result is perpendicular to the new normal. Its length is conserved up to terms of fourth
    order in the angles.

    Args:
      vector: a vector perpendicular to the normal of the previous step.
      normal: normal of this step.
      turn: change of the normal since the previous step.
      twist: mean angle by which the two surfaces turned about the normal, rad.
    """
    # Perpendicular to the old normal, n - turn: R v = v - (v.n)(n + n_old) / (1 + n.n_old).
    vector = plus(vector, -dot(vector, normal), plus(normal, -0.5, turn))
    return plus(times(1.0 - 0.5 * twist**2, vector), twist, cross(normal, vector))
