"""A settling column with a rigid bed, without a grid: every cell has its exact mean.

Hopf's formula (`characteristics`) gives the particle volume below the faces of cells. There are no
steps, so that it compiles in a fraction of the time of the scheme, for a few hundred times.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from mrjax.continuum import characteristics, column_checks, fields, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.profile import Column
from mrjax.laws import yield_stress


@partial(jax.jit, static_argnames="cells")
def exact_column(case: Case, *, cells: int) -> Column:
    """Returns a column with a rigid bed at its times; it has no steps.

    Args:
      case: column without a compression, whose arguments were checked.
      cells: number C of cells.
    """
    case, rising = case.sinking()
    height = jnp.asarray(case.height)
    flux = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    times = yield_stress.effective_times(case.parameters, jnp.asarray(case.times))
    if case.tilt is not None:
        times = characteristics.tilted_times(flux, height, times, case.tilt)
    mudline = characteristics.mudline(flux, height, times)
    bed_front = characteristics.bed_front(flux, height, times)
    edges = height * jnp.arange(cells + 1, dtype=mudline.dtype) / cells

    def below(time: Array) -> Array:
        return characteristics.solids_below(flux, height, edges, jnp.full_like(edges, time))

    profiles = jnp.diff(jax.vmap(below)(times), axis=1) * (cells / height)
    at_level = fields.rigid_bed(case, flux, profiles, mudline, bed_front)
    velocity, stress = fields.mirrored(rising, *at_level)
    # A factor, not a `where`: derivatives of an invalid result are NaN, too.
    valid = jnp.where(column_checks.possible(case, flux), 1.0, jnp.nan).astype(mudline.dtype)

    def level(distance: Array) -> Array:
        return valid * jnp.where(rising, height - distance, distance)

    return Column(
        times=jnp.asarray(case.times),
        mudline=level(mudline),
        bed_front=level(bed_front),
        sedimentation_ratio=valid * mudline / height,
        volume_fraction=valid * jnp.where(rising, profiles[:, ::-1], profiles),
        settling_velocity=valid * velocity,
        solid_stress=valid * stress,
        levels=valid * 0.5 * (edges[1:] + edges[:-1]),
        initial_height=valid * height,
        courant=jnp.zeros_like(height),
        steps=0,
    )
