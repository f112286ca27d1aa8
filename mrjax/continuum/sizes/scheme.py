"""Finite volumes for several classes of particles: upwind slip and return flow, Heun's steps.

G_i = phi_i+ u_i - phi_i- Q,   u_i = F(phi-) k_i (r_i - r.Phi-),   Q = SUM_m phi_m+ u_m

G_i is the flux of class i down through a face, with - and + for the states below and above it.
Particles slip down from above, as the cell below lets them, and the displaced fluid carries what is
below upwards with Q. A class that slips up is taken from below; Q is then that of all, and carries
the state on the side where it comes from. For one class G = phi+ v(phi-), which is monotone where v
falls with phi (Buerger, Garcia, Karlsen & Towers, J. Eng. Math. 60, 2008, treat such fluxes of a
concentration times a velocity). G vanishes between a full bed and clear fluid. The flux of Lax and
Friedrichs would not, and a bed at rest would dissolve.

The states are linear in a cell (minmod), steps are Heun's (Shu & Osher 1988): of second order in
smooth profiles. The bed is rigid: the flux of all classes is scaled so that a step fills at most
half of the room of a cell. All volume fractions stay positive and their sum below phi_m.

A step ends when the fastest class crosses `REACH` of a cell. The fastest is that which is still
there, with more than a hundredth of its initial volume fraction above some cell with room.
Slips of the remains of faster classes are cut off at that reach. Steps therefore grow as the coarse
classes settle, and a column at rest takes one step to each of the times.
"""

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum.minmod import minmod
from mrjax.continuum.sizes.masliyah import Classes, buoyant_density

REACH = 0.5
"""Largest number of cells that particles cross in a step, relative to the fluid."""
REACH_OF_DENSITIES = 0.28
"""The same where densities differ: return flow and slip may leave a cell by the same face."""
WAVE_REACH = 0.6
"""Largest number of cells that particles and waves of hindrance together cross in a step; minmod
with Euler's steps adds no extremes up to 2/3."""
PRESENT = 1e-2
"""Part of its initial volume fraction above which a class counts as present, times that of all
particles in the densest cell above an open one."""
ABSENT = 1e-9
"""Part of its initial volume fraction below which a class never counts."""
OPEN = 1e-6
"""Part of phi_m by which an open cell is below phi_m."""
NODES = 256
"""Intervals of the table of F and of the slope of 1/f_w, which set the steps only."""


class Column(NamedTuple):
    """A column of C cells, in units of a cell."""

    law: Classes
    """The classes, with mobilities in cells for m."""
    initial: Array
    """Initial volume fractions, (K,)."""
    densest: Array
    """phi_m, ()."""
    factor: Array
    """The larger F at the ends of each interval of the table, (NODES,)."""
    slope: Array
    """Slope of 1/f_w in each interval of the table, (NODES,)."""
    one: Array
    """1, (). XLA computes cheap functions of the total anew for every class and every direction of
    a derivative, and quotients only once: a division by one makes a derivative 1.4 times faster."""


class Carry(NamedTuple):
    """The state of a run."""

    fraction: Array
    """phi_i, (K, C)."""
    time: Array
    """Time, s, ()."""
    steps: Array
    """Number of steps so far, ()."""


def column(law: Classes, initial: Array, densest: Array) -> Column:
    """Prepares a column; velocities of `law` are in cells per second."""
    node = nodes(densest)
    factor = law.factor(node, densest)
    inverse = factor * (1.0 - node) ** 2
    return Column(
        law=law,
        initial=initial,
        densest=densest,
        factor=jnp.maximum(factor[:-1], factor[1:]),
        slope=jnp.abs(jnp.diff(inverse)) * (NODES / densest),
        one=lax.stop_gradient(jnp.where(densest > 0.0, 1.0, 2.0).astype(densest.dtype)),
    )


def nodes(densest: Array) -> Array:
    """Returns volume fractions from 0 to that of the bed, (NODES + 1,)."""
    return densest * jnp.arange(NODES + 1, dtype=densest.dtype) / NODES


def profiles(tube: Column, times: Array, cells: int) -> tuple[Array, Array]:
    """Integrates up to each of the times, with as many steps as it takes.

    Returns:
      The volume fractions, (T, K, C), and the number of steps, ().
    """

    def until(carry: Carry, end: Array) -> tuple[Carry, Array]:
        carry = lax.while_loop(lambda now: now.time < end, lambda now: _step(tube, now, end), carry)
        return carry, carry.fraction

    carry, recorded = lax.scan(until, _start(tube, times, cells), times)
    return recorded, carry.steps


def profiles_of_steps(
    tube: Column, times: Array, cells: int, steps: int
) -> tuple[Array, Array, Array]:
    """Integrates up to each of the times with a given number of steps, for reverse mode.

    Reverse mode stores the beginning of each chunk of steps and recomputes the rest.

    Returns:
      The volume fractions, (T, K, C), the number of steps, (), and True, (), if they sufficed.
    """
    count, chunk = times.size, math.isqrt(steps - 1) + 1

    def advance(state: tuple, _: None) -> tuple[tuple, None]:
        carry, slot, recorded = state
        end = times[jnp.minimum(slot, count - 1)]
        carry = _step(tube, carry, end)
        recorded = lax.dynamic_update_index_in_dim(recorded, carry.fraction, slot, 0)
        return (
            carry,
            jnp.minimum(slot + jnp.where(carry.time >= end, 1, 0), count),
            recorded,
        ), None

    @partial(jax.checkpoint, prevent_cse=False)
    def run_chunk(state: tuple, _: None) -> tuple[tuple, None]:
        return lax.scan(advance, state, length=chunk)

    start = _start(tube, times, cells)
    recorded = jnp.zeros((count + 1, *start.fraction.shape), start.fraction.dtype)
    state = start, jnp.zeros((), jnp.int32), recorded
    (carry, slot, recorded), _ = lax.scan(run_chunk, state, length=-(-steps // chunk))
    return recorded[:count], carry.steps, slot == count


def _start(tube: Column, times: Array, cells: int) -> Carry:
    fraction = jnp.broadcast_to(tube.initial[:, None], (tube.initial.size, cells))
    return Carry(fraction, jnp.zeros((), times.dtype), jnp.zeros((), jnp.int32))


def _step(tube: Column, carry: Carry, end: Array) -> Carry:
    """Heun's step, of the length that the speeds allow, or up to the end; none at the end."""
    fraction, time, steps = carry
    # The length of a step changes only the error, so that derivatives leave it out.
    speed = _speed(*lax.stop_gradient((tube, fraction)))
    left = end - time
    last = speed * left <= 1.0
    length = jnp.where(last, left, 1.0 / jnp.where(last, 1.0, speed))
    first = _downward(tube, fraction, length)
    second = _downward(tube, fraction + jnp.diff(first, axis=1), length)
    settled = fraction + 0.5 * jnp.diff(first + second, axis=1)
    return Carry(settled, jnp.where(last, end, time + length), steps + jnp.where(left > 0.0, 1, 0))


def _downward(tube: Column, fraction: Array, length: Array) -> Array:
    """Returns G_i through every face in a step of a length in s; in cells, (K, C + 1)."""
    low, high, mean = _states(tube, fraction)
    total = jnp.sum(low, axis=0)
    law, equal = tube.law, tube.law.excess.ndim == 0
    pull = (law.factor(total, tube.densest) * length)[None] * buoyant_density(law, low, total)
    pull = pull / tube.one
    reach = REACH if equal else REACH_OF_DENSITIES
    slip = law.mobility[:, None] * pull
    slip = jnp.where(slip < reach, slip, reach)
    if equal:  # every class slips down
        down, carried = slip * high, low
        returned = gross = jnp.sum(down, axis=0)
    else:
        slip = jnp.maximum(slip, -reach)
        down = slip * jnp.where(slip > 0.0, high, low)
        returned, gross = jnp.sum(down, axis=0), jnp.sum(jnp.abs(down), axis=0)
        carried = jnp.where(returned[None] > 0.0, low, high)
        total = jnp.sum(carried, axis=0)
    room = 0.5 * jnp.maximum(tube.densest - jnp.sum(mean, axis=0), 0.0)
    scale = _share(room[:-1], gross * (1.0 - total))
    if not equal:
        scale = scale * _share(room[1:], jnp.maximum(-returned * (1.0 - total), 0.0))
    inner = jnp.arange(fraction.shape[1] + 1) % fraction.shape[1] != 0
    scale = jnp.where(inner, scale, 0.0) / tube.one
    return down * scale[None] - carried * (returned * scale / tube.one)[None]


def _share(room: Array, inflow: Array) -> Array:
    """MIN(1, room / inflow), zero without room; a quotient of small inflows has no derivative."""
    return jnp.where(room > 0.0, room / jnp.where(room > 0.0, jnp.maximum(room, inflow), 1.0), 0.0)


def _states(tube: Column, fraction: Array) -> tuple[Array, Array, Array]:
    """Returns the states below and above every face, (K, C + 1), and the cells with their ends.

    Beyond the ends are a full floor and clear fluid, (K, C + 2).
    """
    full = (tube.initial * (tube.densest / jnp.sum(tube.initial)))[:, None]
    floor = jnp.broadcast_to(full, (fraction.shape[0], 2))
    padded = jnp.concatenate([floor, fraction, jnp.zeros_like(floor)], axis=1)
    rises = jnp.diff(padded, axis=1)
    half = 0.5 * minmod(rises[:, :-1], rises[:, 1:])
    mean = padded[:, 1:-1]
    return (mean + half)[:, :-1], (mean - half)[:, 1:], mean


def _speed(tube: Column, fraction: Array) -> Array:
    """Returns the inverse of the longest step; 1/s, ().

    The waves of hindrance have the speed SUM_m k_m r_m phi_m d(1/f_w)/dphi.
    """
    law, total = tube.law, jnp.sum(fraction, axis=0)
    low, high, below = fraction[:, :-1], fraction[:, 1:], total[:-1]
    is_open = tube.densest - below > OPEN * tube.densest
    left = jnp.max(jnp.where(is_open, total[1:], 0.0)) / jnp.sum(tube.initial)
    node = jnp.clip((below * (NODES / tube.densest)).astype(jnp.int32), 0, NODES - 1)
    pull = tube.factor[node][None] * buoyant_density(law, low, below)
    upwind = high if law.excess.ndim == 0 else jnp.where(pull > 0.0, high, low)
    least = jnp.clip(PRESENT * left, ABSENT, PRESENT) * tube.initial
    slip = law.mobility[:, None] * jnp.abs(pull)
    fastest = jnp.max(jnp.where(upwind > least[:, None], slip, 0.0), axis=0)
    lone = jnp.abs(jnp.broadcast_to(law.lone_velocity, law.mobility.shape))
    waves = tube.slope[node] * jnp.sum(lone[:, None] * high, axis=0)
    reach = REACH if law.excess.ndim == 0 else REACH_OF_DENSITIES
    needed = jnp.maximum(fastest / reach, (fastest + waves) / WAVE_REACH)
    return jnp.max(jnp.where(is_open & (fastest > 0.0), needed, 0.0))
