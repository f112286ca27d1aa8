"""Fields of a column with a rigid bed: the velocity of its particles, and the stress they carry.

u = v(phi) between the bed and the mudline, else 0
sigma = Delta rho g phi_m (h_bed - z) in the bed, else 0

Falling particles are carried by the fluid. Those of a rigid bed stand still in fluid that stands
still, so that each layer carries the whole net weight of those above it.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from mrjax.continuum import centrifuge, kynch
from mrjax.continuum.case import Case
from mrjax.continuum.rotor import Rotor
from mrjax.laws import particle, yield_stress


def rigid_bed(
    case: Case, flux: kynch.Table, profiles: Array, mudline: Array, bed_front: Array
) -> tuple[Array, Array]:
    """Returns the settling velocity, m/s, and the solid stress, Pa; (T, C) each.

    Args:
      case: column of particles that sink.
      flux: f, in m/s.
      profiles: volume fraction of every cell from the floor; 1, (T, C).
      mudline: height of the mudline, m, (T,).
      bed_front: height of the top of the bed, m, (T,).
    """
    cells = profiles.shape[1]
    level = case.height / cells * (jnp.arange(cells, dtype=profiles.dtype) + 0.5)
    above_bed = level[None] - bed_front[:, None]
    if case.rotor is not None:
        return _in_rotor(case, case.rotor, flux, profiles, mudline, bed_front)
    falls = (above_bed > 0.0) & (level[None] < mudline[:, None])
    # Cells that the mudline crosses, or over which it is smeared, are thinner than what falls.
    falling = jnp.maximum(profiles, case.volume_fraction)
    velocity = kynch.flux_at(flux, falling) / falling
    velocity = jnp.where(falls, velocity, 0.0) * _speed_of_clock(case)[:, None]
    if case.tilt is not None:
        velocity = velocity * case.tilt.rate(mudline - bed_front)[:, None]
    weight = particle.net_weight_density(case.parameters) * case.bed_fraction
    return velocity, weight * jnp.maximum(-above_bed, 0.0)


def _in_rotor(
    case: Case, rotor: Rotor, flux: kynch.Table, profiles: Array, mudline: Array, bed_front: Array
) -> tuple[Array, Array]:
    """Returns both fields of a tube in a rotor, where acceleration is in proportion to the radius.

    The solids' stress is a pressure, alike in all directions.
    """
    cells = profiles.shape[1]
    level = case.height / cells * (jnp.arange(cells, dtype=profiles.dtype) + 0.5)
    radius, bed = rotor.floor_radius - level[None], rotor.floor_radius - bed_front[:, None]
    falls = (radius < bed) & (level[None] < mudline[:, None]) & (profiles > 0.0)
    # As without a rotor: the cell that the mudline crosses is thinner than what falls.
    suspended = centrifuge.suspended_fraction(
        case.parameters, case.hindrance, case.volume_fraction, rotor, jnp.asarray(case.times)
    )
    falling = jnp.maximum(profiles, suspended[:, None])
    velocity = kynch.flux_at(flux, falling) / falling
    velocity = jnp.where(falls, velocity, 0.0) * (radius / rotor.floor_radius)
    weight = particle.net_weight_density(case.parameters) * case.bed_fraction
    depth = jnp.maximum(radius**2 - bed**2, 0.0) / (2.0 * rotor.floor_radius)
    return velocity, weight * depth


def _speed_of_clock(case: Case) -> Array:
    """Returns the velocities in a carrier that ages over those at the start; 1, (T,)."""
    times = jnp.asarray(case.times)
    effective = partial(yield_stress.effective_times, case.parameters)
    return jax.jvp(effective, (times,), (jnp.ones_like(times),))[1]


def mirrored(rising: Array, velocity: Array, stress: Array) -> tuple[Array, Array]:
    """Returns both fields, (T, C), of a column in its own direction.

    Args:
      rising: True if the particles rise to the lid, ().
      velocity: speed towards the bed in every cell from the bed's end; m/s.
      stress: solid stress in the same cells; Pa.
    """
    upright = jnp.where(rising, -velocity[:, ::-1], velocity)
    return upright, jnp.where(rising, stress[:, ::-1], stress)
