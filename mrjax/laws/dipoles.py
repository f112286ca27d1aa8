"""Point dipoles: field, force, torque and energy, of one pair and of all pairs.

With r = r n from dipole j to dipole i,

    H_ij = [3 n (n.m_j) - m_j] / (4 pi r^3)
    F_ij = 3 mu_0 / (4 pi r^4) [(m_i.n) m_j + (m_j.n) m_i + (m_i.m_j) n - 5 (m_i.n)(m_j.n) n]
    M_i  = mu_0 m_i x H_i
    U    = -mu_0 sum_i m_i.(H_0 + 1/2 sum_j H_ij)

(Jackson, Classical Electrodynamics, 3rd ed., section 5.7). The force is the negative gradient of
the energy. The force and torque of the particles are terms F_M of Eq. 1 (Son 2018), which its
simulations leave out. All pairs act on each other, so that the cost grows as N^2.

On periodic axes a dipole acts as its nearest image. Each particle then sees the others as a sample
of the size of the box around it. Its mean field is that of the magnetised box, -N M with the
demagnetising factor N of the box and the mean magnetisation M, and not that of an infinite layer.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.laws.vectors import Vector, cross, dot, plus, times

VACUUM_PERMEABILITY = 1.25663706127e-6
"""mu_0, N/A^2 (CODATA 2022)."""
PAIRS_AT_ONCE = 2**20
"""Largest number of pairs whose distances are in memory at the same time."""


def dipole_field(separation: Vector, moment: Vector) -> Vector:
    """Field H of a dipole, A/m; zero at the dipole itself; elementwise.

    Args:
      separation: vector from the dipole to the place of the field, three components, m.
      moment: moment of the dipole, three components, A m^2.
    """
    present, square = _square(separation)
    along = dot(separation, moment)
    size = jnp.where(present, 1.0 / (4.0 * jnp.pi * square * jnp.sqrt(square)), 0.0)
    return times(size, plus(times(3.0 * along / square, separation), -1.0, moment))


def dipole_force(
    separation: Vector,
    moment: Vector,
    partner: Vector,
    permeability: ArrayLike = VACUUM_PERMEABILITY,
) -> Vector:
    """Force of one dipole on another, N; zero if they are at the same place; elementwise.

    Args:
      separation: vector from the partner to the dipole, three components, m.
      moment: moment of the dipole on which the force acts, three components, A m^2.
      partner: moment of the other dipole, three components, A m^2.
      permeability: mu_0, N/A^2.
    """
    present, square = _square(separation)
    mine, theirs = dot(moment, separation), dot(partner, separation)
    size = jnp.where(present, 0.75 / jnp.pi / (square * square * jnp.sqrt(square)), 0.0)
    outwards = dot(moment, partner) - 5.0 * mine * theirs / square
    total = plus(plus(times(mine, partner), theirs, moment), outwards, separation)
    return times(permeability * size, total)


def _square(separation: Vector) -> tuple[Array, Array]:
    """True where two dipoles are apart, and the square of their distance; 1 where not."""
    square = dot(separation, separation)
    present = square > 0.0
    return present, jnp.where(present, square, 1.0)


def fields(position: Array, moment: Array, period: Array | None = None) -> Array:
    """Field of all other dipoles at each one; (3, N) in A/m.

    Args:
      position: centres, (3, N) in m.
      moment: moments, (3, N) in A m^2.
      period: length of the period on each axis, (3,) in m, 0 on an axis without images; None
        without any.
    """

    def law(separation: Vector, _: Array, partner: Array) -> Vector:
        return dipole_field(separation, partner)

    return _over_partners(law, position, moment, period)


def forces(
    position: Array,
    moment: Array,
    permeability: ArrayLike = VACUUM_PERMEABILITY,
    period: Array | None = None,
) -> Array:
    """Force of all other dipoles on each one; (3, N) in N.

    Args:
      position: centres, (3, N) in m.
      moment: moments, (3, N) in A m^2.
      permeability: mu_0, N/A^2.
      period: as for `fields`.
    """

    def law(separation: Vector, own: Array, partner: Array) -> Vector:
        return dipole_force(separation, own, partner, 1.0)

    return permeability * _over_partners(law, position, moment, period)


def torques(moment: Array, field: Array, permeability: ArrayLike = VACUUM_PERMEABILITY) -> Array:
    """Torque mu_0 m x H on each dipole; (3, N) in N m.

    Args:
      moment: moments, (3, N) in A m^2.
      field: fields at the dipoles, with that of the other dipoles, (3, N) in A/m.
      permeability: mu_0, N/A^2.
    """
    return permeability * jnp.stack(list(cross(moment, field)))


def energy(
    position: Array,
    moment: Array,
    applied: Array | None = None,
    permeability: ArrayLike = VACUUM_PERMEABILITY,
    period: Array | None = None,
) -> Array:
    """Energy U of fixed moments in each other's field and in a uniform one; J, ().

    Args:
      position: centres, (3, N) in m.
      moment: moments, (3, N) in A m^2.
      applied: uniform field H_0, (3,) in A/m; None for none.
      permeability: mu_0, N/A^2.
      period: as for `fields`.
    """
    half = 0.5 * jnp.sum(moment * fields(position, moment, period))
    outside = 0.0 if applied is None else jnp.sum(moment * applied[:, None])
    return -permeability * (half + outside)


def _over_partners(
    law: Callable[[Vector, Array, Array], Vector],
    position: Array,
    moment: Array,
    period: Array | None,
) -> Array:
    """Sum of a law over all partners of each particle, (3, N), with bounded memory.

    Args:
      law: function of separation, own moment and partner's moment.
      position, moment: centres and moments, (3, N).
      period: as for `fields`.
    """
    count = position.shape[1]
    everyone = jnp.arange(count)

    # Reverse mode keeps positions and moments, not the pairs.
    @jax.checkpoint
    def of_rows(ids: Array, position: Array, moment: Array) -> Array:
        separation = position[:, ids][:, :, None] - position[:, None, :]
        # A fused multiplication and subtraction need not give zero for a particle and itself.
        itself = ids[:, None] == everyone[None, :]
        separation = jnp.where(itself[None], 0.0, nearest_image(separation, period))
        parts = law(separation, moment[:, ids][:, :, None], moment[:, None, :])
        return jnp.stack([jnp.sum(part, axis=1) for part in parts])

    rows = max(1, PAIRS_AT_ONCE // count)
    if rows >= count:
        return of_rows(everyone, position, moment)
    blocks = -(-count // rows)
    padded = jnp.minimum(jnp.arange(blocks * rows), count - 1).reshape(blocks, rows)
    sums = lax.map(lambda ids: of_rows(ids, position, moment), padded)
    return jnp.moveaxis(sums, 0, 1).reshape(3, -1)[:, :count]


def nearest_image(separation: Array, period: Array | None) -> Array:
    """Separations of the nearest images, (3, ...) in m.

    Args:
      separation: vectors from one particle to another, (3, ...) in m.
      period: length of the period on each axis, (3,) in m, 0 on an axis without images; None
        without any.
    """
    if period is None:
        return separation
    period = period.reshape(3, *[1] * (separation.ndim - 1))
    images = period > 0.0
    turns = jnp.round(separation / jnp.where(images, period, 1.0))
    return separation - period * lax.stop_gradient(jnp.where(images, turns, 0.0))
