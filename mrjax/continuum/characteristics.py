"""A settling column with a rigid bed, without a grid: Hopf's formula for Kynch's theory.

S(z, t) = MIN over phi of  phi z + f(phi) t + H max(phi_0 - phi, 0)                    (Hopf 1965)

S is the particle volume below the height z over the area of the tube, in m. The volume fraction phi
is constant along each characteristic of Kynch (1952), and the minimum selects the characteristic.
The formula is exact for any flux f, because S(z, 0) is concave: a floor at phi_m, the suspension at
phi_0 up to H, and clear fluid. The volume fraction at z is the phi of the minimum. All particles,
phi_0 H, lie below the mudline:

h(t) = MAX over phi from phi_0 to phi_m of (phi_0 H - f(phi) t) / phi

The minimum is taken of a parabola through three nodes of the table of f, which is accurate to third
order in their distance.
"""

import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum.kynch import INTERVALS, Table
from mrjax.continuum.layers import layer_ends
from mrjax.continuum.tilt import Tilt, clock_nodes, clock_times


def mudline(flux_table: Table, height: Array, times: Array) -> Array:
    """Returns the height of the interface to the clear fluid; m, (T,).

    It is exact if denser suspensions fall more slowly. Otherwise particles stay behind in the clear
    fluid, and count as if they had the volume fraction of the suspension.

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      times: times, s, (T,).
    """
    fraction, flux = flux_table.fraction[INTERVALS:-1], flux_table.flux[INTERVALS:-1]
    solids = flux_table.initial * height
    moving = -_least((flux[None] * times[:, None] - solids) / fraction[None])
    return jnp.maximum(moving, solids / flux_table.densest)


def solids_below(flux_table: Table, height: Array, level: Array, times: Array) -> Array:
    """Returns S, the particle volume below a level over the area of the tube; m, (Q,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      level: heights z above the floor, m, (Q,).
      times: time at each level, s, (Q,).
    """
    fraction, flux = flux_table
    above = height * jnp.maximum(flux_table.initial - fraction, 0.0)
    carried = level[:, None] * fraction[None] + times[:, None] * flux[None] + above[None]
    dilute, dense = carried[:, : INTERVALS + 1], carried[:, INTERVALS:-1]
    bed = carried[:, -1]  # no parabola through phi_m, where the flux jumps to 0
    return jnp.minimum(jnp.minimum(_least(dilute), _least(dense)), bed)


def mean_fraction(
    flux_table: Table, height: Array, level: Array, times: Array, thickness: Array
) -> Array:
    """Returns the mean volume fraction over a layer about each level; 1, (Q,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      level: height of the middle of the layer above the floor, m, (Q,).
      times: time at each level, s, (Q,).
      thickness: thickness of the layer, which is cut off at the floor and at H; m, () or (Q,).
    """
    low, high = layer_ends(level, thickness, height)
    low_solids, high_solids = (solids_below(flux_table, height, end, times) for end in (low, high))
    return (high_solids - low_solids) / (high - low)


def rest_time(flux_table: Table, height: Array) -> Array:
    """Returns the time after which all particles are in the bed; s, ().

    It is infinite if the suspension does not settle.

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
    """
    fraction, flux = flux_table.fraction[INTERVALS:-1], flux_table.flux[INTERVALS:-1]
    solids = flux_table.initial * height
    return jnp.max(solids * (1.0 - fraction / flux_table.densest) / flux)


def bed_front(flux_table: Table, height: Array, times: Array) -> Array:
    """Returns the height of the top of the bed; m, (T,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      times: times, s, (T,).
    """
    fraction, flux = flux_table.fraction[INTERVALS:-1], flux_table.flux[INTERVALS:-1]
    speed = jnp.min(flux / (flux_table.densest - fraction))
    return jnp.minimum(speed * times, mudline(flux_table, height, times))


def bend_time(flux_table: Table, height: Array) -> Array:
    """Returns the time at which the first wave from the floor bends the mudline; s, ().

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
    """
    fraction, flux = flux_table.fraction[INTERVALS:], flux_table.flux[INTERVALS:]
    wave = jnp.max((flux[0] - flux[1:]) / (fraction[1:] - fraction[0]))
    return height / (flux[0] / fraction[0] + wave)


def tilted_times(flux_table: Table, height: Array, times: Array, tilt: Tilt) -> Array:
    """Returns the times at which an upright column has the state of a tilted one; s, (T,).

    Args:
      flux_table: f, in m/s.
      height: H, m, ().
      times: times of the tilted column, s, (T,).
      tilt: tilt and gap of the tube.
    """
    bend, rest = bend_time(flux_table, height), rest_time(flux_table, height)
    last = jnp.max(times, initial=0.0) * tilt.rate(height)
    # A suspension that stands still has no bend.
    moves = jnp.isfinite(rest)
    bend, rest = jnp.where(moves, bend, last), jnp.where(moves, rest, last)
    nodes = clock_nodes(bend, rest, last)
    length = mudline(flux_table, height, nodes) - bed_front(flux_table, height, nodes)
    return clock_times(times, tilt, nodes, length)


def _least(values: Array) -> Array:
    """Returns the minimum of equidistant values, (..., K), by a parabola through three; (...)."""
    # An index, because the derivative of `min` depends on ties to the last bit.
    least = jnp.argmin(lax.stop_gradient(values), axis=-1, keepdims=True)
    middle = jnp.clip(least, 1, values.shape[-1] - 2)
    before, centre, after = (
        jnp.take_along_axis(values, middle + step, axis=-1)[..., 0] for step in (-1, 0, 1)
    )
    slope, curvature = 0.5 * (after - before), before - 2.0 * centre + after
    convex = curvature > 0.0
    to_node = (least - middle)[..., 0].astype(values.dtype)
    offset = jnp.where(
        convex, jnp.clip(-slope / jnp.where(convex, curvature, 1.0), -1.0, 1.0), to_node
    )
    return centre + offset * (slope + 0.5 * offset * curvature)
