"""The container: its size, and for each axis either periodic images or a pair of walls."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Real

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.errors import InputError, shown
from mrjax.core.promotion import relaxed_promotion

AXES = ("x", "y", "z")
SMALLEST, LARGEST = 1e-30, 1e30
"""Bounds of the magnitude of any quantity in SI; numbers beyond them overflow or underflow."""


@jax.tree_util.register_static
@dataclass(frozen=True)
class Box:
    """A cuboid from the origin to `size`; gravity points along -z.

    A box is hashable and never traced, because it fixes the array shapes of a run.

    Args:
      size: edge lengths (x, y, z), m.
      periodic: for each axis, True for periodic images, False for a wall at either end.

    Raises:
      InputError: `size` or `periodic` does not describe a cuboid.
    """

    size: tuple[float, float, float]
    periodic: tuple[bool, bool, bool] = (False, False, False)

    def __post_init__(self) -> None:
        if not _three(self.size, Real) or not all(
            SMALLEST <= length <= LARGEST for length in self.size
        ):
            raise InputError(
                f"size = {shown(self.size)} must be three positive lengths in m, from "
                f"{SMALLEST:g} to {LARGEST:g}"
            )
        if not _three(self.periodic, bool):
            raise InputError(
                f"periodic = {shown(self.periodic)} must be three flags, true or false, for x, y "
                "and z"
            )
        size = tuple(float(length) for length in self.size)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "periodic", tuple(self.periodic))

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return math.prod(self.size)

    @property
    def height(self) -> float:
        """Extent along gravity, m."""
        return self.size[2]

    @property
    def walled_axes(self) -> tuple[int, ...]:
        """The axes with walls at both ends."""
        return tuple(axis for axis in range(3) if not self.periodic[axis])

    def scaled(self, factor: float) -> "Box":
        """The same box with every length multiplied by `factor`."""
        x, y, z = self.size
        return Box((x * factor, y * factor, z * factor), self.periodic)

    def space(self) -> tuple[Callable, Callable]:
        """Returns jax-md's pair of functions for this box, both on positions (..., 3) in m.

        Returns:
          Two functions. `displacement(first, second)` is the vector from `second` to `first`,
          to the nearest image on periodic axes. `shift(position, change)` is the moved position,
          wrapped into the box on periodic axes.
        """
        from mrjax.core._jax_md import space

        # numpy arrays: jax-md's functions form a reference cycle. They would hold a traced value,
        # and with it dead code in the program, until the garbage collector runs.
        side, periodic = np.array(self.size), np.array(self.periodic)

        def on_periodic_axes(wrapped: Array, plain: Array) -> Array:
            return jnp.where(jnp.broadcast_to(periodic, plain.shape), wrapped, plain)

        def displacement(first: Array, second: Array, **_: object) -> Array:
            plain = first - second
            if not any(self.periodic):
                return plain
            with relaxed_promotion():
                return on_periodic_axes(space.periodic_displacement(_side(plain), plain), plain)

        def shift(position: Array, change: Array, **_: object) -> Array:
            with relaxed_promotion():
                wrapped = space.periodic_shift(_side(position), position, change)
            return on_periodic_axes(wrapped, position + change)

        def _side(like: Array) -> Array:
            return jnp.broadcast_to(side.astype(like.dtype), like.shape)

        return displacement, shift

    def wrap(self, position: Array) -> Array:
        """Moves positions (N, 3), in m, into the box along its periodic axes, with JAX."""
        _, shift = self.space()
        return shift(position, jnp.zeros_like(position))

    def image(self, position: np.ndarray) -> np.ndarray:
        """Returns the periodic image in which each position lies, with numpy.

        Args:
          position: positions, (..., 3) in m.

        Returns:
          Whole numbers, (..., 3): 0 in the box and on axes with walls.
        """
        return np.where(self.periodic, np.floor(position / np.asarray(self.size)), 0.0)

    def inside(self, position: np.ndarray, *, below: bool = False) -> np.ndarray:
        """Moves positions into the box along its periodic axes, with numpy.

        Args:
          position: positions, (..., 3) in m.
          below: True to keep all positions below the upper end: a position that rounding puts on
            the upper end becomes 0, as a k-d tree needs.

        Returns:
          Positions, (..., 3) in m.
        """
        size = np.asarray(self.size)
        moved = position - size * self.image(position)
        if below:
            moved = np.where(np.asarray(self.periodic) & (moved >= size), 0.0, moved)
        return moved


def _three(values: object, kind: type) -> bool:
    """True if these are three values of a kind; True and False do not count as numbers."""
    return (
        isinstance(values, Iterable)
        and len(items := list(values)) == 3
        and all(isinstance(v, kind) and isinstance(v, bool) == (kind is bool) for v in items)
    )
