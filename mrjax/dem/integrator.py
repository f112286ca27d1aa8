"""Exponential leapfrog: a time step for every drag regime, with one evaluation of the forces.

    x_{n+1/2} = x_n + dt/2 v_n
    v_{n+1}   = v_n e^{-alpha dt} + F(x_{n+1/2})/gamma (1 - e^{-alpha dt})
    x_{n+1}   = x_{n+1/2} + dt/2 v_{n+1}

The stored variables are x_{n+1/2} and v_n, so the two half steps between force evaluations merge
into one. Drag is integrated exactly, so a free fall is exact at any step. The limit alpha dt -> 0
is the leapfrog (second order, symplectic without dissipation). The limit alpha dt -> infinity is
the overdamped Euler method.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax.numpy as jnp
from jax import Array

from mrjax.core.parameters import Parameters
from mrjax.laws import drag, particle
from mrjax.laws.closed_forms import phi_1

Extra = TypeVar("Extra")


class Kick(NamedTuple):
    """Coefficients of one step, v -> keep v + gain F; shapes () or (N,)."""

    keep: Array
    """Factor e^{-alpha dt} of the velocity."""
    gain: Array
    """Factor (1 - e^{-alpha dt}) / gamma of the force, s/kg."""


def kick(parameters: Parameters, time_step: float) -> Kick:
    """Coefficients of a velocity step, finite and differentiable without drag and at full drag."""
    return _kick(drag.coefficient(parameters), particle.inertia(parameters), time_step)


def spin_kick(parameters: Parameters, time_step: float) -> Kick:
    """Coefficients of a spin step: spin -> keep spin + gain torque, with gain in s/(kg m^2)."""
    moment = particle.moment_of_inertia(parameters)
    return _kick(drag.rotational_coefficient(parameters), moment, time_step)


def _kick(resistance: Array, inertia: Array, time_step: float) -> Kick:
    decay = resistance / inertia * time_step
    return Kick(jnp.exp(-decay), phi_1(decay) * time_step / inertia)


def kicked(velocity: Array, keep: Array, added: Array) -> Array:
    """Velocities or spins after a step, (3, N); the factor `keep` is () or (N,)."""
    return jnp.atleast_2d(keep) * velocity + added


def drifted(position: Array, velocity: Array, time: float) -> Array:
    """Positions after a time at constant velocities, (3, N); the time may be negative."""
    return position + time * velocity


def step(
    half_way: Array,
    velocity: Array,
    kick: Callable[[Array, Array], tuple[Array, Array, Extra]],
    time_step: float,
) -> tuple[Array, Array, Extra]:
    """Advances all particles by one step, from the middle of this step to the middle of the next.

    Args:
      half_way: positions x_{n+1/2} in the middle of the step, (3, N): `drifted` by half a step.
      velocity: velocities v_n, (3, N).
      kick: function of `half_way` and `velocity`. It returns the factor of v_n, () or (N,); the
        change gain F by all forces but drag, (3, N); and an extra value.
      time_step: length of the step.

    Returns:
      x_{n+3/2}, v_{n+1} and the extra value of `kick`.
    """
    keep, added, extra = kick(half_way, velocity)
    velocity = kicked(velocity, keep, added)
    return drifted(half_way, velocity, time_step), velocity, extra


mean_decay = phi_1  # its name of before
