"""A settling column of a rigid bed without a grid: Hopf's formula for Kynch's theory.

S(z, t) = MIN over phi of  phi z + f(phi) t + H max(phi_0 - phi, 0)                    (Hopf 1965)

the solids below the height z, in m: of each characteristic of Kynch (1952), along which the volume
fraction phi is constant, that which brings the least. Exact for any flux f, as S(z, 0) bends down
everywhere: a full floor at phi_m, the suspension at phi_0 up to H, and clear fluid. The volume
fraction at z is the phi of that minimum, and the mudline is where all solids, phi_0 H, lie below:

h(t) = MAX over phi from phi_0 to phi_m of (phi_0 H - f(phi) t) / phi

The minimum is that of a parabola through three nodes of the table of f: right to third order in
their distance.
"""

import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum.kynch import INTERVALS, Table


def mudline(flux_table: Table, height: Array, times: Array) -> Array:
    """Height of the interface to the clear fluid; m, (T,).

    Exact where denser suspensions fall more slowly. Else solids are left behind in the clear fluid,
    and count as if they were at the fraction of the suspension.

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      times: s, (T,).
    """
    fraction, flux = flux_table.fraction[INTERVALS:-1], flux_table.flux[INTERVALS:-1]
    solids = flux_table.initial * height
    moving = -_least((flux[None] * times[:, None] - solids) / fraction[None])
    return jnp.maximum(moving, solids / flux_table.densest)


def solids_below(flux_table: Table, height: Array, level: Array, times: Array) -> Array:
    """S, the solids below each level at each time; m, (Q,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      level: z from the floor, m, (Q,).
      times: s, (Q,).
    """
    fraction, flux = flux_table
    above = height * jnp.maximum(flux_table.initial - fraction, 0.0)
    carried = level[:, None] * fraction[None] + times[:, None] * flux[None] + above[None]
    dilute, dense = carried[:, : INTERVALS + 1], carried[:, INTERVALS:-1]
    of_bed = carried[:, -1]  # apart: at phi_m the flux jumps to 0
    return jnp.minimum(jnp.minimum(_least(dilute), _least(dense)), of_bed)


def mean_fraction(
    flux_table: Table, height: Array, level: Array, times: Array, thickness: Array
) -> Array:
    """Mean volume fraction over a layer about each level at each time; 1, (Q,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      level: middle of the layer, m from the floor, (Q,).
      times: s, (Q,).
      thickness: of the layer, which ends at the floor and at H; m, () or (Q,).
    """
    low = jnp.clip(level - 0.5 * thickness, 0.0, height)
    high = jnp.clip(level + 0.5 * thickness, 0.0, height)
    low_solids, high_solids = (solids_below(flux_table, height, end, times) for end in (low, high))
    return (high_solids - low_solids) / (high - low)


def rest_time(flux_table: Table, height: Array) -> Array:
    """Time after which all solids lie in the bed; s, (). Infinite where a suspension stands still.

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
    """
    fraction, flux = flux_table.fraction[INTERVALS:-1], flux_table.flux[INTERVALS:-1]
    solids = flux_table.initial * height
    return jnp.max(solids * (1.0 - fraction / flux_table.densest) / flux)


def _least(values: Array) -> Array:
    """Least of values at even distances, (..., K), along a parabola through three; (...)."""
    # The derivative of a `min` hangs on which of its arguments equal it, to the last bit.
    least = jnp.argmin(lax.stop_gradient(values), axis=-1, keepdims=True)
    middle = jnp.clip(least, 1, values.shape[-1] - 2)
    before, here, after = (
        jnp.take_along_axis(values, middle + step, axis=-1)[..., 0] for step in (-1, 0, 1)
    )
    slope, bend = 0.5 * (after - before), before - 2.0 * here + after
    bends = bend > 0.0
    to_node = (least - middle)[..., 0].astype(values.dtype)
    share = jnp.where(bends, jnp.clip(-slope / jnp.where(bends, bend, 1.0), -1.0, 1.0), to_node)
    return here + share * (slope + 0.5 * share * bend)
