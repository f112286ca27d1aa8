"""The diameter ratio of Eq. 15, which measures how close the neighbours of a particle are."""

import math

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def diameter_ratio(volume_fraction: ArrayLike) -> Array:
    """Diameter ratio lambda = 1 / ((4 pi / 3 phi)^(1/3) - 1) of Eq. 15; 1.

    It measures how close the neighbours of a particle are.
    """
    return 1.0 / (jnp.cbrt(4.0 * jnp.pi / (3.0 * volume_fraction)) - 1.0)


def volume_fraction_at(ratio: ArrayLike) -> ArrayLike:
    """Volume fraction at a diameter ratio: the inverse of Eq. 15; 1."""
    return 4.0 * math.pi / (3.0 * (1.0 + 1.0 / ratio) ** 3)
