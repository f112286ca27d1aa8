"""Columns of spheres under gravity, and the law of their contacts for an integration."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

import mrjax

from .. import impacts, reference
from ..impacts import Scene
from ..reference import Contact, Material

GRAVITY = 9.81
DOP853 = "Hertz' law with gravity, integrated by DOP853"
INTEGRATED_BAR = 1e-3


def columns(
    heights: ArrayLike,
    radius: float,
    material: Sequence[Material],
    room: float,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    wall: Material = reference.RIGID,
    duration: float,
    time_step: float,
    skin: float = impacts.SKIN,
    **contacts: ArrayLike,
) -> Scene:
    """Columns of spheres side by side under gravity, between a floor and a ceiling.

    Args:
      heights: of the centres, m, (levels, columns).
      radius: of all, m.
      material: of each level.
      room: from the floor to the ceiling, m.
      velocity: of all, m/s.
      wall: of the floor and the ceiling.
      duration, time_step, skin: of the run.
      **contacts: what `Parameters` says of contacts, for each column.
    """
    heights = np.asarray(heights, float)
    levels, count = heights.shape
    width = impacts.ROOM * radius
    across = np.broadcast_to(width * (np.arange(count) + 0.5), heights.shape)
    position = np.stack([np.full(heights.shape, width / 2), across, heights], axis=-1)
    position = position.reshape(-1, 3)
    return Scene(
        mrjax.place(
            position,
            np.broadcast_to(velocity, position.shape),
            materials=np.tile(np.arange(count), levels),
        ),
        mrjax.Parameters(
            radius=radius,
            **impacts.solids([solid for solid in material for _ in range(count)]),
            wall_elastic_modulus=wall.modulus,
            wall_poisson_ratio=wall.poisson,
            gravity=GRAVITY,
            **impacts.NO_FLUID,
            **{name: impacts.table(values, count) for name, values in contacts.items()},
        ).astype(float),
        mrjax.Box((width, width * count, room), periodic=(True, True, False)),
        duration,
        time_step,
        skin,
    )


def push(contact: Contact, restitution: float) -> Callable[[float, float], float]:
    """F_n of an overlap, m, and the rate at which it grows, m/s; N."""
    damping = reference.damping_ratio(restitution) * np.sqrt(5.0 * contact.mass * contact.stiffness)

    def force(overlap: float, closing: float) -> float:
        depth = max(overlap, 0.0)
        return max(contact.stiffness * depth**1.5 + damping * depth**0.25 * closing, 0.0)

    return force
