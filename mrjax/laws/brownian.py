"""Brownian motion of a sphere in a fluid at temperature T, a term F_W of Eq. 1 (Son 2018).

Collisions with molecules push a particle at random, as much as its drag needs to keep its mean
energy (fluctuation and dissipation). The random force and torque that act during a step dt are

    F = sqrt(2 k T gamma / dt) n,    M = sqrt(2 k T gamma_r / dt) n_r

with standard normal numbers n and the coefficients of drag gamma (Eq. 24) and gamma_r. The
exponential leapfrog (`mrjax.dem.integrator`) makes a change of velocity of them, whose variance is
(2 D / dt) (1 - e^-a)^2 with D = k T / gamma and a = alpha dt. Then

    <x^2> = 2 D t    and    <v^2> = (k T / m) (2 / a) tanh(a / 2)

along each axis: the diffusion is exact at any step, and the velocities are those of equipartition
if the step resolves them. (The exact variance of a velocity, (k T / m) (1 - e^-2a), would make D
too large by (a / 2) coth(a / 2) in this integrator.)
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.laws import drag, particle
from mrjax.laws.roots import finite_root

BOLTZMANN = 1.380649e-23
"""Boltzmann's constant k, J/K."""
IMPACT = 3.0
"""Speed of an impact in random motion, in standard deviations of the velocity."""


def refuse_without_temperature(parameters: Parameters) -> None:
    """Refuses parameters without a temperature.

    Raises:
      InputError: there is none.
    """
    if parameters.temperature is None:
        raise InputError("temperature is missing, which Brownian motion needs: give K, such as 293")


def thermal_energy(parameters: Parameters, boltzmann: ArrayLike = BOLTZMANN) -> Array:
    """Thermal energy k T, J.

    Args:
      parameters: physical parameters, with a temperature.
      boltzmann: k, in the units of the parameters; the ones of SI by default.

    Raises:
      InputError: the parameters have no temperature.
    """
    refuse_without_temperature(parameters)
    return jnp.asarray(boltzmann * parameters.temperature)


def diffusion_coefficient(parameters: Parameters, boltzmann: ArrayLike = BOLTZMANN) -> Array:
    """Diffusion coefficient D = k T / gamma (Stokes and Einstein), m^2/s, () or (N,).

    Args:
      parameters: physical parameters, with a temperature.
      boltzmann: k, in the units of the parameters.

    Example:
      >>> parameters = mrjax.Recipe.load("case2").parameters().replace(temperature=293.15)
      >>> print(f"{mrjax.laws.brownian.diffusion_coefficient(parameters):.2g} m^2/s")
      2e-16 m^2/s

    Raises:
      InputError: the parameters have no temperature.
    """
    return thermal_energy(parameters, boltzmann) / drag.coefficient(parameters)


def rotational_diffusion_coefficient(
    parameters: Parameters, boltzmann: ArrayLike = BOLTZMANN
) -> Array:
    """Rotational diffusion coefficient D_r = k T / gamma_r, rad^2/s, () or (N,).

    Args:
      parameters: physical parameters, with a temperature.
      boltzmann: k, in the units of the parameters.

    Raises:
      InputError: the parameters have no temperature.
    """
    return thermal_energy(parameters, boltzmann) / drag.rotational_coefficient(parameters)


def sedimentation_length(parameters: Parameters, boltzmann: ArrayLike = BOLTZMANN) -> Array:
    """Height k T / |W| over which a dilute suspension thins by e, with net weight W; m.

    The shape is () or (N,). The height is infinite without a net weight.

    Args:
      parameters: physical parameters, with a temperature.
      boltzmann: k, in the units of the parameters.

    Raises:
      InputError: the parameters have no temperature.
    """
    return thermal_energy(parameters, boltzmann) / jnp.abs(particle.net_weight(parameters))


def thermal_speed(parameters: Parameters, boltzmann: ArrayLike = BOLTZMANN) -> Array:
    """Standard deviation (k T / m)^(1/2) of a velocity along an axis, m/s, () or (N,).

    The mass m is that of the coated particle with its added mass.

    Args:
      parameters: physical parameters, with a temperature.
      boltzmann: k, in the units of the parameters.

    Raises:
      InputError: the parameters have no temperature.
    """
    return finite_root(thermal_energy(parameters, boltzmann) / particle.inertia(parameters))


def random_force_and_torque(
    parameters: Parameters, time_step: ArrayLike, boltzmann: ArrayLike = BOLTZMANN
) -> tuple[Array, Array]:
    """Standard deviations along an axis of the random force, N, and torque, N m; () or (N,) each.

    They are sqrt(2 k T gamma / dt) and sqrt(2 k T gamma_r / dt). Both have derivatives of 0 at
    T = 0, where the slope of the root is infinite.

    Args:
      parameters: physical parameters, with a temperature.
      time_step: dt, the time for which the force acts, s.
      boltzmann: k, in the units of the parameters.

    Raises:
      InputError: the parameters have no temperature.
    """
    # Of each factor: the product of all can be below the range of float32.
    energy = finite_root(2.0 * thermal_energy(parameters, boltzmann) / time_step)
    force = energy * finite_root(drag.coefficient(parameters))
    return force, energy * finite_root(drag.rotational_coefficient(parameters))
