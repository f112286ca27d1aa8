"""Kynch's flux of a batch-settling suspension, and Godunov's flux between two volume fractions.

f(phi) = phi v(phi) for phi < phi_m,  f(phi_m) = 0                      (Kynch 1952; m/s, downwards)

The flux is zero in a packed bed. Godunov's flux between a volume fraction l and the volume fraction
u above it is exact for any f, with one maximum or several (Godunov 1959; LeVeque, Finite Volume
Methods for Hyperbolic Problems, 2002, Eq. 12.4):

G(l, u) = MIN f over [u, l] if l >= u,  MAX f over [l, u] if l < u

An explicit step is stable for slopes of f up to some s. But f jumps at phi_m, and may be steep in
dilute fluid, too. It is therefore replaced by the largest function below it with slopes up to s,

f~(phi) = MIN over psi of f(psi) + |phi - psi| s

A column that starts uniform at phi_0 settles alike with f and f~ if no front from phi_0 is faster
than s (`fastest_front`). Kynch's construction uses the lower convex hulls of f from phi_0 to clear
fluid and to the bed; f~ then lies above these hulls, and touches f where they do.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.parameters import Parameters
from mrjax.laws.closed_forms import terminal_velocity
from mrjax.laws.hindrance import Hindrance

INTERVALS = 256
"""Number of intervals of the flux table on either side of the initial volume fraction. Linear
interpolation in it is within 1e-4 of Richardson & Zaki's law."""


class Table(NamedTuple):
    """A flux at volume fractions from 0 to that of the bed.

    The nodes are equidistant on either side of the initial volume fraction.
    """

    fraction: Array  # (nodes,)
    flux: Array  # (nodes,)

    @property
    def initial(self) -> Array:
        """The initial volume fraction; 1, (). It is a node, so that the flux is exact there."""
        return self.fraction[INTERVALS]

    @property
    def densest(self) -> Array:
        """The volume fraction of the bed; 1, ()."""
        return self.fraction[-1]


def table(
    parameters: Parameters, hindrance: Hindrance | None, initial: Array, densest: Array
) -> Table:
    """Tabulates Kynch's flux f, in m/s.

    Args:
      parameters: particles of one kind, with leaves ().
      hindrance: f_w as a function of the volume fraction; None to use f_w of the parameters.
      initial: phi_0, ().
      densest: phi_m > phi_0, ().
    """
    node = jnp.arange(INTERVALS + 1, dtype=initial.dtype) / INTERVALS
    dense = initial + (densest - initial) * node[1:-1]
    inner = jnp.concatenate([initial * node[1:], dense])
    hindered = parameters
    if hindrance is not None:
        hindered = parameters.replace(f_w=filled_in_dilute(hindrance(inner), inner))
    # The flux at both ends is zero. A closure may have no derivative in clear fluid.
    zero = jnp.zeros(1, inner.dtype)
    fraction = jnp.concatenate([zero, inner, densest[None]])
    flux = jnp.concatenate([zero, inner * terminal_velocity(hindered), zero])
    return Table(fraction, flux)


def filled_in_dilute(f_w: Array, fraction: Array) -> Array:
    """Returns the f_w of a table of volume fractions without NaN in more dilute suspensions.

    A closure for packings is NaN below some volume fraction. A column that starts denser goes from
    clear fluid to suspension in one front, whose speed does not depend on the flux between. f_w is
    filled in there so that the flux is constant, which keeps the front sharp. If f_w is NaN at the
    initial volume fraction, too, it stays NaN.

    Args:
      f_w: factors at `fraction`, () or (2 * INTERVALS - 1,).
      fraction: volume fractions, ascending; element INTERVALS - 1 is the initial one.
    """
    if jnp.ndim(f_w) == 0:
        return f_w
    first = jnp.argmax(~jnp.isnan(f_w))
    unknown = (jnp.arange(fraction.size) < first) & (first < INTERVALS)
    return jnp.where(unknown, f_w[first] * fraction / fraction[first], f_w)


def velocity(parameters: Parameters, hindrance: Hindrance | None, fraction: Array) -> Array:
    """Returns v(phi), the terminal velocity at each volume fraction; m/s, of their shape or ().

    Args:
      parameters: particles of one kind, with leaves ().
      hindrance: f_w as a function of the volume fraction; None to use f_w of the parameters.
      fraction: volume fractions.
    """
    if hindrance is None:
        return terminal_velocity(parameters)
    return terminal_velocity(parameters.replace(f_w=hindrance(fraction)))


def fastest_front(flux_table: Table, state: Array) -> Array:
    """Returns the greatest speed of a front or wave from a uniform suspension; m/s, ().

    It is MAX over phi of (f(phi_0) - f(phi)) / |phi - phi_0|, the steepest slope of the two lower
    hulls, with phi_0 = `state`.
    """
    distance = jnp.abs(flux_table.fraction - state)
    distinct = distance != 0.0  # True for nan, too
    drop = jnp.interp(state, flux_table.fraction, flux_table.flux) - flux_table.flux
    return jnp.max(jnp.where(distinct, drop / jnp.where(distinct, distance, 1.0), 0.0))


def bed_contact_fraction(flux_table: Table, full: Array) -> Array:
    """Returns the volume fraction just above the bed; 1, ().

    It is the point at which the hull from phi_0 leaves f towards (full, 0), and phi_0 itself if the
    bed grows by a single front.

    Args:
      flux_table: f.
      full: volume fraction at which the bed begins, ().
    """
    fraction, flux = flux_table.fraction[INTERVALS:], flux_table.flux[INTERVALS:]
    below = fraction < full
    speed = jnp.where(below, flux / jnp.where(below, full - fraction, 1.0), jnp.inf)
    return fraction[jnp.argmin(speed)]


def slope_limited(flux_table: Table, slope: Array) -> Table:
    """Returns f~, the largest flux below f with slopes up to `slope`, in the unit of the flux."""
    distance = jnp.abs(flux_table.fraction[:, None] - flux_table.fraction[None, :])
    return Table(flux_table.fraction, jnp.min(flux_table.flux[None, :] + slope * distance, axis=1))


class Godunov(NamedTuple):
    """A flux with its extremes over ranges of 1, 2, 4, ... nodes; any range is covered by two."""

    table: Table
    least: Array  # least of f and of -f, (2, doublings, nodes)


def prepare_godunov(flux_table: Table) -> Godunov:
    """Tabulates the extremes of a flux for `godunov_flux`."""
    least = [jnp.stack([flux_table.flux, -flux_table.flux])]
    while (width := 2 ** len(least)) <= flux_table.flux.size:
        last, half = least[-1], width // 2
        shifted = jnp.concatenate([last[:, half:], last[:, -half:]], axis=1)
        least.append(jnp.minimum(last, shifted))
    return Godunov(flux_table, jnp.stack(least, axis=1))


def godunov_flux(godunov: Godunov, below: Array, above: Array) -> Array:
    """Returns Godunov's flux G between two volume fractions, downwards, in the unit of the flux.

    Args:
      godunov: flux, prepared by `prepare_godunov`.
      below: volume fractions below the faces.
      above: volume fractions above the faces, of the same shape, which is that of the result.
    """
    (node, low, _), (upper, high, rises) = (
        _interpolate(godunov.table, side) for side in (below, above)
    )
    falls = below >= above
    kind, sign = jnp.where(falls, 0, 1), jnp.where(falls, 1.0, -1.0).astype(low.dtype)
    first = jnp.minimum(node, upper) + 1
    last = jnp.maximum(node, upper)
    count = last - first + 1
    # Ties take the upwind value; otherwise derivatives would be unstable.
    from_above = jnp.where(count > 0, sign * high < sign * low, rises)
    ends = sign * jnp.where(from_above, high, low)
    # Two ranges of a power of two cover the nodes from first to last.
    doubling = 31 - lax.clz(jnp.maximum(count, 1))
    second = jnp.maximum(last + 1 - (1 << doubling), 0)
    inner = jnp.minimum(godunov.least[kind, doubling, first], godunov.least[kind, doubling, second])
    return sign * jnp.where((count > 0) & (inner < ends), inner, ends)


def flux_at(flux_table: Table, fraction: Array) -> Array:
    """Returns the flux at volume fractions, in the unit of the table and of their shape."""
    return _interpolate(flux_table, fraction)[1]


def _interpolate(flux_table: Table, fraction: Array) -> tuple[Array, Array, Array]:
    """Returns the node at or below a volume fraction, the flux, and True if the flux rises."""
    dense = fraction >= flux_table.initial
    origin = jnp.where(dense, flux_table.initial, 0.0)
    width = (
        jnp.where(dense, flux_table.densest - flux_table.initial, flux_table.initial) / INTERVALS
    )
    position = (fraction - origin) / width + jnp.where(dense, float(INTERVALS), 0.0)
    node = jnp.clip(lax.stop_gradient(position).astype(jnp.int32), 0, 2 * INTERVALS - 1)
    low, high = flux_table.flux[node], flux_table.flux[node + 1]
    flux = low + (position - node.astype(position.dtype)) * (high - low)
    return node, flux, high > low
