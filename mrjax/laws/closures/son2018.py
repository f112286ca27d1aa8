"""The closure of Son (2018): a fit to the exact drag of a sphere in a tube, with a cap.

f_w = MIN(f_max, a lambda^b + 1)                                           (Eq. 14)

It holds as the paper has it: the cap is a calibration, and not a model of crowding.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.diameter_ratio import diameter_ratio


def son2018_uncapped(
    volume_fraction: ArrayLike, coefficient: ArrayLike = 389.1530, exponent: ArrayLike = 7.5593
) -> Array:
    """Closure a lambda^b + 1: Eq. 14 without its cap; 1.

    Eq. 14 is a least-squares fit to Haberman & Sayre's exact column. For lambda from 0.1 to 0.5 it
    is a fifth to three fifths below that column.
    """
    return coefficient * diameter_ratio(volume_fraction) ** exponent + 1.0


def son2018(
    volume_fraction: ArrayLike,
    coefficient: ArrayLike = 389.1530,
    exponent: ArrayLike = 7.5593,
    cap: ArrayLike = 48.985,
) -> Array:
    """Closure of Son (2018), Eq. 14: MIN(f_max, a lambda^b + 1); 1.

    The cap is reached at lambda = 0.758, a volume fraction of 0.336. From there on, the derivatives
    with respect to the volume fraction, a and b are zero.

    Example:
      >>> float(mrjax.laws.drag.son2018(0.337))
      48.985
    """
    return jnp.minimum(cap, son2018_uncapped(volume_fraction, coefficient, exponent))


def son2018_smooth(
    volume_fraction: ArrayLike,
    coefficient: ArrayLike = 389.1530,
    exponent: ArrayLike = 7.5593,
    cap: ArrayLike = 48.985,
    sharpness: ArrayLike = 4.0,
) -> Array:
    """Closure of Son (2018), Eq. 14, with a smooth cap: (f_uncapped^-p + f_max^-p)^(-1/p); 1.

    With p = 4, the value at the point where Eq. 14 reaches its cap is 2^(-1/4) = 0.84 of the cap.
    The logarithmic slope there is half that of the uncapped law, and 2 % of it at a volume fraction
    of 0.417. A larger p follows Eq. 14 more closely and has less slope beyond that point.
    """
    uncapped = son2018_uncapped(volume_fraction, coefficient, exponent)
    return cap * (1.0 + (cap / uncapped) ** sharpness) ** (-1.0 / sharpness)
