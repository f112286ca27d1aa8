"""A bed that gives way under its own weight: effective solid stress, and what it does to a column.

sigma(phi) = sigma_0 ((phi / phi_gel)^k - 1) for phi > phi_gel, else 0
d phi/dt = d/dz [ f(phi) (1 + sigma'(phi) (d phi/dz) / (Delta rho g phi)) ]

The phenomenological theory of Buerger, Concha & Karlsen (Buerger & Wendland, J. Eng. Math. 41,
2001). The fluid holds what the network of touching particles does not: Darcy's law with
Delta rho g phi + d sigma/dz, the net weight less what the stress carries, in place of the weight
alone, by which f was found. At rest the stress carries all that is above.

First order at the top of the bed: with 200 cells its height at rest is right to a fifth of a cell,
but in it the last cell comes to rest slowly when little is left in it, so that derivatives of that
height by the stress are only of the right size; those of the solid's mean height are within 25 %.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Compression:
    """The effective solid stress of a bed, three numbers."""

    gel_fraction: ArrayLike
    """phi_gel, volume fraction at which particles form a network that carries; 1, ()."""
    stress: ArrayLike
    """sigma_0; Pa, ()."""
    exponent: ArrayLike
    """k; 1, ()."""

    def solid_stress(self, volume_fraction: ArrayLike) -> Array:
        """sigma(phi); Pa, of the shape of the volume fractions."""
        return self.stress * (self._excess(volume_fraction) ** self.exponent - 1.0)

    def stiffness(self, volume_fraction: ArrayLike) -> Array:
        """sigma'(phi), zero below phi_gel; Pa, of the shape of the volume fractions."""
        slope = self.stress * self.exponent / self.gel_fraction
        slope = slope * self._excess(volume_fraction) ** (self.exponent - 1.0)
        return jnp.where(volume_fraction > self.gel_fraction, slope, 0.0)

    def _excess(self, volume_fraction: ArrayLike) -> Array:
        return jnp.maximum(volume_fraction / self.gel_fraction, 1.0)


def exchange(compression: Compression, weight: Array, fraction: Array, down: Array) -> Array:
    """Flux between cells for each difference in volume fraction, downwards; (cells - 1,).

    f (d sigma/d phi) / (Delta rho g phi dz), with the secant of sigma and the mean phi of two
    cells: at rest sigma differs by just the weight of the solid between their middles.

    Args:
      compression: the stress.
      weight: Delta rho g dz, Pa.
      fraction: of every cell from the lowest, (cells,).
      down: f between the cells, (cells - 1,), in the unit of the result.
    """
    low, high = fraction[:-1], fraction[1:]
    middle, rise = 0.5 * (low + high), high - low
    apart = jnp.abs(rise) > jnp.sqrt(jnp.finfo(rise.dtype).eps) * compression.gel_fraction
    gain = compression.solid_stress(high) - compression.solid_stress(low)
    secant = gain / jnp.where(apart, rise, 1.0)
    slope = jnp.where(apart, secant, compression.stiffness(middle))
    # Not where(middle > 0): above a bed fractions halve at every step, to what has no square.
    carried = jnp.maximum(low, high) > compression.gel_fraction
    return jnp.where(carried, down * slope / (weight * jnp.where(carried, middle, 1.0)), 0.0)


def spread(fraction: Array, exchange: Array) -> Array:
    """Volume fractions after the exchange of a step, implicit: a bed passes on stress at once.

    Keeps the solid, and between the least and the greatest fraction.
    """
    below, above = jnp.pad(exchange, (1, 0)), jnp.pad(exchange, (0, 1))
    diagonal = 1.0 + below + above
    return lax.linalg.tridiagonal_solve(-below, diagonal, -above, fraction[:, None])[:, 0]
