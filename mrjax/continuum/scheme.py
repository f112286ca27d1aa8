"""Finite volumes for a settling column: Godunov fluxes, Heun's steps, implicit stress.

Without compression fluxes are taken between values at the faces of linear profiles in the cells
(minmod), with Heun's steps (Shu & Osher 1988). With a compressible bed: piecewise-constant
reconstruction, explicit Euler, and the stress implicit.

Conservative; keeps the fractions between 0 and phi_m; first-order, as any scheme is where there are
fronts.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum import characteristics, column_checks, compression, interfaces, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.profile import Column
from mrjax.core.parameters import Parameters
from mrjax.laws import particle

REACH = 0.5
"""Most cells that a front may cross in a step: each half of a cell is a cell to its own face."""

AT_REST = 4.0
"""Times the rest time of the exact solution, by which the cells of a rigid bed rest, too."""

Carry = tuple[Array, Array, Array]
"""Volume fractions, their rounding errors, and the profiles recorded so far."""


@partial(jax.jit, static_argnames=("cells", "steps"))
def solve(case: Case, *, cells: int, steps: int) -> Column:
    """Solves a column, with the height of a cell and a step as units."""
    case, rising = case.sinking()
    initial, densest = case.volume_fraction, case.bed_fraction
    cell = case.height / cells
    si = kynch.table(case.parameters, case.hindrance, initial, densest)
    times = until_rest(case, si)
    flux = si._replace(flux=si.flux * (times[-1] / steps / cell))  # in cells per step
    courant = fastest_front(case, flux)
    profiles = _profiles(case._replace(times=times), flux, cells, steps)
    full = densest
    if case.compression is not None:
        full = jnp.minimum(full, case.compression.gel_fraction)
    mudline = interfaces.mudline(profiles, jnp.minimum(initial, full), densest)
    meets = kynch.bed_contact_fraction(flux, full)
    bed_front = interfaces.bed_front(profiles, mudline, meets, full)
    # A factor, not a `where`: derivatives of an invalid result are NaN, too.
    possible = column_checks.possible(case, flux) & (courant <= REACH * (1.0 + 1e-5))
    valid = jnp.where(possible, 1.0, jnp.nan).astype(initial.dtype)

    def level(of_cells: Array) -> Array:
        return jnp.where(rising, case.height - cell * of_cells, cell * of_cells)

    return Column(
        times=case.times,
        mudline=valid * level(mudline),
        bed_front=valid * level(bed_front),
        sedimentation_ratio=valid * cell * mudline / case.height,
        volume_fraction=valid * jnp.where(rising, profiles[:, ::-1], profiles),
        levels=valid * cell * (jnp.arange(cells, dtype=initial.dtype) + 0.5),
        initial_height=valid * case.height,
        courant=courant,
        steps=steps,
    )


def until_rest(case: Case, flux: kynch.Table) -> Array:
    """The times, s, (T,): those at which a rigid bed rests are one.

    Args:
      case: of particles that sink.
      flux: f, in m/s.
    """
    if case.compression is not None:
        return jnp.asarray(case.times)
    rest = lax.stop_gradient(characteristics.rest_time(flux, jnp.asarray(case.height)))
    return jnp.minimum(jnp.asarray(case.times), AT_REST * rest)


def fastest_front(case: Case, flux: kynch.Table) -> Array:
    """Speed of the fastest front from the suspension, or from a compressible bed's surface; ()."""
    front = kynch.fastest_front(flux, case.volume_fraction)
    if case.compression is None:
        return front
    return jnp.maximum(front, kynch.fastest_front(flux, case.compression.gel_fraction))


def _profiles(case: Case, flux: kynch.Table, cells: int, steps: int) -> Array:
    """Volume fractions at the times, (T, cells): the only scan.

    In chunks of steps: reverse mode keeps the beginning of each, and repeats the rest.
    """
    shares, slots = _step_lengths(case.times, steps)
    count = case.times.size
    chunk = math.isqrt(shares.size - 1) + 1
    missing = -shares.size % chunk
    shares = jnp.pad(shares, (0, missing)).reshape(-1, chunk)
    slots = jnp.pad(slots, (0, missing), constant_values=count).reshape(-1, chunk)
    godunov = kynch.prepare_godunov(kynch.slope_limited(flux, jnp.full_like(case.height, REACH)))
    stress, weight = case.compression, _net_weight(case.parameters) * case.height / cells

    def second_order(fraction: Array, share: Array) -> Array:
        """Flux of Heun's step: second order where the profile is smooth."""
        first = share * _between_faces(godunov, fraction, case.bed_fraction)
        once = fraction + jnp.diff(jnp.pad(first, 1))
        return 0.5 * (first + share * _between_faces(godunov, once, case.bed_fraction))

    def first_order(fraction: Array, share: Array) -> Array:
        """Flux of Euler's step between constant cells.

        In a compressible bed at rest fluxes balance for thousands of steps, through which the
        derivative of anything sharper grows without bound.
        """
        return share * kynch.godunov_flux(godunov, fraction[:-1], fraction[1:])

    flux_between = second_order if stress is None else first_order

    def step(carry: Carry, now: tuple[Array, Array]) -> tuple[Carry, None]:
        fraction, rounding, recorded = carry
        share, slot = now
        down = flux_between(fraction, share)
        # Kahan's sum: what rounding loses at rest is the same at every step.
        change = jnp.diff(jnp.pad(down, 1)) + rounding
        settled = fraction + change
        rounding = change - (settled - fraction)
        if stress is not None:
            settled = compression.spread(
                settled, compression.exchange(stress, weight, fraction, down)
            )
        return (
            settled,
            rounding,
            lax.dynamic_update_index_in_dim(recorded, settled, slot, 0),
        ), None

    @partial(jax.checkpoint, prevent_cse=False)
    def steps_of_chunk(carry: Carry, now: tuple[Array, Array]) -> tuple[Carry, None]:
        return lax.scan(step, carry, now)

    start = jnp.full(cells, case.volume_fraction)
    nothing = jnp.zeros((count + 1, cells), start.dtype)  # the last row for steps without a time
    carry = start, jnp.zeros_like(start), nothing
    (*_, recorded), _ = lax.scan(steps_of_chunk, carry, (shares, slots))
    return recorded[:count]


def _between_faces(godunov: kynch.Godunov, fraction: Array, densest: Array) -> Array:
    """Flux between every cell and the one above it, downwards; (cells - 1,).

    Between what lines through the cells give at their faces: each rises by the smaller of the rises
    to its neighbours, a full floor and clear fluid included, and not at all at a peak (minmod).
    Steeper ones, such as van Leer's, find other fans than Kynch's where f has an inflection: with
    more cells their error stays.
    """
    floor = jnp.broadcast_to(densest, (1,))
    rises = jnp.diff(jnp.concatenate([floor, fraction, jnp.zeros_like(floor)]))
    below, above = rises[:-1], rises[1:]
    smaller = jnp.where(jnp.abs(below) < jnp.abs(above), below, above)
    half = jnp.where(below * above > 0.0, 0.5 * smaller, 0.0)
    return kynch.godunov_flux(godunov, (fraction + half)[:-1], (fraction - half)[1:])


def _step_lengths(times: Array, steps: int) -> tuple[Array, Array]:
    """Lengths of equal steps that are cut so that one ends at each of the times.

    Returns: the length of each as a share of an equal one, and the number of the time at which it
    ends, T for none; (steps + T,).
    """
    count = times.size
    whole = jnp.arange(steps + 1, dtype=times.dtype)
    # Without the barrier XLA sorts constant times while it compiles, for seconds.
    time_in_steps = lax.optimization_barrier(times / times[-1] * steps)
    shares = jnp.diff(jnp.sort(jnp.concatenate([whole, time_in_steps]), stable=True))
    number = jnp.arange(count, dtype=jnp.int32)
    ends = jnp.floor(lax.stop_gradient(time_in_steps)).astype(jnp.int32) + number
    return shares, jnp.full(steps + count, count, jnp.int32).at[ends].set(number)


def _net_weight(parameters: Parameters) -> Array:
    """Delta rho g, of the coated particle in the fluid; N/m^3, ()."""
    excess = particle.apparent_density(parameters) - parameters.fluid_density
    return excess * parameters.gravity
