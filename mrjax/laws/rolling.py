"""Rolling resistance: an elastic-plastic spring and dashpot against rolling (Ai et al. 2011, C).

M_r = -k_r q - c_r q',    |M_r| <= mu_r R* F_n

with q the angle by which one surface has rolled on the other since they met, as a vector in their
tangent plane, k_r = 9/4 (4/3 E* sqrt(R* d)) (mu_r R*)^2 and c_r = 2 h_r sqrt(I_r k_r). It stands
for what makes real particles unlike spheres. It conserves angular momentum: the torques on the two
particles are opposite.

All functions are elementwise: any shapes that broadcast.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws import normal, vectors
from mrjax.laws.vectors import Vector, plus, times


def about_contact(moment: ArrayLike, mass: ArrayLike, radius: ArrayLike) -> Array:
    """I + m R^2, inertia of a particle against rolling on a fixed one; kg m^2.

    Two that roll on each other have the harmonic combination of theirs, as for R* and m*.
    """
    return moment + mass * radius**2


def rolling_torque(
    roll: Vector,
    rate: Vector,
    overlap: Array,
    normal_force: Array,
    *,
    modulus: ArrayLike,
    radius: ArrayLike,
    inertia: ArrayLike,
    friction: ArrayLike,
    damping: ArrayLike = 0.0,
) -> tuple[Vector, Vector]:
    """The torque against rolling, and the angle that the contact will remember.

    Args:
      roll: q, rad, in the tangent plane and with the rolling of the present step.
      rate: q', spin relative to the partner's, without its part along the normal, rad/s.
      overlap: d, m; negative where the surfaces are apart.
      normal_force: F_n, N.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
      inertia: I_r, `about_contact` combined for both, kg m^2; read only with the damping.
      friction: mu_r, coefficient of rolling friction.
      damping: h_r, fraction of critical damping before the limit is reached.

    Returns:
      The torque on the particle, N m, and the new q, rad.
    """
    root, fourth_root = normal.roots(overlap, radius)
    arm = friction * radius
    hertz = 3.0 * modulus * jnp.sqrt(radius)  # 9/4 of 4/3
    spring = hertz * root * arm
    dashpot = 2.0 * damping * jnp.sqrt(inertia * hertz) * fourth_root
    # As forces at the arm mu_r R*, which may be zero.
    roll = times(vectors.clip_factor(times(spring, roll), normal_force), roll)
    borne = plus(times(spring, roll), dashpot, rate)
    return times(-arm * vectors.clip_factor(borne, normal_force), borne), roll
