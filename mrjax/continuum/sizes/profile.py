"""The result of a polydisperse column: profiles of the classes, heights of fronts, compositions."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.continuum import fields
from mrjax.continuum.case import Case
from mrjax.continuum.sizes import interfaces, masliyah
from mrjax.continuum.sizes.masliyah import Classes

PACKED = 0.95
"""Part of phi_m above which a layer counts as bed."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class PolydisperseColumn:
    """A settling column of K classes of particles at T times, in C cells from the floor.

    If a traced call has impossible arguments, or too few steps, every number except the times and
    the number of steps is NaN.
    """

    times: Array
    """Output times, (T,) in s."""
    mudline: Array
    """Height of the interface to the supernatant, (T,) in m.

    The total volume fraction below it exceeds `threshold` times the initial one. A sharp front is
    located by particle volume, and where layers pass smoothly into each other the level itself is
    interpolated (`mudline_at`). If the particles rise, it is the lower interface.
    """
    bed_front: Array
    """Height of the top of the bed, (T,) in m; of its bottom, if it is under the lid.

    The total volume fraction in the bed exceeds 0.95 phi_m.
    """
    sedimentation_ratio: Array
    """Height of the mudline over the initial height; 1, (T,)."""
    volume_fraction: Array
    """Mean total volume fraction of every cell; 1, (T, C)."""
    class_fractions: Array
    """Mean volume fraction of each class in every cell; 1, (T, K, C)."""
    class_velocities: Array
    """Velocity of a particle of each class in the middle of every cell, positive downwards; m/s,
    (T, K, C), zero in the bed.

    Above the mudline it is that of a particle of the class that would be there.
    """
    settling_velocity: Array
    """Mean velocity of the particles in every cell by volume, positive downwards; m/s, (T, C), zero
    in the bed and without particles."""
    solid_stress: Array
    """Effective solid stress in the middle of every cell; Pa, (T, C).

    It is the net weight of the bed above, which touching particles carry.
    """
    bed_composition: Array
    """Volume of each class over that of all particles in the bed; 1, (T, K), zero without a bed."""
    supernatant_fractions: Array
    """Mean volume fraction of each class above the mudline; 1, (T, K), zero without supernatant."""
    levels: Array
    """Heights of the middles of the cells, (C,) in m."""
    initial_height: Array
    """Height of the suspension at the start, m, ()."""
    initial_fractions: Array
    """Initial volume fraction of each class; 1, (K,)."""
    bed_fraction: Array
    """phi_m, volume fraction of the bed; 1, ()."""
    threshold: Array
    """Share of the initial volume fraction that defines the mudline; 1, ()."""
    rising: Array
    """True if the particles rise, (); the bed is then under the lid."""
    steps: Array
    """Number of steps up to the last of the times, ()."""

    def mudline_at(self, threshold: ArrayLike) -> Array:
        """Height of the mudline for another threshold, (T,) in m.

        Args:
          threshold: share of the initial total volume fraction, between 0 and 1; ().
        """
        upright = jnp.where(self.rising, self.volume_fraction[:, ::-1], self.volume_fraction)
        level = jnp.asarray(threshold) * jnp.sum(self.initial_fractions)
        heights = interfaces.crossings(upright, level, self.bed_fraction)
        height = heights * (self.initial_height / upright.shape[1])
        return jnp.where(self.rising, self.initial_height - height, height)


def fronts(profiles: Array, case: Case, threshold: Array) -> tuple[Array, Array]:
    """Returns the heights of the mudline and of the top of the bed, in cells, (T,) each.

    Args:
      profiles: volume fractions of particles that sink, (T, K, C).
      case: the arguments.
      threshold: share of the initial total, ().
    """
    total, densest = jnp.sum(profiles, axis=1), jnp.asarray(case.bed_fraction)
    level = threshold * jnp.sum(jnp.asarray(case.volume_fraction))
    return (
        interfaces.crossings(total, level, densest),
        interfaces.crossings(total, PACKED * densest, densest),
    )


def polydisperse_column(
    profiles: Array,
    law: Classes,
    case: Case,
    threshold: Array,
    rising: Array,
) -> dict[str, Array]:
    """Returns the fields that follow from profiles of particles that sink.

    Args:
      profiles: volume fractions, (T, K, C).
      law: the classes, with mobilities in SI.
      case: the arguments.
      threshold: share of the initial total, ().
      rising: True if the column is a mirror image, ().
    """
    initial, densest = jnp.asarray(case.volume_fraction), jnp.asarray(case.bed_fraction)
    cells, height = profiles.shape[-1], jnp.asarray(case.height)
    total = jnp.sum(profiles, axis=1)
    mudline, bed = fronts(profiles, case, threshold)
    in_bed = interfaces.volume_below(profiles, bed)
    above = jnp.sum(profiles, axis=-1) - interfaces.volume_below(profiles, mudline)
    clear = jnp.maximum(cells - mudline, 0.0)[:, None]
    cell = height / cells
    in_suspension = jnp.arange(cells, dtype=initial.dtype)[None] + 0.5 > bed[:, None]
    velocities = jax.vmap(masliyah.velocities, (None, 0, None))(law, profiles, densest)
    velocities = jnp.where(in_suspension[:, None], velocities, 0.0)
    if case.tilt is not None:
        length = cell * jnp.maximum(mudline - bed, 0.0)
        velocities = velocities * case.tilt.rate(length)[:, None, None]
    mean_velocity = _quotient(jnp.sum(profiles * velocities, axis=1), total)
    weight = jnp.abs(jnp.asarray(case.parameters.gravity)) * masliyah.excess_density(law, profiles)
    stress = cell * interfaces.carried(weight, bed)
    velocity, stress = fields.mirrored(rising, mean_velocity, stress)

    def level(count: Array) -> Array:
        return jnp.where(rising, height - cell * count, cell * count)

    return {
        "mudline": level(mudline),
        "bed_front": level(bed),
        "sedimentation_ratio": mudline / cells,
        "volume_fraction": jnp.where(rising, total[:, ::-1], total),
        "class_fractions": jnp.where(rising, profiles[..., ::-1], profiles),
        "class_velocities": jnp.where(rising, -velocities[..., ::-1], velocities),
        "settling_velocity": velocity,
        "solid_stress": stress,
        "bed_composition": _quotient(in_bed, jnp.sum(in_bed, axis=1, keepdims=True)),
        "supernatant_fractions": _quotient(above, clear),
        "levels": cell * (jnp.arange(cells, dtype=initial.dtype) + 0.5),
    }


def _quotient(part: Array, whole: Array) -> Array:
    """Returns part / whole, and zero where the whole is zero."""
    some = whole > 0.0
    return jnp.where(some, part / jnp.where(some, whole, 1.0), 0.0)
