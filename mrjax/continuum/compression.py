"""A compressible bed, which consolidates under its own weight: the effective solid stress.

sigma(phi) = sigma_0 ((phi / phi_gel)^k - 1) for phi > phi_gel, else 0
d phi/dt = d/dz [ f(phi) (1 + sigma'(phi) (d phi/dz) / (Delta rho g phi)) ]

This is the phenomenological theory of Buerger, Concha & Karlsen (Buerger & Wendland, J. Eng. Math.
41, 2001). The network of touching particles carries the stress, and the fluid carries the rest of
the net weight. Darcy's law therefore has Delta rho g phi + d sigma/dz in place of the net weight
Delta rho g phi, with which f is defined. At rest the stress carries all the weight above.

The scheme is in `consolidation`.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.hindrance import Hindrance

DENSEST = 0.74
"""Volume fraction that a yielding bed does not exceed, unless stated: the closest packing of equal
spheres."""


def densest_bed(closure: Hindrance | None) -> Array:
    """Returns the volume fraction that a yielding bed does not exceed, unless stated; 1, ().

    Args:
      closure: closure of f_w; flocs fill their bed at 1 / C.
    """
    flocs = getattr(closure, "keywords", {}).get("floc_volume")
    if flocs is None:
        return jnp.asarray(DENSEST, float)
    return jnp.minimum(DENSEST, full_of_flocs(flocs))


def full_of_flocs(floc_volume: ArrayLike) -> Array:
    """Returns the volume fraction of the solids where flocs all but fill the space; 1, ().

    Args:
      floc_volume: C, volume of flocs over volume of solids; 1, ().
    """
    return 0.999 / jnp.asarray(floc_volume, float)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Compression:
    """The effective solid stress of a bed, given by three numbers."""

    gel_fraction: ArrayLike
    """phi_gel, volume fraction at which particles form a network that carries stress; 1, ()."""
    stress: ArrayLike
    """sigma_0, scale of the stress; Pa, ()."""
    exponent: ArrayLike
    """k, exponent of the stress; 1, ()."""

    def solid_stress(self, volume_fraction: ArrayLike) -> Array:
        """Effective solid stress sigma(phi); Pa, of the shape of the volume fractions."""
        return self.stress * (self._excess(volume_fraction) ** self.exponent - 1.0)

    def stiffness(self, volume_fraction: ArrayLike) -> Array:
        """Derivative sigma'(phi), zero below phi_gel; Pa, of the shape of the volume fractions."""
        slope = self.stress * self.exponent / self.gel_fraction
        slope = slope * self._excess(volume_fraction) ** (self.exponent - 1.0)
        return jnp.where(volume_fraction > self.gel_fraction, slope, 0.0)

    def _excess(self, volume_fraction: ArrayLike) -> Array:
        return jnp.maximum(volume_fraction / self.gel_fraction, 1.0)
