"""The mudline of a column in a rotor with a rigid bed, without a grid: Kynch's theory in a rotor.

phi_s + (q f)_q = 0,  q = (r / r_floor)^k,  s = k t / r_floor
dphi/ds = -f(phi)  along  d(ln q)/ds = f'(phi),  so that q f(phi) is constant       (Anestis 1983)

f = phi v is Kynch's flux at the acceleration of the floor. A uniform suspension stays uniform and
becomes thinner. Its mudline keeps q phi constant. The bed, of phi_m, grows from q = 1:

d(ln q_b)/ds = -MIN f / (phi_m - phi) over phi from the uniform one to phi_m

The minimum selects the suspension phi_b on the bed; one that is denser than the uniform suspension
stays there. The characteristics that rise from the floor at the start, or from the bed later on,
carry phi_b or, at the start, any phi between it and phi_0. The particles that have passed one of
them until it meets the mudline are all that were above the bed at its start. With q_1 and phi_1 at
its start, and phi at the mudline,

v(phi) = q_1 f(phi_1) / (q_1 phi_1 + phi_m (1 - q_1) - phi_0 (1 - q_top)),
q = q_1 f(phi_1) / f(phi),   s = s_1 + INTEGRAL of dphi / f from phi to phi_1.

The mudline is the highest one of this curve, of that of the uniform suspension, and of the bed.
Denser suspensions must fall more slowly.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from mrjax.continuum import interfaces, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.kynch import INTERVALS, Table
from mrjax.continuum.mean_inverse import mean_inverse
from mrjax.continuum.rotor import Rotor, cells_of, height_of_volume
from mrjax.core.parameters import Parameters
from mrjax.laws.hindrance import Hindrance

UNIFORM = 128
"""Intervals of the uniform suspension, from its top to the floor."""
FAN, BED = 64, 128
"""Characteristics from the floor at the start, and from the bed later on."""

EQUAL = 1e-9
"""Relative difference of velocities that are equal: a wave as fast as the mudline never meets it.
"""


class Suspended(NamedTuple):
    """A uniform suspension in a rotor, while its mudline falls from the top to the floor."""

    fraction: Array
    """phi, (UNIFORM + 1,), decreasing."""
    volume: Array
    """ln q of its mudline, (UNIFORM + 1,)."""
    velocity: Array
    """v(phi), m/s, (UNIFORM + 1,)."""
    time: Array
    """s, m^-1 s, (UNIFORM + 1,)."""


class Curve(NamedTuple):
    """A mudline by its nodes."""

    time: Array
    """s, (N,), not decreasing."""
    volume: Array
    """ln q, (N,)."""
    speed: Array
    """d(ln q)/ds = v, (N,)."""


def mudline(
    parameters: Parameters,
    hindrance: Hindrance | None,
    initial: Array,
    densest: Array,
    rotor: Rotor,
    times: Array,
) -> Array:
    """Returns the height of the interface to the clear fluid above the floor; m, (T,).

    Args:
      parameters: particles of one kind; `gravity` is that of the floor of the rotor.
      hindrance: f_w as a function of the volume fraction; None to use f_w of the parameters.
      initial: phi_0, ().
      densest: phi_m, ().
      rotor: the tube.
      times: times, s, (T,).
    """
    still, rising = _uniform_and_rising(parameters, hindrance, initial, densest, rotor)
    rest = jnp.log(1.0 - initial / densest * (1.0 - rotor.volume_to_top))
    time = times * (rotor.exponent / rotor.floor_radius)
    uniform = _at(Curve(still.time, still.volume, still.velocity), time)
    met = time >= rising.time[0]
    curved = jnp.where(met, _at(rising, time), rest)
    return rotor.height_at(jnp.exp(jnp.minimum(jnp.minimum(uniform, curved), rest)))


def suspended_fraction(
    parameters: Parameters,
    hindrance: Hindrance | None,
    initial: Array,
    rotor: Rotor,
    times: Array,
) -> Array:
    """Returns the volume fraction of the uniform suspension, or of its continuation; 1, (T,).

    Args:
      parameters: as for `mudline`.
      hindrance: as for `mudline`.
      initial: phi_0, ().
      rotor: the tube.
      times: times, s, (T,).
    """
    still = _suspended(parameters, hindrance, initial, rotor)
    time = times * (rotor.exponent / rotor.floor_radius)
    fallen = _at(Curve(still.time, still.volume, still.velocity), time) - still.volume[0]
    return initial * jnp.exp(-fallen)


def fronts(case: Case, times: Array, profiles: Array, meets: Array) -> tuple[Array, Array]:
    """Returns mudline and top of the bed of profiles, located by particle volume; m, (T,) each.

    Args:
      case: column of particles that sink, in a rotor.
      times: times of the profiles, s, (T,).
      profiles: volume fraction of every cell from the floor; 1, (T, C).
      meets: volume fraction on the bed at the start; 1, ().
    """
    rotor, initial, densest = case.rotor, jnp.asarray(case.volume_fraction), case.bed_fraction
    assert rotor is not None
    suspended = suspended_fraction(case.parameters, case.hindrance, initial, rotor, times)
    cells = profiles.shape[1]
    volume = cells_of(rotor, cells).volume
    filled = interfaces.filled_parts(profiles, suspended[:, None], densest)
    packed = jnp.clip((profiles - meets) / (densest - meets), 0.0, 1.0)
    mudline, bed = (height_of_volume(rotor, each @ volume, cells) for each in (filled, packed))
    return mudline, jnp.minimum(bed, mudline)


def rest_time(
    parameters: Parameters,
    hindrance: Hindrance | None,
    initial: Array,
    densest: Array,
    rotor: Rotor,
) -> Array:
    """Returns the time after which all particles are in the bed; s, ().

    Args:
      parameters: as for `mudline`.
      hindrance: as for `mudline`.
      initial: phi_0, ().
      densest: phi_m, ().
      rotor: the tube.
    """
    still, rising = _uniform_and_rising(parameters, hindrance, initial, densest, rotor)
    straight = jnp.interp(rising.volume[-1], still.volume, still.time)
    return jnp.maximum(straight, rising.time[-1]) * (rotor.floor_radius / rotor.exponent)


def _suspended(
    parameters: Parameters, hindrance: Hindrance | None, initial: Array, rotor: Rotor
) -> Suspended:
    """Returns the uniform suspension, with its time by Simpson's rule."""
    top = jnp.log(rotor.volume_to_top)
    volume = top * (1.0 - jnp.arange(2 * UNIFORM + 1, dtype=initial.dtype) / (2 * UNIFORM))
    fraction = initial * jnp.exp(top - volume)
    falling = kynch.velocity(parameters, hindrance, fraction)
    velocity = jnp.broadcast_to(falling, fraction.shape)
    slow = 1.0 / velocity
    steps = (slow[:-2:2] + 4.0 * slow[1:-1:2] + slow[2::2]) * (-top / (6.0 * UNIFORM))
    time = jnp.concatenate([jnp.zeros(1, steps.dtype), jnp.cumsum(steps)])
    return Suspended(fraction[::2], volume[::2], velocity[::2], time)


def _uniform_and_rising(
    parameters: Parameters,
    hindrance: Hindrance | None,
    initial: Array,
    densest: Array,
    rotor: Rotor,
) -> tuple[Suspended, Curve]:
    """Returns the uniform suspension, and the mudline where characteristics from below meet it."""
    still = _suspended(parameters, hindrance, initial, rotor)
    table = kynch.table(parameters, hindrance, initial, densest)
    fraction = jnp.concatenate([still.fraction[:0:-1], table.fraction[INTERVALS:-1]])
    dilute = still.fraction[:0:-1] * still.velocity[:0:-1]
    flux = jnp.concatenate([dilute, table.flux[INTERVALS:-1]])
    return still, _rising(Table(fraction, flux), initial, densest, rotor)


def _rising(flux_table: Table, initial: Array, densest: Array, rotor: Rotor) -> Curve:
    """Returns the mudline where characteristics from the floor or the bed meet it.

    Args:
      flux_table: f, m/s, from the thinnest to the densest suspension, without the bed.
      initial: phi_0, ().
      densest: phi_m, ().
      rotor: the tube.
    """
    fraction, flux = flux_table
    steps = jnp.diff(fraction) * mean_inverse(flux[:-1], flux[1:])
    integral = jnp.concatenate([jnp.zeros(1, steps.dtype), jnp.cumsum(steps)])
    all_solids = initial * (1.0 - rotor.volume_to_top)
    on_bed, bed_volume, bed_time = _bed(flux_table, integral, densest, all_solids)
    share = jnp.arange(FAN, dtype=initial.dtype) / FAN
    started = jnp.concatenate([initial + (on_bed[0] - initial) * share, on_bed])
    ones, zeros = jnp.ones(FAN, bed_volume.dtype), jnp.zeros(FAN, bed_time.dtype)
    volume = jnp.concatenate([ones, bed_volume])
    since = jnp.concatenate([zeros, bed_time])
    begun = jnp.interp(started, fraction, flux)
    carried = volume * begun
    above = volume * started + densest * (1.0 - volume) - all_solids
    possible = above > 0.0
    falling = carried / jnp.where(possible, above, 1.0)
    velocity = flux / fraction
    possible = possible & (falling <= velocity[0])
    falling = jnp.clip(falling, velocity[-1], velocity[0])
    # f is linear between nodes, so that f = v phi, and the integral of 1 / f, are exact.
    slope = jnp.diff(flux) / jnp.diff(fraction)
    node = jnp.searchsorted(-velocity[1:-1], lax.stop_gradient(-falling))
    faster = falling - slope[node]
    meets = faster > EQUAL * velocity[0]
    known = (flux[node] - slope[node] * fraction[node]) / jnp.where(meets, faster, 1.0)
    at_mudline = jnp.where(meets, known, fraction[node])
    first = jnp.searchsorted(fraction[1:-1], lax.stop_gradient(started))

    def until(node: Array, at: Array, flux_there: Array) -> Array:
        inverse = mean_inverse(flux[node], flux_there)
        return integral[node] + (at - fraction[node]) * inverse

    time = since + until(first, started, begun) - until(node, at_mudline, at_mudline * falling)
    place = jnp.log(carried / (at_mudline * falling))
    # At rest all particles are in the bed, whether the mudline is curved there or not.
    time, place = time.at[-1].set(bed_time[-1]), place.at[-1].set(jnp.log(bed_volume[-1]))
    return _from_cusp(Curve(time, place, falling), possible & meets)


def _bed(
    flux_table: Table, integral: Array, densest: Array, all_solids: Array
) -> tuple[Array, Array, Array]:
    """Returns phi_b, q_b and the time s of the growing bed until it is at rest; (BED + 1,) each.

    Args:
      flux_table: f, m/s, from the thinnest to the densest suspension, without the bed.
      integral: INTEGRAL of dphi / f from the first node; (nodes,).
      densest: phi_m, ().
      all_solids: phi_0 (1 - q_top), ().
    """
    fraction, flux = flux_table
    speeds = flux / (densest - fraction)
    # The uniform suspension lies on the bed while it gives the least speed. As soon as a denser one
    # does, waves rise from the bed, and go on rising until the mudline meets them.
    uniform = slice(UNIFORM, None, -1)  # from phi_0, which is a node, to the thinnest one
    known = lax.stop_gradient(speeds)
    densest_contact = UNIFORM + jnp.argmin(known[UNIFORM:])
    slower = jnp.diff(known[uniform]) <= 0.0
    lies = jnp.append(densest_contact == UNIFORM, slower).astype(densest_contact.dtype)
    lies = jnp.cumprod(lies)
    place = densest_contact - (jnp.cumsum(lies) - lies[0])
    speed, contact = speeds[place], fraction[place]
    time = integral[UNIFORM] - integral[uniform]
    growth = 0.5 * (speed[1:] + speed[:-1]) * jnp.diff(time)
    grown = jnp.concatenate([jnp.zeros(1, growth.dtype), jnp.cumsum(growth)])
    rest = -jnp.log(1.0 - all_solids / densest)
    nodes = rest * jnp.arange(BED + 1, dtype=rest.dtype) / BED
    later = jnp.maximum(nodes - grown[-1], 0.0) / speed[-1]
    return (
        jnp.interp(nodes, grown, contact),
        jnp.exp(-nodes),
        jnp.interp(nodes, grown, time) + later,
    )


def _from_cusp(curve: Curve, possible: Array) -> Curve:
    """Returns the part of a curve from its cusp, the earliest node after impossible ones."""
    number = jnp.arange(curve.time.size)
    first = jnp.max(jnp.where(possible, 0, number + 1))
    first = jnp.minimum(first, number[-1])
    cusp = jnp.argmin(jnp.where(number < first, jnp.inf, lax.stop_gradient(curve.time)))
    time, volume, speed = (values[jnp.maximum(number, cusp)] for values in curve)
    return Curve(lax.cummax(time), volume, speed)


def _at(curve: Curve, time: Array) -> Array:
    """Returns ln q at times by cubics, (T,); that of the ends before and after the curve."""
    number = jnp.searchsorted(lax.stop_gradient(curve.time), lax.stop_gradient(time), side="right")
    number = jnp.clip(number - 1, 0, curve.time.size - 2)
    low, high = curve.volume[number], curve.volume[number + 1]
    length = curve.time[number + 1] - curve.time[number]
    some = length > 0.0
    passed = (time - curve.time[number]) / jnp.where(some, length, 1.0)
    share = jnp.clip(jnp.where(some, passed, 1.0), 0.0, 1.0)
    rise = high - low
    begin, end = length * curve.speed[number] - rise, length * curve.speed[number + 1] - rise
    return low + share * rise + share * (1.0 - share) * ((1.0 - share) * begin - share * end)
