"""Tangential contact: Mindlin's spring within Coulomb's limit (Son 2018, Eqs. 7 and 8).

F_t = -8 G* sqrt(R* d) (s + B s') - c_t(e) s',    |F_t| <= mu F_n                   (Eq. 7)

with overlap d, and s the displacement of one surface along the other, in the tangent plane, since
the contact began. The paper prints s - B s', which would add energy in every impact.

The contact history stores s, not the force. If the stiffness changes with the overlap, s keeps its
value, as in Eq. 7 and in LIGGGHTS. The force then vanishes smoothly with the overlap, and a contact
that closes on a stretched spring gains the energy that it loses as it opens. A history of forces
(mindlin/force in LAMMPS) would leave a force at zero overlap.

All functions are elementwise, for any shapes that broadcast.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws import normal, vectors
from mrjax.laws.vectors import Vector, plus, times


def effective_shear_modulus(
    modulus_i: ArrayLike, poisson_i: ArrayLike, modulus_j: ArrayLike, poisson_j: ArrayLike
) -> Array:
    """Effective shear modulus G* of Eq. 8; Pa.

    1/G* = (2 - nu_i)/G_i + (2 - nu_j)/G_j with G = E / 2(1 + nu).
    """
    compliance_i = 2.0 * (2.0 - poisson_i) * (1.0 + poisson_i) / modulus_i
    compliance_j = 2.0 * (2.0 - poisson_j) * (1.0 + poisson_j) / modulus_j
    return 1.0 / (compliance_i + compliance_j)


def stiffness(shear_modulus: ArrayLike, radius: ArrayLike, overlap: ArrayLike) -> Array:
    """Mindlin's tangential stiffness K_t = 8 G* sqrt(R* d); N/m."""
    return 8.0 * shear_modulus * jnp.sqrt(radius * overlap)


def damping_coefficient(
    shear_modulus: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    overlap: ArrayLike,
    dissipation: ArrayLike,
    damping: ArrayLike,
) -> Array:
    """Tangential damping coefficient dF_t/ds' = K_t B + z sqrt(10/3 m* K_t); N s/m."""
    spring = stiffness(shear_modulus, radius, overlap)
    return spring * dissipation + damping * jnp.sqrt(10 / 3 * mass * spring)


def tangential_force(
    stretch: Vector,
    slip: Vector,
    overlap: Array,
    normal_force: Array,
    *,
    shear_modulus: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    friction: ArrayLike,
    dissipation: ArrayLike = 0.0,
    damping: ArrayLike = 0.0,
    damped: bool = True,
) -> tuple[Vector, Vector]:
    """Returns the force of Eq. 7 within Coulomb's limit, and the displacement for the history.

    The spring force is clipped to mu F_n, in its own direction; then the sum of spring and dashpot
    is clipped to mu F_n, too. Force and displacement are therefore continuous at the transition
    from sticking to sliding. The displacement is zero if F_n is zero.

    Args:
      stretch: s, m, in the tangent plane, with the displacement of the current step.
      slip: s', velocity of the surface along its partner's, m/s.
      overlap: d, m; negative if the surfaces are apart.
      normal_force: F_n, N, with its dissipation.
      shear_modulus: G* of Eq. 8, Pa.
      radius: R* of the pair, m.
      mass: m* of the pair, kg.
      friction: mu, Coulomb's coefficient.
      dissipation: B of Eq. 7, s.
      damping: z of `normal.damping_ratio`; c_t = z sqrt(10/3 m* K_t), as in the normal direction.
      damped: False if `dissipation` and `damping` are zero; the compiled program is then shorter.

    Returns:
      The force on the particle, N, and the new s, m.
    """
    root, fourth_root = normal.roots(overlap, radius)
    mindlin = 8.0 * shear_modulus * jnp.sqrt(radius)
    spring = mindlin * root
    limit, trial = friction * normal_force, stretch
    stretch = times(vectors.clip_factor(times(spring, stretch), limit), stretch)
    if not damped:
        return times(-spring, stretch), stretch
    dashpot = spring * dissipation + damping * jnp.sqrt(10 / 3 * mass * mindlin) * fourth_root
    # With a limit of zero the force vanishes, but the derivative by mu needs its trial direction.
    nonzero = tuple(jnp.where(limit > 0.0, s, t) for s, t in zip(stretch, trial, strict=True))
    force = plus(times(spring, nonzero), dashpot, slip)
    return times(-vectors.clip_factor(force, limit), force), stretch
