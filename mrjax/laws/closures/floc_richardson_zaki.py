"""The closure of Michaels & Bolger (1962): flocs hinder each other as Richardson & Zaki's spheres.

f_w = (1 - C phi)^-n,  C = volume of flocs over volume of solids, 5 to 100 in flocculated slurries

The volume that settles is that of the flocs with their enclosed liquid, C phi. The law holds while
the flocs are apart, C phi < 1. From there on they are a network, which does not settle by this law:
the result is NaN. Exponents of 30 to 130 in a fit of `richardson_zaki` are the sign of flocs.

A dilute suspension settles at the Stokes velocity of the particles of the recipe. That of a floc is
C^-1 (d_floc / d)^2 times as large; a fit of `f_s` or of the radius beside C has this factor.
Source: A. S. Michaels & J. C. Bolger, Ind. Eng. Chem. Fundam. 1, 24 (1962).
"""

from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.richardson_zaki import RICHARDSON_ZAKI_EXPONENT, richardson_zaki
from mrjax.laws.closures.valid_range import ValidRange, nan_outside


def floc_richardson_zaki(
    volume_fraction: ArrayLike,
    floc_volume: ArrayLike,
    exponent: ArrayLike = RICHARDSON_ZAKI_EXPONENT,
) -> Array:
    """Closure of Michaels & Bolger (1962): f_w = (1 - C phi)^-n, NaN for C phi >= 1; 1.

    Args:
      volume_fraction: phi of the solids, of any shape; 1.
      floc_volume: C, volume of flocs over volume of solids, at least 1; 1.
      exponent: n, that of Richardson & Zaki for the flocs; 1.

    Example:
      >>> print(f"{mrjax.drag.floc_richardson_zaki(0.02, floc_volume=20.0):.1f}")
      10.8
    """
    flocs = floc_volume * volume_fraction
    return nan_outside(lambda flocs: richardson_zaki(flocs, exponent), flocs, flocs < 1.0)


def valid_range(floc_volume: float, exponent: float = RICHARDSON_ZAKI_EXPONENT) -> ValidRange:
    """Returns the volume fractions at which the flocs are apart."""
    return ValidRange(
        most=1.0 / floc_volume,
        above=f"at floc_volume = {floc_volume:g} the flocs fill the suspension, a network that "
        "does not settle by this law",
    )
