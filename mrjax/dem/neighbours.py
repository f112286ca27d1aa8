"""Neighbour list of jax-md, in the layout that the pair list reads.

The list holds every pair within `cutoff`: pairs in contact, plus a skin for pairs that may touch
before the next rebuild. Rebuilds occur only between fixed intervals of steps. Lengths are in the
unit of the positions.

This module works around three properties of jax-md 0.2.29:
- It silently falls back to all pairs if the box is less than three cells wide. Here such an axis
  gets three cells, each a neighbour of the other two, and the true distance decides. So narrow
  columns keep their cells along the other axes.
- A list that is too short drops pairs and sets a flag. The flag is stored with the list.
- An empty slot holds the index N, which would read the last particle. `present` masks it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax.core._jax_md import partition
from mrjax.core.box import Box
from mrjax.core.promotion import relaxed_promotion

PAIRS_DROPPED = int(partition.PartitionErrorCode.NEIGHBOR_LIST_OVERFLOW)
CELLS_OVERFULL = int(partition.PartitionErrorCode.CELL_LIST_OVERFLOW)

RANDOM_PACKING = 0.64
"""Volume fraction of a random close packing."""


@dataclass(frozen=True)
class ListPlan:
    """Sizes of a neighbour list: concrete numbers, never traced."""

    cutoff: float  # largest distance of centres of a listed pair
    cell: float  # smallest edge of a search cell
    capacity: int  # K, slots for partners of each particle
    cell_capacity: int  # slots for particles in each cell
    pairs: int  # P, slots for pairs within the skin of each other

    def grown(self, overflow: int, particles: int) -> "ListPlan":
        """Returns a plan with larger buffers where a list built by this plan overflowed."""

        def more(capacity: int, bit: int, limit: int) -> int:
            return min(limit, capacity + capacity // 2 + 1) if overflow & bit else capacity

        return replace(
            self,
            capacity=more(self.capacity, PAIRS_DROPPED, particles - 1),
            cell_capacity=more(self.cell_capacity, CELLS_OVERFULL, particles),
            pairs=more(self.pairs, PAIRS_DROPPED, particles * (particles + 11) // 2),
        )


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Neighbours:
    """Possible partners of every particle at the time when the list was built."""

    partner: Array  # (K, N) particle ids; meaningless where not present
    present: Array  # (K, N) True if the slot holds a partner
    separation: tuple[Array, Array, Array]  # x, y, z from partner to particle, (K, N) each
    overflow: Array  # () PAIRS_DROPPED, CELLS_OVERFULL or both; 0 when every pair is listed


def plan_list(
    box: Box,
    particles: int,
    largest_diameter: float,
    typical_diameter: float,
    skin: float,
    reach: float = 0.0,
) -> ListPlan:
    """Sizes a neighbour list for the densest bed that such particles usually form.

    Args:
      box: the container, in the unit of the diameters.
      particles: number of particles N.
      largest_diameter: largest contact diameter.
      typical_diameter: diameter of a sphere of the mean particle volume. If sizes differ widely, a
        large particle may have more partners than slots, and the plan must be `grown`.
      skin: distance beyond contact and reach up to which pairs are listed.
      reach: largest gap between surfaces at which a force acts.
    """
    cutoff = largest_diameter + reach + skin
    # More than eight cells per particle would only cost memory.
    cell = max(cutoff, (box.volume / (8 * particles)) ** (1 / 3))
    typical = typical_diameter / 2
    # Half of the volume within reach of partners, at random packing, less the particle itself.
    volume = (cutoff + typical) ** 3 - (largest_diameter / 2) ** 3
    capacity = math.ceil(0.5 * volume / typical**3)
    # Number of packed spheres with centres in a cell as widened by jax-md, corners included.
    fitting = [math.floor(length / cell) for length in box.size]
    edges = [x / n if n >= 3 else cell for x, n in zip(box.size, fitting, strict=True)]
    packed = 0.7 * math.prod(edge / typical_diameter + 1 for edge in edges)
    in_cell = max(8, math.ceil(packed))
    # A random bed of equal spheres has 2.5 contacts per particle, walls included, and half a pair
    # more within a gap of a twentieth of a diameter.
    of_each = 3.0 + 10.0 * skin / largest_diameter
    if reach:
        of_each = max(of_each, RANDOM_PACKING * capacity)
    every_contact = particles * (particles - 1) // 2 + 2 * particles * len(box.walled_axes)
    return ListPlan(
        cutoff=cutoff,
        cell=cell,
        capacity=min(particles - 1, capacity),
        cell_capacity=min(particles, in_cell),
        pairs=max(8, min(every_contact, max(math.ceil(of_each * particles), 100))),
    )


def build(plan: ListPlan, box: Box, position: Array, stretch: Array | None = None) -> Neighbours:
    """Builds the neighbour list of `position`, (N, 3). Works under jit, grad and vmap.

    Args:
      plan: sizes of the list.
      box: the container.
      position: centres, (N, 3).
      stretch: edges of the container over those of `box`, at least 1, (3,); None for `box` itself.
        One compiled program then serves a periodic container of any size.
    """
    particles = position.shape[0]
    displacement, _ = box.space()
    if stretch is not None:
        position = position / jnp.broadcast_to(stretch, position.shape)
        displacement = _stretched(displacement, stretch)
    if particles == 1:
        none = jnp.zeros((plan.capacity, particles))
        return Neighbours(
            none.astype(jnp.int32),
            none.astype(bool),
            (none.astype(position.dtype),) * 3,
            jnp.zeros((), jnp.int32),
        )
    with relaxed_promotion():
        found = _search(plan, box, displacement, lax.stop_gradient(box.wrap(position)))
    partner = found.idx.T
    present = partner < particles
    partner = jnp.minimum(partner, particles - 1)
    vector = displacement(jnp.broadcast_to(position, (*partner.shape, 3)), position[partner])
    return Neighbours(
        partner,
        present,
        (vector[..., 0], vector[..., 1], vector[..., 2]),
        found.error.code.astype(jnp.int32),
    )


def _stretched(displacement: Callable, stretch: Array) -> Callable:
    """Displacement in a stretched container, for positions over the stretch.

    Cells of the small box are no smaller in the container, and the true distance decides.
    """

    def stretched(first: Array, second: Array, **keywords: Any) -> Array:
        vector = displacement(first, second, **keywords)
        return jnp.broadcast_to(stretch, vector.shape) * vector

    return stretched


def _search(plan: ListPlan, box: Box, displacement: Callable, position: Array) -> Any:
    size = np.array(box.size)
    three_cells = 3.001 * plan.cell
    grid = np.where(size <= three_cells, three_cells, size)
    functions = partition.neighbor_list(
        displacement, grid, plan.cutoff, format=partition.NeighborListFormat.Dense
    )
    # jax-md would size its buffers for the present positions. But a suspension settles into a
    # denser bed, and under jit the positions are unknown.
    room = partition.NeighborList(
        idx=jnp.zeros((position.shape[0], plan.capacity), jnp.int32),
        reference_position=position,
        error=partition.PartitionError(jnp.zeros((), jnp.uint8)),
        cell_list_capacity=plan.cell_capacity,
        max_occupancy=plan.capacity,
        format=partition.NeighborListFormat.Dense,
        cell_size=plan.cell,
        cell_list_fn=partition.cell_list(grid, plan.cell),
        update_fn=functions.update,
    )
    return functions.update(position, room)


def smallest_gap(neighbours: Neighbours, radius: Array) -> Array:
    """Smallest gap between the surfaces of two listed particles, (), in the unit of the radius.

    The gap is negative if particles overlap, and infinite if no pair is listed. `radius` has shape
    (N,).
    """
    x, y, z = neighbours.separation
    distance = jnp.sqrt(x**2 + y**2 + z**2)
    gap = distance - radius[None, :] - radius[neighbours.partner]
    return jnp.min(jnp.where(neighbours.present, gap, jnp.inf), initial=jnp.inf)
