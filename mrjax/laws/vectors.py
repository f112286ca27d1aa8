"""Vectors as three component arrays, x, y and z, which is the layout of the kernel."""

import math
from collections.abc import Sequence

import jax.numpy as jnp
from jax import Array, lax

Vector = Sequence[Array] | Array
"""Three components, or an array with them along its first axis."""


def dot(a: Vector, b: Vector) -> Array:
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product of two vectors."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def plus(a: Vector | Sequence[float], factor: Array | float, b: Vector) -> Vector:
    """The sum a + factor b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def times(factor: Array | float, a: Vector) -> Vector:
    """The product factor a."""
    return (factor * a[0], factor * a[1], factor * a[2])


def clip_factor(vector: Vector, longest: Array) -> Array:
    """Factor, 0 to 1, that shortens a vector to at most a length; 0 if that length is zero.

    Its derivatives are finite. Vector and length are scaled alike, which does not change the factor
    and keeps their squares in the range of single precision.
    """
    size = jnp.abs(vector[0]) + jnp.abs(vector[1]) + jnp.abs(vector[2]) + longest
    scale = 1.0 / lax.stop_gradient(jnp.where(size > 0.0, size, 1.0))
    vector, limit = times(scale, vector), scale * longest
    square = dot(vector, vector)
    longer = square > limit**2
    # where(longer, square, 1) would fail: a compiler may copy the comparison and round each copy
    # differently, and a vector that was just shortened has exactly the length of the limit.
    safe = jnp.where(size > 0.0, jnp.maximum(square, limit**2), 1.0)
    shortened = limit / jnp.sqrt(safe)
    return jnp.where(longer, shortened, jnp.where(longest > 0.0, 1.0, 0.0))


def rotated(vectors: Array, angle: Array) -> Array:
    """Unit vectors after a rotation by the length of an angle about its direction; (3, N).

    The formula of Rodrigues, u cos a + (a x u) sin a / a + a (a.u) (1 - cos a) / a^2, is exact. One
    step of Newton's method keeps the length at 1 in spite of rounding.

    Args:
      vectors: unit vectors u, (3, N).
      angle: vectors of rotation, rad, (3, N).
    """
    square = dot(angle, angle)
    sine, versine = _over_angle(square)
    turned = times(1.0 - square * versine, vectors)
    turned = plus(turned, sine, cross(angle, vectors))
    turned = plus(turned, versine * dot(angle, vectors), angle)
    return jnp.stack(list(times(1.5 - 0.5 * dot(turned, turned), turned)))


SMALL_ANGLE = 0.1
"""Square of an angle, rad^2, below which a series is exact to rounding and has all derivatives."""


def _over_angle(square: Array) -> tuple[Array, Array]:
    """Returns sin a / a and (1 - cos a) / a^2 of the square of an angle."""
    small = square < SMALL_ANGLE
    angle = jnp.sqrt(jnp.where(small, 1.0, square))
    sine, versine = jnp.zeros_like(square), jnp.zeros_like(square)
    near = jnp.where(small, square, 0.0)
    for order in range(7, -1, -1):
        sine = 1.0 / math.factorial(2 * order + 1) - near * sine
        versine = 1.0 / math.factorial(2 * order + 2) - near * versine
    return (
        jnp.where(small, sine, jnp.sin(angle) / angle),
        jnp.where(small, versine, (1.0 - jnp.cos(angle)) / angle**2),
    )
