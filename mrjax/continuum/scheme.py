"""Finite volumes for a column with a rigid bed: Godunov fluxes between lines, Heun's steps.

Profiles are linear within a cell (minmod), and steps are those of Shu & Osher (1988).
The scheme is conservative and keeps the volume fractions between 0 and phi_m. Near fronts it is of
first order, like any scheme.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum import (
    centrifuge,
    characteristics,
    column_checks,
    fields,
    interfaces,
    kynch,
    rotor_checks,
)
from mrjax.continuum.case import Case
from mrjax.continuum.minmod import minmod
from mrjax.continuum.profile import Column
from mrjax.continuum.rotor import cells_of
from mrjax.laws import yield_stress

REACH = 0.5
"""Largest number of cells that a front may cross in a step. It is one half, because with linear
reconstruction each half of a cell acts as a cell of its own."""

AT_REST = 4.0
"""Factor on the exact rest time, after which the cells of a rigid bed are at rest, too."""

Carry = tuple[Array, Array, Array]
"""Volume fractions, their rounding errors, and the recorded profiles."""


@partial(jax.jit, static_argnames=("cells", "steps"))
def solve(case: Case, *, cells: int, steps: int) -> Column:
    """Simulates a column; internal units are the height of a cell and the length of a step."""
    case, rising = case.sinking()
    initial, densest = case.volume_fraction, case.bed_fraction
    cell = case.height / cells
    si = kynch.table(case.parameters, case.hindrance, initial, densest)
    times = until_rest(case, si)
    flux = si._replace(flux=si.flux * (times[-1] / steps / cell))  # in cells per step
    courant = fastest_front(case, flux)
    profiles = _profiles(case._replace(times=times), flux, cells, steps)
    meets = kynch.bed_contact_fraction(flux, densest)
    if case.rotor is None:
        mudline = interfaces.mudline(profiles, initial, densest)
        bed_front = interfaces.bed_front(profiles, mudline, meets, densest)
    else:
        mudline, bed_front = (
            height / cell for height in centrifuge.fronts(case, times, profiles, meets)
        )
    at_level = fields.rigid_bed(case, si, profiles, cell * mudline, cell * bed_front)
    velocity, stress = fields.mirrored(rising, *at_level)
    # A factor, not a `where`: derivatives of an invalid result are NaN, too.
    possible = column_checks.possible(case, flux) & rotor_checks.possible(case)
    possible = possible & (courant <= REACH * (1.0 + 1e-5))
    valid = jnp.where(possible, 1.0, jnp.nan).astype(initial.dtype)

    def level(cell_count: Array) -> Array:
        return jnp.where(rising, case.height - cell * cell_count, cell * cell_count)

    return Column(
        times=case.times,
        mudline=valid * level(mudline),
        bed_front=valid * level(bed_front),
        sedimentation_ratio=valid * cell * mudline / case.height,
        volume_fraction=valid * jnp.where(rising, profiles[:, ::-1], profiles),
        settling_velocity=valid * velocity,
        solid_stress=valid * stress,
        levels=valid * cell * (jnp.arange(cells, dtype=initial.dtype) + 0.5),
        initial_height=valid * case.height,
        courant=courant,
        steps=steps,
    )


def until_rest(case: Case, flux: kynch.Table) -> Array:
    """Returns the output times, s, (T,), cut off at the time from which a rigid bed is at rest.

    In a carrier that ages, and in a tilted tube, they are the times of one that does not age, or
    stands upright, with the same profiles.

    Args:
      case: column of particles that sink.
      flux: f, in m/s.
    """
    times = yield_stress.effective_times(case.parameters, jnp.asarray(case.times))
    height = jnp.asarray(case.height)
    if case.rotor is not None:
        rest = centrifuge.rest_time(
            case.parameters,
            case.hindrance,
            jnp.asarray(case.volume_fraction),
            jnp.asarray(case.bed_fraction),
            case.rotor,
        )
        return jnp.minimum(times, AT_REST * lax.stop_gradient(rest))
    if case.tilt is not None:
        times = characteristics.tilted_times(flux, height, times, case.tilt)
    rest = lax.stop_gradient(characteristics.rest_time(flux, height))
    return jnp.minimum(times, AT_REST * rest)


def fastest_front(case: Case, flux: kynch.Table) -> Array:
    """Returns the greatest speed of a front or wave, in the unit of the flux, ().

    In a rotor the uniform suspension becomes thinner, and fronts begin from every thinner one.

    Args:
      case: column of particles that sink.
      flux: f.
    """
    initial = jnp.asarray(case.volume_fraction)
    if case.rotor is None:
        return kynch.fastest_front(flux, initial)
    states = flux.fraction[1 : kynch.INTERVALS + 1]
    return jnp.max(jax.vmap(partial(kynch.fastest_front, flux))(states))


def _profiles(case: Case, flux: kynch.Table, cells: int, steps: int) -> Array:
    """Integrates over all steps; returns the volume fractions at the times, (T, cells).

    The steps are scanned in chunks. Reverse mode stores the beginning of each chunk and recomputes
    the rest.
    """
    lengths, slots = _step_lengths(case.times, steps)
    count = case.times.size
    chunk = math.isqrt(lengths.size - 1) + 1
    missing = -lengths.size % chunk
    lengths = jnp.pad(lengths, (0, missing)).reshape(-1, chunk)
    slots = jnp.pad(slots, (0, missing), constant_values=count).reshape(-1, chunk)
    godunov = kynch.prepare_godunov(kynch.slope_limited(flux, jnp.full_like(case.height, REACH)))

    tube = None if case.rotor is None else cells_of(case.rotor, cells)

    def flux_through(fraction: Array, length: Array) -> Array:
        flux = length * _limited_flux(godunov, fraction, case.bed_fraction)
        return flux if tube is None else flux * tube.weight

    def change_by(flux: Array) -> Array:
        change = jnp.diff(jnp.pad(flux, 1))
        return change if tube is None else change / tube.volume

    def flux_between(fraction: Array, length: Array) -> Array:
        """Flux of Heun's step, of second order in smooth profiles."""
        first = flux_through(fraction, length)
        return 0.5 * (first + flux_through(fraction + change_by(first), length))

    def step(carry: Carry, now: tuple[Array, Array]) -> tuple[Carry, None]:
        fraction, rounding, recorded = carry
        length, slot = now
        down = flux_between(fraction, length)
        # Kahan's sum: at rest the rounding error is the same at every step, and would add up.
        change = change_by(down) + rounding
        settled = fraction + change
        rounding = change - (settled - fraction)
        return (
            settled,
            rounding,
            lax.dynamic_update_index_in_dim(recorded, settled, slot, 0),
        ), None

    @partial(jax.checkpoint, prevent_cse=False)
    def run_chunk(carry: Carry, chunk_steps: tuple[Array, Array]) -> tuple[Carry, None]:
        return lax.scan(step, carry, chunk_steps)

    start = jnp.full(cells, case.volume_fraction)
    profiles = jnp.zeros((count + 1, cells), start.dtype)  # last row: steps that end at no time
    carry = start, jnp.zeros_like(start), profiles
    (*_, recorded), _ = lax.scan(run_chunk, carry, (lengths, slots))
    return recorded[:count]


def _limited_flux(godunov: kynch.Godunov, fraction: Array, densest: Array) -> Array:
    """Returns the downward flux between neighbouring cells with the minmod limiter; (cells - 1,).

    Profiles are linear within a cell. The slope is the smaller one of those to the two neighbours,
    and zero at an extremum; beyond the ends are a full floor and clear fluid. Steeper limiters,
    such as van Leer's, give other fans than Kynch's if f has an inflection, with an error that more
    cells do not reduce.
    """
    floor = jnp.broadcast_to(densest, (1,))
    rises = jnp.diff(jnp.concatenate([floor, fraction, jnp.zeros_like(floor)]))
    half = 0.5 * minmod(rises[:-1], rises[1:])
    return kynch.godunov_flux(godunov, (fraction + half)[:-1], (fraction - half)[1:])


def _step_lengths(times: Array, steps: int) -> tuple[Array, Array]:
    """Cuts equal steps so that a step ends at each of the times.

    Returns:
      The length of each step over that of an equal step, (steps + T,), and the index of the time at
      which it ends, (steps + T,), or T for none.
    """
    count = times.size
    whole = jnp.arange(steps + 1, dtype=times.dtype)
    # Without the barrier XLA would sort constant times during compilation, which takes seconds.
    time_in_steps = lax.optimization_barrier(times / times[-1] * steps)
    lengths = jnp.diff(jnp.sort(jnp.concatenate([whole, time_in_steps]), stable=True))
    number = jnp.arange(count, dtype=jnp.int32)
    ends = jnp.floor(lax.stop_gradient(time_in_steps)).astype(jnp.int32) + number
    return lengths, jnp.full(steps + count, count, jnp.int32).at[ends].set(number)
