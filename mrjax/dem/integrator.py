"""The exponential leapfrog: one step for every regime, with one evaluation of the forces.

    x_{n+1/2} = x_n + dt/2 v_n
    v_{n+1}   = v_n e^{-alpha dt} + F(x_{n+1/2})/gamma (1 - e^{-alpha dt})
    x_{n+1}   = x_{n+1/2} + dt/2 v_{n+1}

What is stepped is x_{n+1/2} and v_n: the two half steps between forces are one. Drag is integrated
exactly, so a free fall is exact at any step. alpha dt -> 0 gives the leapfrog (second order,
symplectic without dissipation), alpha dt -> infinity overdamped Euler.
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

    keep: Array  # e^{-alpha dt}
    gain: Array  # (1 - e^{-alpha dt}) / gamma, s/kg


def kick(parameters: Parameters, time_step: float) -> Kick:
    """The coefficients of a step; finite and differentiable in the limits of no and full drag."""
    return _kick(drag.coefficient(parameters), particle.inertia(parameters), time_step)


def spin_kick(parameters: Parameters, time_step: float) -> Kick:
    """The same for spins and torques: spin -> keep spin + gain torque, gain in s/(kg m^2)."""
    moment = particle.moment_of_inertia(parameters)
    return _kick(drag.rotational_coefficient(parameters), moment, time_step)


def _kick(resistance: Array, inertia: Array, time_step: float) -> Kick:
    decay = resistance / inertia * time_step
    return Kick(jnp.exp(-decay), phi_1(decay) * time_step / inertia)


def kicked(velocity: Array, keep: Array, added: Array) -> Array:
    """Velocities after a step, or spins; (3, N). What is kept of them is () or (N,)."""
    return jnp.atleast_2d(keep) * velocity + added


def drifted(position: Array, velocity: Array, time: float) -> Array:
    """Positions after a time, or before where it is negative, at these velocities; (3, N)."""
    return position + time * velocity


def step(
    half_way: Array,
    velocity: Array,
    kick: Callable[[Array, Array], tuple[Array, Array, Extra]],
    time_step: float,
) -> tuple[Array, Array, Extra]:
    """One step of all particles, from the middle of its way to that of the next.

    Args:
      half_way: positions in the middle, x_{n+1/2}, (3, N): `drifted` by half a step.
      velocity: v_n, (3, N).
      kick: of these: what is kept of v_n, () or (N,); what everything but the drag adds, gain F,
        (3, N); and a value that is handed on.

    Returns:
      x_{n+3/2}, v_{n+1} and the last value of `kick`.
    """
    keep, added, extra = kick(half_way, velocity)
    velocity = kicked(velocity, keep, added)
    return drifted(half_way, velocity, time_step), velocity, extra


mean_decay = phi_1  # its name of before
