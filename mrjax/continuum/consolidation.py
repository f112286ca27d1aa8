"""A column with a yielding bed, in the material coordinate: no cell of clear fluid, no smeared top.

m is the volume of the particles below a point over that of all, from 0 at the floor to 1 at the
mudline. x = phi_0 / phi is the volume that holds a particle, over its volume at the start.

H dx/dt = -du/dm,   u = v(phi) (1 + (d sigma/dm) / W),   W = Delta rho g phi_0 H
h = H INTEGRAL x dm

u is the velocity of the particles, downwards, and zero at the floor; sigma is zero at the mudline
(Gibson, England & Hussey 1967; Buerger & Concha 1998). If denser suspensions fall more slowly,
disturbances move upwards through the particles. The velocity at a face then follows from the cell
below, and the mudline falls at exactly v(phi_0) until the first disturbance arrives.

The scheme is of second order: linear profiles with the minmod limiter, and steps by backward
differences (BDF2), which are implicit and may be as long as the accuracy allows. A bed of phi_m
without stress may leave the equations of a step without a root. Euler's step without slopes then
takes its place; its equations are monotone.

At rest the stress of every cell carries the weight of the particles above its middle, to rounding.
A bed of phi_m is incompressible, and carries any stress.

The unknown of a cell is y = x in a suspension and x_gel - sigma / K in a network, with
K = -d sigma/dx at the gel point: x(y) is then smooth, and sigma(y) is linear on either side.

Units are those of the column: height H, time H / v(phi_0), stress W.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax.continuum import kynch, tridiagonal
from mrjax.continuum.case import Case
from mrjax.continuum.compression import Compression
from mrjax.continuum.layers import layer_ends
from mrjax.continuum.minmod import minmod
from mrjax.continuum.time_grid import time_grid
from mrjax.continuum.tridiagonal import Linearised
from mrjax.laws import particle

GRADING = 1.5
"""Exponent of the grid: cells become smaller towards the mudline, whose fall they give."""
BEYOND = 1.25
"""Time up to which steps are equal, over that at which a single front would meet the mudline."""
LEAST_SETTLED = 0.05
"""Least of that time, in H / v(phi_0), for a suspension that is a network from the start."""
STEEP = 0.1
"""Rise of x within half a cell above which the scheme becomes one of first order."""
STILL = 1e-30
"""Velocity of a suspension that stands still, in heights over the last time."""
SOLVED = 1e-5
"""Greatest relative error of the unknowns of a step."""


class Bed(NamedTuple):
    """Everything that a step takes, in the units of the column."""

    case: Case
    cells: Array  # share of the particles in every cell, (C,)
    distances: Array  # from the middle of every cell to the next, the last to the mudline, (C,)
    velocity: Array  # v(phi_0), or a scale where it is zero; m/s, ()
    gel: Array  # x_gel, ()
    densest: Array  # x at phi_m, ()
    stiffness: Array  # K, ()
    stress: Array  # sigma_0 / W, ()
    exponent: Array  # k, ()
    known: Array  # the part of BDF2 that is known, (C,)
    own: Array  # factor of x in BDF2, ()
    length: Array  # length of the step, ()
    rise: Array  # x at the upper face of every cell over that in its middle, less 1, (C,)


class Consolidation(NamedTuple):
    """A column at the ends of all steps."""

    time: Array
    """Times, (J + 1,) in s."""
    mudline: Array
    """Height of the mudline, (J + 1,) in m."""
    speeds: Array
    """Speed at which the upper face of every cell falls, (J + 1, C) in m/s."""
    stress: Array
    """Effective solid stress in the middle of every cell, (J + 1, C) in Pa."""
    volume: Array
    """Volume of every cell over its volume at the start, phi_0 / phi; 1, (J + 1, C)."""
    cells: Array
    """Share of the particles in every cell, from the floor; 1, (C,)."""
    solved: Array
    """True if the equations of all steps were solved, ()."""

    @property
    def speed(self) -> Array:
        """Speed at which the mudline falls, (J + 1,) in m/s."""
        return self.speeds[:, -1]


@partial(jax.jit, static_argnames=("cells", "steps"))
def consolidate(case: Case, compression: Compression, *, cells: int, steps: int) -> Consolidation:
    """Simulates a column of particles that sink onto a yielding bed.

    Args:
      case: column; `times` gives the last time.
      compression: effective solid stress of its bed.
      cells: number C of cells.
      steps: number J of steps.
    """
    bed = _prepare(case, compression, cells)
    kinks = _kinks(bed)
    scale = case.height / bed.velocity
    full = jnp.minimum(case.bed_fraction, compression.gel_fraction)
    front = jnp.maximum(BEYOND * (1.0 - case.volume_fraction / full), LEAST_SETTLED)
    time = time_grid(front, case.times[-1] / scale, steps)
    start = _unknown(bed, jnp.ones(cells, time.dtype))

    def step(carry: tuple, length: Array) -> tuple[tuple, tuple[Array, ...]]:
        unknown, volume, before, last_length = carry
        ratio = length / last_length  # zero in the first step, which is Euler's
        second_order = bed._replace(
            known=(1.0 + ratio) * volume - ratio**2 / (1.0 + ratio) * before,
            own=(1.0 + 2.0 * ratio) / (1.0 + ratio),
            length=length,
            # Not of volumes extrapolated to the end: where steps are long, those of denser
            # suspensions that settle much more slowly would grow without bound.
            rise=_rise(bed, volume),
        )
        first_order = bed._replace(known=volume, length=length)
        trial, fell_back = tridiagonal.root(_equations, unknown, second_order, first_order, kinks)
        now = tridiagonal.select(fell_back, first_order, second_order)
        unknown, error = tridiagonal.with_derivatives(_equations, trial, now)
        after = _volume(bed, unknown)
        speeds, stress = _speeds(now, unknown)[0], _stress(bed, unknown)
        return (unknown, after, volume, length), (after, speeds, stress, error)

    begin = start, jnp.ones_like(start), jnp.ones_like(start), jnp.asarray(jnp.inf, time.dtype)
    _, (volume, speeds, stress, error) = lax.scan(step, begin, jnp.diff(time))
    volume = jnp.concatenate([jnp.ones_like(start)[None], volume])
    speeds = jnp.concatenate([_speeds(bed, start)[0][None], speeds])
    stress = jnp.concatenate([_stress(bed, start)[None], stress])
    return Consolidation(
        time * scale,
        case.height * (volume @ bed.cells),
        speeds * bed.velocity,
        stress * _weight(case),
        volume,
        bed.cells,
        jnp.max(error) <= SOLVED,
    )


def mudline_at(column: Consolidation, times: Array) -> Array:
    """Returns the height of the mudline at any times, by cubics with its speeds; m, (T,)."""
    number, share, length = _between(column, times)
    low, high = column.mudline[number], column.mudline[number + 1]
    fall, later_fall = length * column.speed[number], length * column.speed[number + 1]
    drop = low - high
    curve = share * (1.0 - share) * ((1.0 - share) * (drop - fall) - share * (drop - later_fall))
    return low - share * drop + curve


def volume_at(column: Consolidation, times: Array) -> Array:
    """Returns the volume of the cells at any times, over that at the start; 1, (T, C)."""
    return field_at(column, times, column.volume)


def field_at(column: Consolidation, times: Array, field: Array) -> Array:
    """Returns a field, (J + 1, C), at any times by linear interpolation; (T, C)."""
    number, share, _ = _between(column, times)
    low, high = field[number], field[number + 1]
    return low + share[:, None] * (high - low)


def rest_height(case: Case, compression: Compression, *, cells: int) -> Array:
    """Returns the height of the bed at rest, in which stress carries all weight; m, ()."""
    bed = _prepare(case, compression, cells)
    above = jnp.cumsum(bed.cells[::-1])[::-1] - 0.5 * bed.cells
    return case.height * jnp.sum(bed.cells * _volume(bed, bed.gel - above / bed.stiffness))


def mean_fraction(
    case: Case, cells: Array, volume: Array, levels: Array, thickness: Array
) -> Array:
    """Returns the mean volume fraction over layers of the tube; 1, (Q,).

    Args:
      case: column.
      cells: share of the particles in every cell, (C,).
      volume: volume of the cells at the time of each layer, over that at the start; 1, (Q, C).
      levels: middle of each layer, m above the floor, (Q,).
      thickness: thickness of each layer, which ends at the floor and at H; m, (Q,).
    """
    height = case.height
    low, high = layer_ends(levels, thickness, height)
    ends = jnp.stack([low, high], axis=1)
    layers = height * volume * cells[None]
    share = jnp.diff(jax.vmap(share_below, (None, 0, 0))(cells, layers, ends), axis=1)[:, 0]
    return case.volume_fraction * height * share / (high - low)


def share_below(cells: Array, layers: Array, levels: Array) -> Array:
    """Returns the share of the particles below some levels; 1, (L,).

    Args:
      cells: share of the particles in every cell, (C,).
      layers: thickness of every cell, m, (C,).
      levels: heights, m, (L,).
    """
    zero = jnp.zeros(1, layers.dtype)
    faces = jnp.concatenate([zero, jnp.cumsum(layers)])
    number = jnp.searchsorted(faces[1:-1], lax.stop_gradient(levels), method="compare_all")
    filled = jnp.clip((levels - faces[number]) / layers[number], 0.0, 1.0)
    return jnp.concatenate([zero, jnp.cumsum(cells)])[number] + filled * cells[number]


def _between(column: Consolidation, times: Array) -> tuple[Array, Array, Array]:
    """Returns the step of each time, the share of it that has passed, and its length."""
    last = column.time.size - 2
    later = jnp.searchsorted(column.time, lax.stop_gradient(times), method="compare_all")
    number = jnp.clip(later - 1, 0, last)
    length = column.time[number + 1] - column.time[number]
    return number, (times - column.time[number]) / length, length


def _prepare(case: Case, compression: Compression, cells: int) -> Bed:
    """Returns the bed at the start."""
    dtype = jnp.asarray(case.height).dtype
    edges = 1.0 - np.linspace(1.0, 0.0, cells + 1) ** GRADING
    share = jnp.asarray(np.diff(edges), dtype)
    distances = 0.5 * jnp.append(share[1:] + share[:-1], share[-1])
    initial, weight = case.volume_fraction, _weight(case)
    stress, gel = compression.stress / weight, initial / compression.gel_fraction
    zero = jnp.zeros((), dtype)
    velocity = kynch.velocity(case.parameters, case.hindrance, initial)
    # In a carrier whose yield stress holds the suspension, any other velocity is a scale as good.
    still = STILL * case.height / case.times[-1]
    return Bed(
        case=case,
        cells=share,
        distances=distances,
        velocity=jnp.where(velocity > 0.0, velocity, still),
        gel=gel,
        densest=initial / case.bed_fraction,
        stiffness=stress * compression.exponent / gel,
        stress=stress,
        exponent=jnp.asarray(compression.exponent, dtype),
        known=jnp.zeros(cells, dtype),
        own=jnp.ones((), dtype),
        length=zero,
        rise=jnp.zeros(cells, dtype),
    )


def _weight(case: Case) -> Array:
    """Returns W, the net weight of all particles over the area of the tube; Pa, ()."""
    return particle.net_weight_density(case.parameters) * case.volume_fraction * case.height


def _kinks(bed: Bed) -> tuple[Array, Array]:
    """Returns y at phi_m and at the gel point; () each."""
    least = -jnp.sqrt(jnp.finfo(bed.gel.dtype).max)  # a large exponent would overflow
    return jnp.maximum(_unknown(bed, bed.densest), least), bed.gel


def _stress(bed: Bed, unknown: Array) -> Array:
    return bed.stiffness * jnp.maximum(bed.gel - unknown, 0.0)


def _volume(bed: Bed, unknown: Array) -> Array:
    """Returns x of the unknown y; (C,)."""
    excess = 1.0 + _stress(bed, unknown) / bed.stress
    network = bed.gel * excess ** (-1.0 / bed.exponent)
    return jnp.where(unknown > bed.gel, unknown, jnp.maximum(network, bed.densest))


def _unknown(bed: Bed, volume: Array) -> Array:
    """Returns the unknown y of x; (C,)."""
    network = jnp.maximum(bed.gel / volume, 1.0) ** bed.exponent
    return jnp.where(
        volume > bed.gel, volume, bed.gel - bed.stress / bed.stiffness * (network - 1.0)
    )


def _velocity(bed: Bed, volume: Array) -> Array:
    """Returns v(phi) / v(phi_0) at the upper face of every cell; (C,)."""
    case = bed.case
    at_face = case.volume_fraction / jnp.maximum(volume * (1.0 + bed.rise), bed.densest)
    falling = kynch.velocity(case.parameters, case.hindrance, at_face)
    # A suspension that does not settle at all would leave the stress of a dense bed undetermined.
    return jnp.maximum(falling / bed.velocity, jnp.finfo(volume.dtype).eps)


def _speeds(bed: Bed, unknown: Array) -> tuple[Array, Array, Array]:
    """Returns u at the upper face of every cell, and its derivatives by y there and above."""

    def of_cell(unknown: Array) -> tuple[Array, Array]:
        return _velocity(bed, _volume(bed, unknown)), _stress(bed, unknown)

    (velocity, stress), (slope, stress_slope) = jax.jvp(
        of_cell, (unknown,), (jnp.ones_like(unknown),)
    )
    free = 1.0 - (stress - jnp.append(stress[1:], 0.0)) / bed.distances
    per_stress = velocity / bed.distances
    above = per_stress * jnp.append(stress_slope[1:], 0.0)
    return velocity * free, slope * free - per_stress * stress_slope, above


def _equations(unknown: Array, bed: Bed) -> Linearised:
    """Returns BDF2's equations of a step."""
    volume, slope = jax.jvp(partial(_volume, bed), (unknown,), (jnp.ones_like(unknown),))
    speed, own, above = _speeds(bed, unknown)
    rate = bed.length / bed.cells

    def of_face_below(values: Array) -> Array:
        return jnp.concatenate([jnp.zeros_like(values[:1]), values[:-1]])

    return Linearised(
        bed.own * volume - bed.known - rate * (of_face_below(speed) - speed),
        -rate * of_face_below(own),
        bed.own * slope + rate * (own - of_face_below(above)),
        rate * jnp.append(above[:-1], 0.0),
    )


def _rise(bed: Bed, volume: Array) -> Array:
    """Returns x at the upper face of every cell over that in its middle, less 1; (C,).

    Profiles are linear with minmod's slope. It is reduced in a shock, where a line within a cell
    would stand for nothing, and `STEEP` is the rise at which it is halved.
    """
    steepness = jnp.diff(volume) / bed.distances[:-1]
    slope = minmod(jnp.pad(steepness, (1, 0)), jnp.pad(steepness, (0, 1)))
    rise = 0.5 * bed.cells * slope / volume
    return rise / (1.0 + (rise / STEEP) ** 2)
