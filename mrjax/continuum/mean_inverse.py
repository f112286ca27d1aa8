"""The mean of 1 / r over an interval in which r is linear."""

import jax.numpy as jnp
from jax import Array

SERIES_BELOW = 0.1


def mean_inverse(low: Array, high: Array) -> Array:
    """Returns ln(high / low) / (high - low), and 1 / low if both are equal; of their shape.

    Args:
      low: positive values at one end.
      high: positive values at the other end.
    """
    return 2.0 / (high + low) * _arctanh_over((high - low) / (high + low))


def _arctanh_over(ratio: Array) -> Array:
    """Returns artanh(z) / z for z between -1 and 1; 1 at 0."""
    small = jnp.abs(ratio) < SERIES_BELOW
    z = jnp.where(small, ratio, 0.0)
    series = 1.0 + z**2 * (1 / 3 + z**2 * (1 / 5 + z**2 * (1 / 7 + z**2 * (1 / 9 + z**2 / 11))))
    large = jnp.where(small, 0.5, ratio)
    return jnp.where(small, series, jnp.arctanh(large) / large)
