"""The closure of Carman (1937) and Kozeny (1927): liquid seeps through a packing of equal spheres.

f_w = 10 phi / (1 - phi)^3

All particles sink at one velocity through still liquid, whose backflow (1 - phi) u follows Darcy's
law with the permeability d^2 (1 - phi)^3 / (180 phi^2). It holds for packings, from phi = 0.2 on:
there it is 31 % below the drag of Happel's (1958) cell model, at 0.3 14 % below, at 0.5 6 %
above. In a more dilute suspension it tends to no drag at all: the result is NaN there, as at phi of
1 and more.
Source: P. C. Carman, Trans. Inst. Chem. Eng. 15, 150 (1937).
"""

from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.valid_range import ValidRange, nan_outside

SPARSEST_PACKING = 0.2
"""Least volume fraction of spheres through which liquid seeps as through a packing."""


def carman_kozeny(volume_fraction: ArrayLike) -> Array:
    """Closure of Carman and Kozeny: f_w = 10 phi / (1 - phi)^3, NaN below phi = 0.2; 1.

    Example:
      >>> print(f"{mrjax.drag.carman_kozeny(0.337):.1f}")
      11.6
    """
    return nan_outside(seepage, volume_fraction, is_packing(volume_fraction))


def seepage(volume_fraction: ArrayLike) -> Array:
    """10 phi / (1 - phi)^3, at any volume fraction below 1; 1."""
    return 10.0 * volume_fraction / (1.0 - volume_fraction) ** 3


def is_packing(volume_fraction: ArrayLike) -> Array:
    """True where spheres are a packing with liquid between them."""
    return (volume_fraction >= SPARSEST_PACKING) & (volume_fraction < 1.0)


def valid_range() -> ValidRange:
    """Returns the volume fractions of packings."""
    return ValidRange(
        SPARSEST_PACKING,
        below="more dilute spheres are no packing through which the liquid seeps",
        above="there is no liquid left",
    )
