"""A column with a yielding bed at its output times, as profiles over the height."""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from mrjax.continuum import column_checks, fields, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.compression import Compression
from mrjax.continuum.consolidation import (
    consolidate,
    field_at,
    mudline_at,
    share_below,
    volume_at,
)
from mrjax.continuum.profile import Column


@partial(jax.jit, static_argnames=("cells", "steps"))
def solve(case: Case, compression: Compression, *, cells: int, steps: int) -> Column:
    """Simulates a column on a yielding bed, whose effective solid stress is `compression`."""
    case, rising = case.sinking()
    flux = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    settled = consolidate(case, compression, cells=cells, steps=steps)
    height, initial = case.height, case.volume_fraction
    # A network that is stiff enough swells in the equations, which know no plastic strain.
    mudline = jnp.minimum(mudline_at(settled, case.times), height)
    volume = volume_at(settled, case.times)
    layers = height * volume * settled.cells[None]
    full = jnp.minimum(case.bed_fraction, compression.gel_fraction)
    meets = kynch.bed_contact_fraction(flux, full)
    bed = jnp.where(
        full > meets, (initial / volume - meets) / jnp.where(full > meets, full - meets, 1.0), 1.0
    )
    bed_front = jnp.minimum(jnp.sum(layers * jnp.clip(bed, 0.0, 1.0), axis=1), mudline)
    edges = height * jnp.arange(cells + 1, dtype=mudline.dtype) / cells
    below = jax.vmap(share_below, (None, 0, None))(settled.cells, layers, edges)
    # Particles that swelling lifts above the initial height are those of the topmost cell.
    profiles = jnp.diff(below.at[:, -1].set(1.0), axis=1) * initial * cells
    levels = 0.5 * (edges[1:] + edges[:-1])
    at_level = jax.vmap(partial(_at_levels, levels))(
        layers,
        mudline,
        field_at(settled, case.times, settled.speeds),
        field_at(settled, case.times, settled.stress),
    )
    velocity, stress = fields.mirrored(rising, *at_level)
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
