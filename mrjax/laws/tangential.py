"""Tangential contact: Mindlin's spring within Coulomb's limit (Son 2018, Eqs. 7 and 8).

F_t = -8 G* sqrt(R* d) (s + B s') - c_t(e) s',    |F_t| <= mu F_n                   (Eq. 7)

with overlap d, and s what one surface has been displaced along the other, in their common tangent
plane, since they met. The paper prints s - B s', which would feed energy into every impact.

What a contact remembers is s, not the force. Where the stiffness changes with the overlap, s keeps
its value: this is Eq. 7 as written and what LIGGGHTS does, the force vanishes smoothly with the
overlap, and a contact that closes on a stretched spring gains what it loses as it opens. Adding up
forces instead (mindlin/force in LAMMPS) leaves a force without an overlap at the end.

All functions are elementwise: any shapes that broadcast.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws import normal, vectors
from mrjax.laws.vectors import Vector, plus, times


def effective_shear_modulus(
    modulus_i: ArrayLike, poisson_i: ArrayLike, modulus_j: ArrayLike, poisson_j: ArrayLike
) -> Array:
    """Eq. 8: 1/G* = (2 - nu_i)/G_i + (2 - nu_j)/G_j with G = E / 2(1 + nu); Pa."""
    of_i = 2.0 * (2.0 - poisson_i) * (1.0 + poisson_i) / modulus_i
    of_j = 2.0 * (2.0 - poisson_j) * (1.0 + poisson_j) / modulus_j
    return 1.0 / (of_i + of_j)


def stiffness(shear_modulus: ArrayLike, radius: ArrayLike, overlap: ArrayLike) -> Array:
    """Mindlin's K_t = 8 G* sqrt(R* d); N/m."""
    return 8.0 * shear_modulus * jnp.sqrt(radius * overlap)


def damping_coefficient(
    shear_modulus: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    overlap: ArrayLike,
    dissipation: ArrayLike,
    damping: ArrayLike,
) -> Array:
    """dF_t/ds' at an overlap: K_t B + z sqrt(10/3 m* K_t); N s/m."""
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
    """Eq. 7 within Coulomb's limit, and the displacement that the contact will remember.

    The spring yields along its own trial direction until it bears no more than mu F_n, and spring
    and dashpot together bear no more than that either: force and memory are continuous where
    sticking turns into sliding. A contact that bears nothing remembers nothing.

    Args:
      stretch: s, m, in the tangent plane and with the displacement of the present step.
      slip: s', velocity of the surface along its partner's, m/s.
      overlap: d, m; negative where the surfaces are apart.
      normal_force: F_n, N, dissipation included.
      shear_modulus: G* of Eq. 8, Pa.
      radius, mass: R* in m and m* in kg of the pair.
      friction: mu, Coulomb's coefficient.
      dissipation: B of Eq. 7, s.
      damping: z of `normal.damping_ratio`; c_t = z sqrt(10/3 m* K_t), as in the normal direction.
      damped: False where both are zero: a shorter program.

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
    # Where nothing is borne the direction still matters, to the derivative with respect to mu.
    held = tuple(jnp.where(limit > 0.0, s, t) for s, t in zip(stretch, trial, strict=True))
    borne = plus(times(spring, held), dashpot, slip)
    return times(-vectors.clip_factor(borne, limit), borne), stretch
