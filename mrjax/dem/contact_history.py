"""The history of contacts: tangential displacements, rotated with the plane, by partner's id.

A neighbour list is rebuilt and its slots reordered many times during one contact. The history is
therefore found again by the id of the partner. Walls are partners with ids of their own.
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
"""What every pair remembers, by name, as the first of its two surfaces sees it: (3, P) or (P,)."""


class Remembered(NamedTuple):
    """The kind of a memory of pairs."""

    size: int
    """3 for a vector, of which the partner sees the opposite; 1 for a number that both see."""
    unit: str = "1"
    """Its unit in SI, as of `mrjax.quantity`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ParticleHistory:
    """`ContactHistory` in the kernel's layout and units: what a rebuild of the list finds again."""

    partner: Array  # (S, N)
    memory: dict[str, tuple[Array, ...]]  # by name, (S, N) for each component

    def of_pairs(self, holder: Array, partner: Array) -> History:
        """History of each (holder, partner) pair, ids (P,); zero without earlier contact."""
        # At most one slot holds each partner.
        same = self.partner[:, holder] == partner[None, :]
        slots = jnp.arange(len(same), dtype=holder.dtype)[:, None]
        met, slot = jnp.any(same, axis=0), jnp.sum(jnp.where(same, slots, 0), axis=0)

        def rows(components: tuple[Array, ...]) -> Array:
            if not len(same):
                found = jnp.zeros((len(components), len(holder)), components[0].dtype)
            else:
                found = jnp.stack([jnp.where(met, part[slot, holder], 0.0) for part in components])
            return found if len(components) > 1 else found[0]

        return {name: rows(components) for name, components in self.memory.items()}


def pairs_from_particles(history: ParticleHistory, pairs: Pairs) -> History:
    """History of the pairs of a list, (P,); that of others is dropped."""
    _, partner = _surface_ids(pairs)
    return history.of_pairs(pairs.first, jnp.where(pairs.present, partner, NOBODY - 1 - len(WALLS)))


def particles_from_pairs(history: History, pairs: Pairs) -> ParticleHistory:
    """History of both surfaces of every pair, each in a slot of its own.

    The second sees the opposite of a vector, and a number as it is.
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
    memory: Mapping[str, Remembered],
    units: Units = SI,
) -> ParticleHistory:
    """History of a state in `slots` slots; blank where the state brings none.

    Args:
      contacts: of the state, or None.
      like: an array (N, ...) that gives the number of particles and the dtype.
      slots: S, at least as many as the state brings.
      memory: what pairs remember, by name.
      units: of the history.
    """
    held = widened(contacts, slots)
    if held is None:
        nobody = np.full((like.shape[0], slots), NOBODY, np.int32)  # filled without a program
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
    """History as part of a state, times a factor; None where there is none.

    Args:
      history: in the kernel's units.
      nan_if_faulty: 1, or NaN where a fault was found, ().
      memory: what pairs remember, by name.
      units: of the history.
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
