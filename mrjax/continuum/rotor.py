"""A tube in the rotor of a centrifuge: acceleration that grows with the radius, and its section.

d(A phi)/dt + d(A u phi)/dr = 0,  u = v(phi) r / r_floor

r is the distance from the axis. v is the settling velocity at the acceleration of the floor,
omega^2 r_floor, in place of that of gravity. The section A is constant (straight tube), or grows
as r (sector, whose side walls are radial). q = (r / r_floor)^k, with k = 1 for a straight tube and
k = 2 for a sector, is the volume up to a radius over the volume up to the floor.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

SHAPES = {"straight": 1, "sector": 2}
"""k, the exponent of the volume up to a radius, by the shape of a tube."""
LEAST_RATIO = 0.1
"""Least radius of the top over that of the floor."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Rotor:
    """A tube in a centrifuge, whose floor is away from the axis.

    The force of Coriolis is neglected, as is the settling while the rotor speeds up. Particles are
    small enough for Stokes' drag at the acceleration of the rotor.
    """

    speed: ArrayLike
    """Speed of the rotor, rpm, ()."""
    top_radius: ArrayLike
    """Distance of the top of the suspension from the axis, m, ()."""
    floor_radius: ArrayLike
    """Distance of the floor of the tube from the axis, m, ()."""
    shape: Literal["sector", "straight"] = field(default="straight", metadata={"static": True})
    """`sector`, with radial walls, or `straight`, of constant section."""

    @property
    def exponent(self) -> int:
        """k, 1 for a straight tube and 2 for a sector."""
        return SHAPES[self.shape]

    @property
    def height(self) -> ArrayLike:
        """Height of the suspension, m, ()."""
        return self.floor_radius - self.top_radius

    @property
    def floor_acceleration(self) -> ArrayLike:
        """Acceleration omega^2 r at the floor, m/s^2, ()."""
        return (math.pi / 30.0 * self.speed) ** 2 * self.floor_radius

    @property
    def volume_to_top(self) -> ArrayLike:
        """Q at the top of the suspension; 1, ()."""
        return (self.top_radius / self.floor_radius) ** self.exponent

    def height_at(self, volume: ArrayLike) -> Array:
        """Height above the floor at which the volume from the axis is q; m, of its shape.

        Args:
          volume: q, from 0 at the axis to 1 at the floor; 1.
        """
        return self.floor_radius * (1.0 - jnp.asarray(volume) ** (1.0 / self.exponent))

    def final_ratio(self, share: ArrayLike) -> Array:
        """Height of the bed at rest over that of the suspension; 1, of the shape of the share.

        Args:
          share: volume fraction of the suspension over that of the bed, phi_0 / phi_m; 1.
        """
        in_bed = 1.0 - jnp.asarray(share) * (1.0 - self.volume_to_top)
        return self.height_at(in_bed) / self.height


class Cells(NamedTuple):
    """C cells of equal height between the floor and the top of the suspension."""

    weight: Array
    """A r over that at the floor, at the faces between cells from the lowest; 1, (C - 1,)."""
    volume: Array
    """Mean A in every cell over A at the floor; 1, (C,)."""


def cells_of(rotor: Rotor, cells: int) -> Cells:
    """Returns the faces and volumes of the cells of a tube in a rotor.

    Args:
      rotor: the tube.
      cells: number C of cells.
    """
    share = jnp.arange(cells + 1) / cells
    radius = 1.0 - share * (rotor.height / rotor.floor_radius)  # in radii of the floor
    volume = -jnp.diff(radius**rotor.exponent) / rotor.exponent
    width = rotor.height / rotor.floor_radius / cells
    return Cells(radius[1:-1] ** rotor.exponent, volume / width)


def height_of_volume(rotor: Rotor, volume: Array, cells: int) -> Array:
    """Returns the height above the floor of a volume of suspension; m, (T,).

    Args:
      rotor: the tube.
      volume: sum over cells of the filled part of each times its `Cells.volume`, (T,).
      cells: number of cells.
    """
    width = rotor.height / rotor.floor_radius / cells
    return rotor.height_at(jnp.clip(1.0 - rotor.exponent * width * volume, 0.0, 1.0))
