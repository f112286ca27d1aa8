"""Volume fraction of the solid against height, and the two fronts read off it.

phi(z) = (V(z + t/2) - V(z - t/2)) / (A t)

of a slab of thickness t in a box of lateral area A. V(z), the solid below z, is exact: a sphere cut
at u above its lowest point leaves the cap pi u^2 (3R - u) / 3. Where two spheres overlap, the lens
counts twice.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.run import Run, from_bed
from mrjax.core.tracing import value_or_none

CELLS = 20
"""Cells in a slab one diameter thick; a profile has one level for each cell."""
DILUTE = 1e-4
"""Volume fraction below which slabs are thicker than a diameter. The number of levels is a shape,
which no traced diameter can fix; this bounds it."""


def spherical_cap_volume(height: Array, radius: Array) -> Array:
    """Volume of spheres below a plane, pi u^2 (3R - u) / 3, elementwise; m^3.

    Args:
      height: u, of the plane above the lowest point of the sphere, m; any, taken between 0 and 2R.
      radius: R, m, of a shape that broadcasts.
    """
    u = jnp.clip(height, 0.0, 2.0 * radius)
    return jnp.pi / 3.0 * u**2 * (3.0 * radius - u)


def solid_below(heights: Array, radius: Array, level: Array) -> Array:
    """Solid volume below horizontal planes, exact; (Z,) in m^3.

    Args:
      heights: of the centres, (N,) in m.
      radius: R, (N,) in m.
      level: heights of the planes, (Z,) in m.
    """
    bottom = heights - radius
    return jnp.sum(spherical_cap_volume(level[:, None] - bottom[None, :], radius[None, :]), axis=1)


def concentration(run: Run, levels: ArrayLike, thickness: ArrayLike) -> Array:
    """Volume fraction of slabs at every recorded time; 1, (frames + 1, Z).

    Of a slab that reaches below the floor or above the lid, the part in the box counts; 0 where
    there is none.

    Args:
      run: at least one frame, in a box with a floor.
      levels: heights of the middles of the slabs, (Z,) in m.
      thickness: of every slab, m, ().

    Raises:
      InputError: levels or a thickness that are no slabs, or a box without a floor.
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    if value_or_none(thickness) is not None:
        checks.positive(thickness, "thickness", "m")
    if np.ndim(levels) != 1:
        raise InputError(
            f"levels have shape {np.shape(levels)}; give one row of heights, shape (Z,)"
        )
    middle = jnp.asarray(levels, run.heights.dtype)
    half = jnp.asarray(0.5 * thickness, run.heights.dtype)
    return _slab_fractions(run.heights, run.radius, middle, half, _with_floor(run.box))


def half_concentration(run: Run) -> Array:
    """Height of the front at half the bulk's concentration; m, (frames + 1,).

    Where particles rise, of the lower front: all that follows in the mirror.

    The highest level at which phi of a sliding slab, one largest diameter d thick, falls below half
    of the bulk value. The bulk is the mean of phi between d and 0.6 of the top of the highest
    particle (between 0.3 and 0.6 of it where that top is lower than 10/3 d). Levels are d/20 apart,
    with phi linear in between. Where the particles fill less than 1e-4 of the box, slabs are as
    thick as equal spheres that would fill 1e-4.

    In a dispersed suspension and in a finished bed this is the mudline without its stray particles,
    as long as those lie below 5/3 of it. While a bed grows under a thin suspension, half of their
    common bulk may be more than the suspension has, and the front is the bed's.

    Raises:
      InputError: a box without a floor.
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    box, heights = _with_floor(run.box), from_bed(run, run.heights)
    return from_bed(run, _half_concentration(heights, run.radius, box))


def bed_front(
    run: Run, bed_fraction: ArrayLike, initial_fraction: ArrayLike | None = None
) -> Array:
    """Height of the top of the packed bed, or of its bottom under the lid; m, (frames + 1,).

    Where particles rise, all that follows in the mirror.

    The lowest level at which phi falls below half-way between the bed's and what lies above it,
    of slabs two largest diameters d thick, which evens out the layers of a packing; linear between
    levels d/20 apart. Above it lies suspension of the initial volume fraction up to the
    half-concentration height h, then clear fluid: the slab at the top of a bed has

        phi_bed / 2 + phi_initial min((h - z) / 2d, 1/2).

    Less than half a diameter of suspension is none: the bed has met the mudline, and the front is
    h; from there to one diameter it is led over linearly. The floor counts as bed, so that the
    front rises from 0, where it stays while even the lowest slab is too thin.

    A bed no denser than half-way between the suspension and a phi_bed that is too high is not
    found.

    Args:
      run: at least one frame, in a box with a floor.
      bed_fraction: phi_bed, volume fraction of the packed bed; 1, (). As this run packs it, such as
        the concentration in a last frame at rest.
      initial_fraction: phi_initial, of the dispersed suspension; 1, (). Left out, that of all
        particles in the box, which the suspension filled.

    Raises:
      InputError: a box without a floor.
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    box = _with_floor(run.box)
    if initial_fraction is None:
        initial_fraction = 4.0 / 3.0 * jnp.pi * jnp.sum(run.radius**3) / box.volume
    bed, initial = (
        jnp.asarray(fraction, run.heights.dtype) for fraction in (bed_fraction, initial_fraction)
    )
    heights = from_bed(run, run.heights)
    return from_bed(run, _bed_front(heights, run.radius, bed, initial, box))


@jax.jit
def _slab_fractions(heights: Array, radius: Array, middle: Array, half: Array, box: Box) -> Array:
    """`concentration` of slabs of half-thickness `half`, frame after frame."""
    lower, upper = (jnp.clip(edge, 0.0, box.height) for edge in (middle - half, middle + half))
    inside = upper > lower
    volume = _area(box) * jnp.where(inside, upper - lower, 1.0)

    # One frame after the other, so that (Z, N) is the most that is held at a time.
    @jax.checkpoint
    def one_frame(heights: Array) -> Array:
        solid = solid_below(heights, radius, upper) - solid_below(heights, radius, lower)
        return jnp.where(inside, solid, 0.0) / volume

    return lax.map(one_frame, heights)


@jax.jit
def _half_concentration(heights: Array, radius: Array, box: Box) -> Array:
    @jax.checkpoint
    def one_frame(heights: Array) -> Array:
        cell, solid = _column(heights, radius, box)
        return _half_level(cell, solid, jnp.max(heights + radius), radius, box)

    return lax.map(one_frame, heights)


@jax.jit
def _bed_front(heights: Array, radius: Array, bed: Array, initial: Array, box: Box) -> Array:
    @jax.checkpoint
    def one_frame(heights: Array) -> Array:
        cell, solid = _column(heights, radius, box)
        top = _half_level(cell, solid, jnp.max(heights + radius), radius, box)
        level, phi = _profile(cell, solid, 2 * CELLS, _area(box), under_floor=bed)
        above = jnp.clip((top - level) / (2 * CELLS * cell), 0.0, 0.5)
        surplus = phi - (0.5 * bed + initial * above)
        first = jnp.argmax(surplus < 0.0)
        front = jnp.where(first > 0, _crossing(level, surplus, first), 0.0)
        suspension = top - front
        return top - suspension * jnp.clip(2.0 * suspension / (CELLS * cell) - 1.0, 0.0, 1.0)

    return lax.map(one_frame, heights)


def _half_level(cell: Array, solid: Array, top: Array, radius: Array, box: Box) -> Array:
    """`half_concentration` of one frame, ()."""
    level, phi = _profile(cell, solid, CELLS, _area(box))
    # Each level stands for its cell, of which the part in the bulk counts: the mean is continuous
    # in the top.
    low, high = jnp.minimum(2.0 * jnp.max(radius), 0.3 * top), 0.6 * top
    share = jnp.minimum(level + cell / 2, high) - jnp.maximum(level - cell / 2, low)
    share = jnp.maximum(share, 0.0)
    surplus = phi - 0.5 * jnp.sum(share * phi) / jnp.sum(share)
    above = jnp.argmax((surplus > 0.0)[::-1])  # levels above the last that has a surplus
    return _crossing(level, surplus, level.size - above)


def _column(heights: Array, radius: Array, box: Box) -> tuple[Array, Array]:
    """Height of a cell, (), and the solid in every cell from the floor, (cells,).

    A particle is cut only by the edges of the 21 cells it may reach into, so that the work grows
    with the particles alone.
    """
    thinnest = (6.0 * DILUTE * box.volume / (math.pi * heights.size)) ** (1 / 3)
    cells = math.ceil(CELLS * (box.height / thinnest + 2.0))  # a thick slab above the lid, too
    cell = jnp.maximum(2.0 * jnp.max(radius), thinnest) / CELLS
    bottom = heights - radius
    lowest = jnp.floor(lax.stop_gradient(bottom / cell))
    edge = lowest[:, None] + jnp.arange(CELLS + 2, dtype=heights.dtype)[None, :]
    below = spherical_cap_volume(edge * cell - bottom[:, None], radius[:, None])
    # What is pressed into the floor counts in the lowest cell.
    index = jnp.clip(edge[:, :-1], 0, cells - 1).astype(jnp.int32)
    return cell, jnp.zeros(cells, heights.dtype).at[index].add(jnp.diff(below, axis=1))


def _profile(
    cell: Array, solid: Array, thickness: int, area: float, under_floor: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """Levels from the floor in steps of a cell, and phi of the slabs about them; (levels,) each.

    Args:
      cell: height of a cell, m.
      solid: in every cell from the floor, (cells,) in m^3.
      thickness: of the slabs, an even number of cells.
      area: of the box, m^2.
      under_floor: volume fraction that counts there; 1.
    """
    under = jnp.full(thickness // 2, under_floor * area * cell)
    zero = np.zeros((), solid.dtype)
    slabs = lax.reduce_window(
        jnp.concatenate([under, solid]), zero, lax.add, (thickness,), (1,), "VALID"
    )
    level = cell * jnp.arange(slabs.size, dtype=solid.dtype)
    return level, slabs / (area * cell * thickness)


def _crossing(level: Array, surplus: Array, after: Array) -> Array:
    """Level at which the surplus, linear between levels, falls to zero; m, ()."""
    have, lack = surplus[after - 1], -surplus[after]
    both = have + lack
    # No fall, no crossing: the caller takes another value, and must find this one finite.
    share = have / jnp.where(both > 0.0, both, 1.0)
    return level[after - 1] + share * (level[after] - level[after - 1])


def _area(box: Box) -> float:
    """Lateral area, m^2."""
    return box.size[0] * box.size[1]


def _with_floor(box: Box) -> Box:
    if box.periodic[2]:
        raise InputError(
            "the box is periodic along z, where nothing settles into a bed; give Box(..., "
            "periodic=(..., ..., False))"
        )
    return box
