"""The minmod limiter of a slope (Roe 1986)."""

import jax.numpy as jnp
from jax import Array


def minmod(below: Array, above: Array) -> Array:
    """Returns the smaller one of two slopes, and zero at an extremum; of their shape."""
    smaller = jnp.where(jnp.abs(below) < jnp.abs(above), below, above)
    return jnp.where(below * above > 0.0, smaller, 0.0)
