"""Vectors kept apart by component, x, y and z of one shape each: the layout of the kernel."""

from collections.abc import Sequence

from jax import Array

Vector = Sequence[Array] | Array
"""Three components, or an array of them."""


def dot(a: Vector, b: Vector) -> Array:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
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
