"""Rolling resistance: an elastic-plastic spring and dashpot (Ai et al. 2011, model C).

M_r = -k_r q - c_r q',    |M_r| <= mu_r R* F_n

q is the angle by which one surface has rolled on the other since the contact began, as a vector in
the tangent plane; k_r = 9/4 (4/3 E* sqrt(R* d)) (mu_r R*)^2 and c_r = 2 h_r sqrt(I_r k_r). The law
models particles that are not perfect spheres. It conserves angular momentum, because the torques on
the two particles are opposite.

All functions are elementwise, for any shapes that broadcast.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws import normal, vectors
from mrjax.laws.vectors import Vector, plus, times


def contact_inertia(moment: ArrayLike, mass: ArrayLike, radius: ArrayLike) -> Array:
    """Moment of inertia I + m R^2 of a particle about its contact point; kg m^2.

    For two particles that roll on each other, I_r is the harmonic combination of both values, like
    R* and m*.
    """
    return moment + mass * radius**2


about_contact = contact_inertia
"""The old name of `contact_inertia`."""


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
    """Returns the torque against rolling and the rolled angle for the contact history.

    Args:
      roll: q, rad, in the tangent plane, with the rolling of the current step.
      rate: q', relative spin without its component along the normal, rad/s.
      overlap: d, m; negative if the surfaces are apart.
      normal_force: F_n, N.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
      inertia: I_r, the harmonic combination of `contact_inertia`, kg m^2; used only by `damping`.
      friction: mu_r, coefficient of rolling friction.
      damping: h_r, fraction of critical damping below the limit of the torque.

    Returns:
      The torque on the particle, N m, and the new q, rad.
    """
    root, fourth_root = normal.roots(overlap, radius)
    arm = friction * radius
    hertz = 3.0 * modulus * jnp.sqrt(radius)  # 9/4 of 4/3
    spring = hertz * root * arm
    dashpot = 2.0 * damping * jnp.sqrt(inertia * hertz) * fourth_root
    # Torques over the arm mu_r R*, which may be zero: forces with the limit F_n.
    roll = times(vectors.clip_factor(times(spring, roll), normal_force), roll)
    force = plus(times(spring, roll), dashpot, rate)
    return times(-arm * vectors.clip_factor(force, normal_force), force), roll
