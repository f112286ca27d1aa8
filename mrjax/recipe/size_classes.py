"""Classes of particles from the distribution of a lab sheet, for columns of several sizes."""

from statistics import NormalDist
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.parameters import Parameters
from mrjax.recipe.sizes import Classes, Sizes

MOST_CLASSES = 1000
NODES = 32
"""Quantiles of a class over which d^2 is averaged, by Gauss and Legendre."""


class SizeClasses(NamedTuple):
    """K classes of particles, from fine to coarse."""

    parameters: Parameters
    """Parameters with one radius for each class, (K,)."""
    volume_fraction: Array
    """Volume fraction of the coated particles of each class; 1, (K,)."""
    diameters: np.ndarray
    """Diameter of the uncoated particles of each class, (K,) in m, ascending."""


def divide(diameter: float | Sizes, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Divides a distribution into classes of equal volume.

    The diameter of a class is the root of its mean d^2 by volume, so that it settles with the mean
    Stokes velocity of its particles.

    Args:
      diameter: one diameter in m, or a distribution.
      count: number of classes of a continuous distribution.

    Returns:
      Diameters, (K,) in m, ascending, and their shares of the volume, (K,).

    Raises:
      InputError: `count` is no number of classes.
    """
    count = checks.whole(count, "count", MOST_CLASSES)
    if isinstance(diameter, float):
        return np.array([diameter]), np.ones(1)
    if isinstance(diameter, Classes):
        return diameter.by_volume()
    quantiles, weight = _quantiles(count)
    squares = diameter.volume_quantiles(quantiles) ** 2 @ weight
    return np.sqrt(squares), np.full(count, 1.0 / count)


def log_normal_classes(geometric_standard_deviation: ArrayLike, count: int) -> Array:
    """Returns the diameters of `divide` for a log-normal distribution, over its median; 1, (K,).

    Args:
      geometric_standard_deviation: of the diameters, by volume; 1, ().
      count: number K of classes.
    """
    quantiles, weight = _quantiles(count)
    deviates = np.vectorize(NormalDist().inv_cdf)(quantiles)
    squares = jnp.asarray(geometric_standard_deviation, float) ** (2.0 * deviates)
    return jnp.sqrt(squares @ weight)


def _quantiles(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns quantiles of K classes of equal volume, (K, NODES), and their weights, (NODES,)."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    return (np.arange(count)[:, None] + 0.5 * (node + 1.0)) / count, 0.5 * weight
