"""Kynch's flux of a batch-settling suspension, and Godunov's between two volume fractions.

f(phi) = phi v(phi) for phi < phi_m,  f(phi_m) = 0                      (Kynch 1952; m/s, downwards)

A packed bed rests on the floor: nothing more goes in. Between a fraction l and the fraction u above
it, exactly for any f, with one hump or several (Godunov 1959; LeVeque, Finite Volume Methods for
Hyperbolic Problems, 2002, Eq. 12.4):

G(l, u) = MIN f over [u, l] where l >= u,  MAX f over [l, u] where l < u

An explicit step stands for slopes of f up to some s, and f jumps at phi_m; in dilute fluid it may
be steep too. In place of f the largest function below it without steeper slopes is taken,

f~(phi) = MIN over psi of f(psi) + |phi - psi| s

By either a column that starts uniform at phi_0 settles the same if no front from phi_0 is faster
than s (`fastest_front`): f~ then lies above the lower convex hulls of f from phi_0 to clear fluid
and to the bed, of which Kynch's construction is made, and touches f where they do.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.parameters import Parameters
from mrjax.laws.closed_forms import terminal_velocity
from mrjax.laws.hindrance import Hindrance

INTERVALS = 256
"""Intervals of the table of the flux, on either side of the initial volume fraction: linear in
between, which is within 1e-4 of Richardson & Zaki's law."""


class Table(NamedTuple):
    """A flux at volume fractions from 0 to the bed's, evenly on either side of the initial one."""

    fraction: Array  # (nodes,)
    flux: Array  # (nodes,)

    @property
    def initial(self) -> Array:
        """The initial volume fraction, which is a node: at it the flux is exact; 1, ()."""
        return self.fraction[INTERVALS]

    @property
    def densest(self) -> Array:
        """The volume fraction of the bed; 1, ()."""
        return self.fraction[-1]


def table(
    parameters: Parameters, hindrance: Hindrance | None, initial: Array, densest: Array
) -> Table:
    """Kynch's f of the parameters, in m/s.

    Args:
      parameters: of one kind of particle, leaves ().
      hindrance: f_w for volume fractions, in place of that of the parameters.
      initial, densest: phi_0 < phi_m, ().
    """
    share = jnp.arange(INTERVALS + 1, dtype=initial.dtype) / INTERVALS
    denser = initial + (densest - initial) * share[1:-1]
    between = jnp.concatenate([initial * share[1:], denser])
    hindered = parameters if hindrance is None else parameters.replace(f_w=hindrance(between))
    # A closure may have no slope in clear fluid: both ends are known without it.
    nothing = jnp.zeros(1, between.dtype)
    fraction = jnp.concatenate([nothing, between, densest[None]])
    flux = jnp.concatenate([nothing, between * terminal_velocity(hindered), nothing])
    return Table(fraction, flux)


def fastest_front(flux_table: Table, state: Array) -> Array:
    """Greatest speed of a front or wave that leaves a suspension of one volume fraction; m/s, ().

    MAX over phi of (f(phi_0) - f(phi)) / |phi - phi_0|: the steepest of its two lower hulls.
    """
    distance = jnp.abs(flux_table.fraction - state)
    apart = distance != 0.0  # True for nan, too
    drop = jnp.interp(state, flux_table.fraction, flux_table.flux) - flux_table.flux
    return jnp.max(jnp.where(apart, drop / jnp.where(apart, distance, 1.0), 0.0))


def bed_contact_fraction(flux_table: Table, full: Array) -> Array:
    """Volume fraction that meets the bed: where the hull from phi_0 leaves f for (full, 0); 1, ().

    phi_0 itself where the bed grows from a single front.
    """
    fraction, flux = flux_table.fraction[INTERVALS:], flux_table.flux[INTERVALS:]
    below = fraction < full
    speed = jnp.where(below, flux / jnp.where(below, full - fraction, 1.0), jnp.inf)
    return fraction[jnp.argmin(speed)]


def slope_limited(flux_table: Table, slope: Array) -> Table:
    """f~, the largest flux below f that has slopes up to `slope`, in the unit of the flux."""
    distance = jnp.abs(flux_table.fraction[:, None] - flux_table.fraction[None, :])
    return Table(flux_table.fraction, jnp.min(flux_table.flux[None, :] + slope * distance, axis=1))


class Godunov(NamedTuple):
    """A flux with its extremes over 1, 2, 4, ... nodes from each: any range is two of them."""

    table: Table
    least: Array  # least of f and of -f, (2, doublings, nodes)


def prepare_godunov(flux_table: Table) -> Godunov:
    """Tabulates the extremes of a flux, from which `godunov_flux` takes them."""
    least = [jnp.stack([flux_table.flux, -flux_table.flux])]
    while (width := 2 ** len(least)) <= flux_table.flux.size:
        last, half = least[-1], width // 2
        shifted = jnp.concatenate([last[:, half:], last[:, -half:]], axis=1)
        least.append(jnp.minimum(last, shifted))
    return Godunov(flux_table, jnp.stack(least, axis=1))


def godunov_flux(godunov: Godunov, below: Array, above: Array) -> Array:
    """G between a volume fraction and the one above it, downwards; in the flux's unit.

    Args:
      godunov: the flux, prepared by `prepare_godunov`.
      below, above: volume fractions of one shape, which is that of the result.
    """
    (node, low, _), (upper, high, rises) = (
        _interpolated(godunov.table, side) for side in (below, above)
    )
    falls = below >= above
    kind, sign = jnp.where(falls, 0, 1), jnp.where(falls, 1.0, -1.0).astype(low.dtype)
    first = jnp.minimum(node, upper) + 1
    last = jnp.maximum(node, upper)
    count = last - first + 1
    # On ties, the upwind value: else derivatives would be unstable.
    from_above = jnp.where(count > 0, sign * high < sign * low, rises)
    ends = sign * jnp.where(from_above, high, low)
    # Two ranges of a power of two cover the nodes from first to last.
    doubling = 31 - lax.clz(jnp.maximum(count, 1))
    other = jnp.maximum(last + 1 - (1 << doubling), 0)
    inner = jnp.minimum(godunov.least[kind, doubling, first], godunov.least[kind, doubling, other])
    return sign * jnp.where((count > 0) & (inner < ends), inner, ends)


def _interpolated(flux_table: Table, fraction: Array) -> tuple[Array, Array, Array]:
    """Node at or below each volume fraction, the flux interpolated there, and True if it rises."""
    dense = fraction >= flux_table.initial
    origin = jnp.where(dense, flux_table.initial, 0.0)
    width = (
        jnp.where(dense, flux_table.densest - flux_table.initial, flux_table.initial) / INTERVALS
    )
    place = (fraction - origin) / width + jnp.where(dense, float(INTERVALS), 0.0)
    node = jnp.clip(lax.stop_gradient(place).astype(jnp.int32), 0, 2 * INTERVALS - 1)
    low, high = flux_table.flux[node], flux_table.flux[node + 1]
    flux = low + (place - node.astype(place.dtype)) * (high - low)
    return node, flux, high > low
