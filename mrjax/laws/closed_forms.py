"""Closed forms: exact solutions, of the paper or of Hertz, that a simulation must reproduce."""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.parameters import Parameters
from mrjax.laws import drag, normal, particle, yield_stress

SERIES_BELOW = 0.1
SERIES_ORDER = 11  # exact to rounding below the switch, three derivatives included


def terminal_velocity(parameters: Parameters) -> Array:
    """Terminal velocity beta/alpha of Eqs. 13 and 27, net weight over drag coefficient.

    It is positive downwards; m/s, () or (N,). f_w, f_s and f_v enter only as a product. Without
    drag it is infinite, without drag and gravity NaN. In a fluid with a yield stress it is 0 from
    the threshold of a single particle on (`mrjax.laws.yield_stress`).

    Example:
      >>> parameters = mrjax.Recipe.load("case1").parameters()
      >>> print(f"{86400e3 * mrjax.terminal_velocity(parameters):.1f} mm/day")
      491.2 mm/day

    Raises:
      InputError: `parameters` is no `Parameters`.
    """
    checks.require_class(Parameters, parameters=parameters)
    newtonian = jnp.divide(particle.net_weight(parameters), drag.coefficient(parameters))
    if yield_stress.is_newtonian(parameters):
        return newtonian
    return newtonian * yield_stress.velocity_factor(parameters)


def free_fall_velocity(
    parameters: Parameters, time: ArrayLike, initial_velocity: ArrayLike = 0.0
) -> Array:
    """Eqs. 13 and 27: v(t) = v_0 e^{-alpha t} + beta/alpha (1 - e^{-alpha t}), downwards; m/s.

    alpha contains the added mass of Eq. 12 and the inertia of the coated particle; the paper prints
    it without both. Without drag the velocity is v_0 + beta t.

    Args:
      parameters: particles and a Newtonian fluid.
      time: time, s, of any shape that broadcasts with the parameters.
      initial_velocity: v_0, m/s, positive downwards.

    Raises:
      InputError: the fluid has a yield stress.
    """
    yield_stress.refuse_particles(parameters)
    inertia = particle.inertia(parameters)
    decay = drag.coefficient(parameters) / inertia * time
    acceleration = particle.net_weight(parameters) / inertia
    return initial_velocity * jnp.exp(-decay) + acceleration * time * phi_1(decay)


def hertz_duration(
    modulus: ArrayLike, radius: ArrayLike, mass: ArrayLike, speed: ArrayLike
) -> Array:
    """Duration of an elastic impact, 2.94328 d_max / v; s. Arguments as `normal.impact_overlap`."""
    return 2.94328 * normal.impact_overlap(modulus, radius, mass, speed) / speed


def hertz_force(modulus: ArrayLike, radius: ArrayLike, overlap: ArrayLike) -> Array:
    """Elastic force 4/3 E* sqrt(R*) d^(3/2) at an overlap d in m; N."""
    return normal.stiffness(modulus, radius, overlap) * overlap * (2 / 3)


def phi_1(exponent: Array) -> Array:
    """(1 - e^-a) / a, the mean of e^-s for s from 0 to a >= 0; 1 at a = 0. Elementwise."""
    small = exponent < SERIES_BELOW
    a = jnp.where(small, exponent, 0.0)
    series = jnp.ones_like(a)
    for order in range(SERIES_ORDER, 1, -1):
        series = 1.0 - a / order * series
    large = jnp.where(small, 1.0, exponent)
    return jnp.where(small, series, -jnp.expm1(-large) / large)
