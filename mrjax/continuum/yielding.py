"""A column with a yielding bed at its output times, as profiles over the height."""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from mrjax.continuum import column_checks, fields, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.compression import Compression
from mrjax.continuum.consolidation import (
    Consolidation,
    consolidate,
    field_at,
    mudline_at,
    share_below,
    volume_at,
)
from mrjax.continuum.profile import Column
from mrjax.continuum.tilt import clock_times


@partial(jax.jit, static_argnames=("cells", "steps"))
def solve(case: Case, compression: Compression, *, cells: int, steps: int) -> Column:
    """Simulates a column on a yielding bed, whose effective solid stress is `compression`."""
    case, rising = case.sinking()
    flux = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    settled = consolidate(until_last(case), compression, cells=cells, steps=steps)
    height, initial = case.height, case.volume_fraction
    times = jnp.asarray(case.times)
    if case.tilt is not None:
        times = tilted_times(case, compression, flux, settled, times)
    # A network that is stiff enough swells in the equations, which know no plastic strain.
    mudline = jnp.minimum(mudline_at(settled, times), height)
    volume = volume_at(settled, times)
    layers = height * volume * settled.cells[None]
    bed_front = bed_height(case, compression, flux, settled.cells, volume, mudline)
    edges = height * jnp.arange(cells + 1, dtype=mudline.dtype) / cells
    below = jax.vmap(share_below, (None, 0, None))(settled.cells, layers, edges)
    # Particles that swelling lifts above the initial height are those of the topmost cell.
    profiles = jnp.diff(below.at[:, -1].set(1.0), axis=1) * initial * cells
    levels = 0.5 * (edges[1:] + edges[:-1])
    at_level = jax.vmap(partial(_at_levels, levels))(
        layers,
        mudline,
        field_at(settled, times, settled.speeds),
        field_at(settled, times, settled.stress),
    )
    velocity, stress = fields.mirrored(rising, *at_level)
    if case.tilt is not None:
        velocity = velocity * case.tilt.rate(mudline - bed_front)[:, None]
    courant = kynch.fastest_front(flux, initial) * settled.time[1] / height * cells
    # A factor, not a `where`: derivatives of an invalid result are NaN, too.
    possible = column_checks.possible(case, flux) & column_checks.slower_if_denser(flux)
    possible = possible & settled.solved
    valid = jnp.where(possible, 1.0, jnp.nan).astype(mudline.dtype)

    def level(distance: Array) -> Array:
        return valid * jnp.where(rising, height - distance, distance)

    return Column(
        times=case.times,
        mudline=level(mudline),
        bed_front=level(bed_front),
        sedimentation_ratio=valid * mudline / height,
        volume_fraction=valid * jnp.where(rising, profiles[:, ::-1], profiles),
        settling_velocity=valid * velocity,
        solid_stress=valid * stress,
        levels=valid * levels,
        initial_height=valid * height,
        courant=courant,
        steps=steps,
    )


def _at_levels(
    levels: Array, layers: Array, mudline: Array, speeds: Array, stress: Array
) -> tuple[Array, Array]:
    """Interpolates the fields of the material cells linearly; returns both at levels, (C,) each.

    Args:
      levels: heights above the floor, m, (C,).
      layers: thickness of the material cells, m, (C,).
      mudline: height of the mudline, m, ().
      speeds: speed of the upper face of every material cell, m/s, (C,).
      stress: solid stress in the middle of every material cell, Pa, (C,).
    """
    zero = jnp.zeros(1, layers.dtype)
    faces = jnp.concatenate([zero, jnp.cumsum(layers)])
    velocity = jnp.interp(levels, faces, jnp.concatenate([zero, speeds]))
    places = jnp.concatenate([faces[1:] - 0.5 * layers, faces[-1:]])
    carried = jnp.concatenate([stress, zero])
    slope = (carried[0] - carried[1]) / (places[1] - places[0])
    at_floor = (carried[0] + slope * places[0])[None]
    carried = jnp.interp(
        levels, jnp.concatenate([zero, places]), jnp.concatenate([at_floor, carried])
    )
    return jnp.where(levels < mudline, velocity, 0.0), carried


def until_last(case: Case) -> Case:
    """Returns the case with a last time at which an upright column is past a tilted one.

    Args:
      case: column; the last of its times is the largest.
    """
    if case.tilt is None:
        return case
    return case._replace(times=case.times[-1:] * case.tilt.rate(case.height))


def tilted_times(
    case: Case, compression: Compression, flux: kynch.Table, settled: Consolidation, times: Array
) -> Array:
    """Returns the times at which an upright column has the state of a tilted one; s, (T,).

    The network of a bed gives no layer of clear fluid under the upper wall.

    Args:
      case: column of particles that sink, with a tilt.
      compression: effective solid stress of the bed.
      flux: f, in m/s.
      settled: the upright column, up to the last time.
      times: times of the tilted column, s, (T,).
    """
    assert case.tilt is not None
    mudline = jnp.minimum(settled.mudline, case.height)
    bed = bed_height(case, compression, flux, settled.cells, settled.volume, mudline)
    return clock_times(times, case.tilt, settled.time, mudline - bed)


def bed_height(
    case: Case,
    compression: Compression,
    flux: kynch.Table,
    cells: Array,
    volume: Array,
    mudline: Array,
) -> Array:
    """Returns the height of the top of the bed, located by particle volume; m, (T,).

    Args:
      case: column of particles that sink.
      compression: effective solid stress of the bed.
      flux: f, in m/s.
      cells: share of the particles in every cell, (C,).
      volume: volume of the cells over that at the start; 1, (T, C).
      mudline: height of the mudline, m, (T,).
    """
    full = jnp.minimum(case.bed_fraction, compression.gel_fraction)
    meets = kynch.bed_contact_fraction(flux, full)
    excess = case.volume_fraction / volume - meets
    bed = jnp.where(full > meets, excess / jnp.where(full > meets, full - meets, 1.0), 1.0)
    layers = case.height * volume * cells[None]
    return jnp.minimum(jnp.sum(layers * jnp.clip(bed, 0.0, 1.0), axis=1), mudline)
