"""Sorts particles in space for cache locality: particles in contact are close in memory.

A run sorts its particles at the start and returns them in their original order.
"""

from dataclasses import fields, replace

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.state import ContactHistory, State
from mrjax.dem.plan import System

SORT_FROM = 4096
"""Number of particles from which on a run sorts them; fewer fit into the cache in any order."""


def spatial_order(position: Array, box: Box, edge: float) -> Array:
    """Sorts particle ids by cell: along z, then along y, then along x; (N,).

    Args:
      position: centres, (N, 3) in m.
      box: the container.
      edge: edge of a cell, m.
    """
    place, sides = box.wrap(lax.stop_gradient(position)), []
    for axis, length in enumerate(box.size):
        cells = max(1, int(length / edge))
        index = (place[:, axis] * (cells / length)).astype(int)
        sides.append((jnp.clip(index, 0, cells - 1), cells))
    (x, _), (y, rows), (z, columns) = sides
    return jnp.argsort((x * rows + y) * columns + z)


@jax.jit
def permute_state(state: State, order: Array) -> State:
    """Returns the state with its particles permuted: entry i is particle `order[i]`.

    Args:
      state: state of the particles.
      order: permutation of the ids, (N,).
    """
    moved = {name: getattr(state, name)[order] for name in ("position", "velocity", "spin")}
    if state.material is not None:
        moved["material"] = state.material[order]
    moved["memory"] = {name: rows[order] for name, rows in state.memory.items()}
    if state.random is not None:
        moved["random"] = state.random.permuted(order)
    if state.contacts is not None:
        place = jnp.argsort(order).astype(state.contacts.partner.dtype)
        rows: ContactHistory = jax.tree.map(lambda leaf: leaf[order], state.contacts)
        partner = jnp.where(rows.partner < 0, rows.partner, place[rows.partner])
        moved["contacts"] = replace(rows, partner=partner)
    return replace(state, **moved)


def permute_system(system: System, order: Array) -> System:
    """Returns the system with its particles in the given order, (N,)."""
    return system._replace(
        state=permute_state(system.state, order),
        parameters=permute_parameters(system.parameters, order),
        forces=jax.tree.map(
            lambda leaf: leaf[order] if jnp.shape(leaf)[:1] == order.shape else leaf,
            system.forces,
        ),
    )


def permute_parameters(parameters: Parameters, order: Array) -> Parameters:
    """Returns the parameters with their leaves (N,) in the given order, (N,)."""
    by_name = {leaf.name: getattr(parameters, leaf.name) for leaf in fields(parameters)}
    vectors = {leaf.name for leaf in fields(parameters) if leaf.metadata["vector"]}
    return parameters.replace(
        **{
            name: value[order]
            for name, value in by_name.items()
            if value is not None and jnp.ndim(value) == 1 and name not in vectors
        }
    )
