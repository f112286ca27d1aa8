"""Gravity less buoyancy (Son 2018, Eqs. 9, 22 and 23), a term of Eqs. 1, 2 and 19."""

import jax.numpy as jnp
from jax import Array

from mrjax.core.parameters import Parameters, per_particle
from mrjax.laws import particle


def net_weight(parameters: Parameters, particles: int) -> Array:
    """Weight less buoyancy of every particle, along z; (3, N) in N.

    Args:
      parameters: in one coherent system of units.
      particles: N.
    """
    weight = per_particle(particle.net_weight(parameters), particles)
    return jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])
