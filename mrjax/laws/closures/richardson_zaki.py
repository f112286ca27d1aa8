"""The closure of Richardson & Zaki (1954): equal hard spheres that settle apart.

f_w = (1 - phi)^-n

It holds for spheres that do not attract each other, at low Reynolds numbers, up to dense
suspensions; a bed has less permeability. The default exponent of 4.65 is that of their data. It is
on neither of the two branches that later data have: 5.6 at low and 4.48 at high Peclet numbers
(`brzinski_durian`).
Source: J. F. Richardson & W. N. Zaki, Trans. Inst. Chem. Eng. 32, 35 (1954).
"""

from jax import Array
from jax.typing import ArrayLike

RICHARDSON_ZAKI_EXPONENT = 4.65
"""The exponent of Richardson & Zaki at low Reynolds numbers."""


def richardson_zaki(
    volume_fraction: ArrayLike, exponent: ArrayLike = RICHARDSON_ZAKI_EXPONENT
) -> Array:
    """Closure of Richardson & Zaki (1954): f_w = (1 - phi)^-n; 1.

    The default n = 4.65 is on neither branch of later data: n = 5.6 at low and 4.48 at high Peclet
    numbers (Brzinski & Durian, arXiv 1710.09314), the exponents of `brzinski_durian`.
    """
    return (1.0 - volume_fraction) ** (-exponent)
