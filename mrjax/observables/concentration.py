"""Volume fraction of the particles against height, and the two fronts derived from it.

phi(z) = (V(z + t/2) - V(z - t/2)) / (A t)

is the volume fraction of a slab of thickness t in a box of lateral area A. V(z) is the exact
particle volume below z: a sphere cut at u above its lowest point leaves the cap
pi u^2 (3R - u) / 3. The overlap of two spheres counts twice.
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
"""Number of cells in a slab one diameter thick; a profile has one level for each cell."""
DILUTE = 1e-4
"""Volume fraction below which slabs are thicker than a diameter. It bounds the number of levels,
which is an array shape and must not depend on a traced diameter."""


def spherical_cap_volume(height: Array, radius: Array) -> Array:
    """Volume of spheres below a plane, pi u^2 (3R - u) / 3, elementwise; m^3.

    Args:
      height: u, height of the plane above the lowest point of the sphere, m; clipped to [0, 2R].
      radius: R, m, of a shape that broadcasts.
    """
    u = jnp.clip(height, 0.0, 2.0 * radius)
    return jnp.pi / 3.0 * u**2 * (3.0 * radius - u)


def solid_below(heights: Array, radius: Array, level: Array) -> Array:
    """Returns the exact particle volume below horizontal planes; (Z,) in m^3.

    Args:
      heights: heights of the centres, (N,) in m.
      radius: R, (N,) in m.
      level: heights of the planes, (Z,) in m.
    """
    bottom = heights - radius
    return jnp.sum(spherical_cap_volume(level[:, None] - bottom[None, :], radius[None, :]), axis=1)


def concentration(run: Run, levels: ArrayLike, thickness: ArrayLike) -> Array:
    """Returns the volume fraction of slabs at every recorded time; 1, (frames + 1, Z).

    A slab that reaches below the floor or above the lid is cut off there. The volume fraction is 0
    for a slab outside the box.

    Args:
      run: run with at least one frame, in a box with a floor.
      levels: heights of the middles of the slabs, (Z,) in m.
      thickness: thickness of the slabs, m, ().

    Raises:
      InputError: `levels` or `thickness` cannot be used, or the box has no floor.
      SimulationError: the run has a fault.
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
    """Returns the height at which phi falls to half its bulk value; m, (frames + 1,).

    It is the highest level at which phi of a sliding slab falls below half of the bulk value. The
    slab is one largest diameter d thick. The bulk value is the mean of phi between d and 0.6 of the
    top of the highest particle (between 0.3 and 0.6 of it if that top is below 10/3 d). Levels are
    d/20 apart, with phi linear in between. If the particles fill less than 1e-4 of the box, slabs
    are as thick as equal spheres that would fill 1e-4.

    In a dispersed suspension and in a finished bed this is the mudline without stray particles, if
    those lie below 5/3 of it. While a bed grows under a thin suspension, half of their common bulk
    value may be more than phi of the suspension; the front is then that of the bed. If the
    particles rise, this is the lower front, with floor and lid exchanged.

    Raises:
      InputError: the box has no floor.
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    box, heights = _with_floor(run.box), from_bed(run, run.heights)
    return from_bed(run, _half_concentration(heights, run.radius, box))


def bed_front(
    run: Run, bed_fraction: ArrayLike, initial_fraction: ArrayLike | None = None
) -> Array:
    """Returns the height of the top of the packed bed; m, (frames + 1,).

    It is the lowest level at which phi falls below the mean of the volume fractions below and above
    the top of the bed. Slabs are two largest diameters d thick, which averages over the layers of a
    packing; phi is linear between levels d/20 apart. Above the bed is suspension of the initial
    volume fraction up to the half-concentration height h, then clear fluid. The slab at the top of
    a bed therefore has

        phi_bed / 2 + phi_initial min((h - z) / 2d, 1/2).

    With less than half a diameter of suspension the bed has met the mudline, and the front is h;
    between half a diameter and one diameter the two are interpolated linearly. The floor counts as
    bed, so the front starts at 0; it stays there while phi of the lowest slab is too small.

    If `bed_fraction` is too high, a bed less dense than the mean of the suspension and
    `bed_fraction` is not detected. If the particles rise, the height is that of the bottom of the
    bed under the lid.

    Args:
      run: run with at least one frame, in a box with a floor.
      bed_fraction: phi_bed, volume fraction of the packed bed in this run, such as the
        concentration in a last frame at rest; 1, ().
      initial_fraction: phi_initial of the dispersed suspension; 1, (). By default the volume of all
        particles over that of the box, which the suspension fills at the start.

    Raises:
      InputError: the box has no floor.
      SimulationError: the run has a fault.
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
    """Computes `concentration` of slabs of half-thickness `half`, frame by frame."""
    lower, upper = (jnp.clip(edge, 0.0, box.height) for edge in (middle - half, middle + half))
    inside = upper > lower
    volume = _area(box) * jnp.where(inside, upper - lower, 1.0)

    # Frame by frame, so that the largest array in memory is (Z, N).
    @jax.checkpoint
    def slab_fractions(heights: Array) -> Array:
        solid = solid_below(heights, radius, upper) - solid_below(heights, radius, lower)
        return jnp.where(inside, solid, 0.0) / volume

    return lax.map(slab_fractions, heights)


@jax.jit
def _half_concentration(heights: Array, radius: Array, box: Box) -> Array:
    @jax.checkpoint
    def half_level(heights: Array) -> Array:
        cell, solid = _column(heights, radius, box)
        return _half_level(cell, solid, jnp.max(heights + radius), radius, box)

    return lax.map(half_level, heights)


@jax.jit
def _bed_front(heights: Array, radius: Array, bed: Array, initial: Array, box: Box) -> Array:
    @jax.checkpoint
    def bed_level(heights: Array) -> Array:
        cell, solid = _column(heights, radius, box)
        top = _half_level(cell, solid, jnp.max(heights + radius), radius, box)
        level, phi = _profile(cell, solid, 2 * CELLS, _area(box), under_floor=bed)
        above = jnp.clip((top - level) / (2 * CELLS * cell), 0.0, 0.5)
        surplus = phi - (0.5 * bed + initial * above)
        first = jnp.argmax(surplus < 0.0)
        front = jnp.where(first > 0, _crossing(level, surplus, first), 0.0)
        suspension = top - front
        return top - suspension * jnp.clip(2.0 * suspension / (CELLS * cell) - 1.0, 0.0, 1.0)

    return lax.map(bed_level, heights)


def _half_level(cell: Array, solid: Array, top: Array, radius: Array, box: Box) -> Array:
    """Computes `half_concentration` of one frame, ()."""
    level, phi = _profile(cell, solid, CELLS, _area(box))
    # A level's weight is the length of its cell within the bulk, so that the mean is continuous in
    # the top.
    low, high = jnp.minimum(2.0 * jnp.max(radius), 0.3 * top), 0.6 * top
    weight = jnp.minimum(level + cell / 2, high) - jnp.maximum(level - cell / 2, low)
    weight = jnp.maximum(weight, 0.0)
    surplus = phi - 0.5 * jnp.sum(weight * phi) / jnp.sum(weight)
    above = jnp.argmax((surplus > 0.0)[::-1])  # number of levels above the last positive surplus
    return _crossing(level, surplus, level.size - above)


def _column(heights: Array, radius: Array, box: Box) -> tuple[Array, Array]:
    """Returns the height of a cell, (), and the particle volume in each cell, (cells,).

    Each particle is cut by the edges of only those 21 cells that it may touch, so the cost is
    proportional to the number of particles.
    """
    thinnest = (6.0 * DILUTE * box.volume / (math.pi * heights.size)) ** (1 / 3)
    cells = math.ceil(CELLS * (box.height / thinnest + 2.0))  # with a thick slab above the lid
    cell = jnp.maximum(2.0 * jnp.max(radius), thinnest) / CELLS
    bottom = heights - radius
    lowest = jnp.floor(lax.stop_gradient(bottom / cell))
    edge = lowest[:, None] + jnp.arange(CELLS + 2, dtype=heights.dtype)[None, :]
    below = spherical_cap_volume(edge * cell - bottom[:, None], radius[:, None])
    # The part of a particle below the floor, at a contact, counts in the lowest cell.
    index = jnp.clip(edge[:, :-1], 0, cells - 1).astype(jnp.int32)
    return cell, jnp.zeros(cells, heights.dtype).at[index].add(jnp.diff(below, axis=1))


def _profile(
    cell: Array, solid: Array, thickness: int, area: float, under_floor: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """Returns levels from the floor, one cell apart, and phi of the slabs about them; (levels,).

    Args:
      cell: height of a cell, m.
      solid: particle volume in every cell from the floor, (cells,) in m^3.
      thickness: thickness of the slabs, an even number of cells.
      area: lateral area of the box, m^2.
      under_floor: volume fraction assumed below the floor; 1.
    """
    under = jnp.full(thickness // 2, under_floor * area * cell)
    zero = np.zeros((), solid.dtype)
    slabs = lax.reduce_window(
        jnp.concatenate([under, solid]), zero, lax.add, (thickness,), (1,), "VALID"
    )
    level = cell * jnp.arange(slabs.size, dtype=solid.dtype)
    return level, slabs / (area * cell * thickness)


def _crossing(level: Array, surplus: Array, upper: Array) -> Array:
    """Returns the level at which the surplus, linear between levels, falls to zero; m, ().

    Args:
      level: levels from the floor, (levels,) in m.
      surplus: surplus at each level, (levels,).
      upper: index of the level above the crossing, ().
    """
    start = surplus[upper - 1]
    drop = start - surplus[upper]
    # Without a drop there is no crossing. The caller then ignores the result, which must be finite.
    share = start / jnp.where(drop > 0.0, drop, 1.0)
    return level[upper - 1] + share * (level[upper] - level[upper - 1])


def _area(box: Box) -> float:
    """Lateral area of a box, m^2."""
    return box.size[0] * box.size[1]


def _with_floor(box: Box) -> Box:
    if box.periodic[2]:
        raise InputError(
            "the box is periodic along z, where nothing settles into a bed; give Box(..., "
            "periodic=(..., ..., False))"
        )
    return box
