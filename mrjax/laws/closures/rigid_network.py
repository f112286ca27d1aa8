"""The closure of Steinour (1944) and Michaels & Bolger (1962): a rigid network that sinks whole.

f_w = C^(1/3) 10 phi_e / (1 - phi_e)^3 (d / d_32)^2,  phi_e = C phi

Each particle encloses liquid that sinks with it, C - 1 of its own volume; the rest of the liquid
seeps through the network as Carman and Kozeny have it (`carman_kozeny`, which this is for C = 1).
C = phi_loose / phi_bed: the volume fraction at which the particles themselves would be a loose
packing, some 0.58, over that of the bed of the network. d_32 is the Sauter mean diameter, the one
that counts for the surface along which the liquid seeps.

It holds while the network is a packing with liquid around it, 0.2 <= C phi < 1: the result is NaN
elsewhere. It is a hypothesis for attracting particles that agrees with few measurements.
Sources: H. H. Steinour, Ind. Eng. Chem. 36, 618, 840, 901 (1944); A. S. Michaels & J. C. Bolger,
Ind. Eng. Chem. Fundam. 1, 24 (1962).
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.carman_kozeny import SPARSEST_PACKING, is_packing, seepage
from mrjax.laws.closures.valid_range import ValidRange, nan_outside


def rigid_network(
    volume_fraction: ArrayLike, floc_volume: ArrayLike, size_ratio: ArrayLike = 1.0
) -> Array:
    """Closure of Steinour, Michaels & Bolger, NaN unless 0.2 <= C phi < 1; 1.

    f_w = C^(1/3) 10 phi_e / (1 - phi_e)^3 (d / d_32)^2,  phi_e = C phi

    Args:
      volume_fraction: phi of the solids, of any shape; 1.
      floc_volume: C, volume of particles with enclosed liquid over volume of solids, at least 1.
      size_ratio: d_32 / d, Sauter mean diameter over the diameter of the recipe; 1.

    Example:
      >>> print(f"{mrjax.drag.rigid_network(0.337, floc_volume=1.3, size_ratio=0.8):.1f}")
      42.1
    """

    def law(enclosed: Array) -> Array:
        return jnp.cbrt(floc_volume) * seepage(enclosed) / size_ratio**2

    enclosed = floc_volume * volume_fraction
    return nan_outside(law, enclosed, is_packing(enclosed))


def valid_range(floc_volume: float, size_ratio: float = 1.0) -> ValidRange:
    """Returns the volume fractions at which the network is a packing with liquid around it."""
    return ValidRange(
        SPARSEST_PACKING / floc_volume,
        1.0 / floc_volume,
        f"at floc_volume = {floc_volume:g} the particles with their enclosed liquid are no network "
        "yet",
        f"at floc_volume = {floc_volume:g} the network fills the suspension, and does not settle "
        "by this law",
    )
