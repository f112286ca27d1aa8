"""The closure of Vesilind (1968): an exponential, for sludges and flocculated slurries.

f_w = exp(k phi)

It is an empirical law of zone settling, without a volume fraction at which settling ends. Its rate
k belongs to one material and its flocculation; it holds where it was fitted.
Source: P. A. Vesilind, Water Sewage Works 115, 302 (1968).
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.valid_range import ValidRange


def vesilind(volume_fraction: ArrayLike, rate: ArrayLike) -> Array:
    """Closure of Vesilind (1968): f_w = exp(k phi); 1.

    Args:
      volume_fraction: phi of the solids, of any shape; 1.
      rate: k, above 0; 1.

    Example:
      >>> print(f"{mrjax.drag.vesilind(0.02, rate=100.0):.2f}")
      7.39
    """
    return jnp.exp(rate * volume_fraction)


def valid_range(rate: float) -> ValidRange:
    """Returns all volume fractions: the law has no end of its own."""
    return ValidRange(above="there is no liquid left")
