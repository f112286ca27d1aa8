"""Gravity less buoyancy (Son 2018, Eqs. 9, 22 and 23), a term of Eqs. 1, 2 and 19."""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.quantities import quantity
from mrjax.dem.forces.force import BodyForce, Particles, Wrench
from mrjax.laws import particle


def net_weight(parameters: Parameters, particles: int) -> Array:
    """Weight less buoyancy of every particle, along z; (3, N) in N.

    Args:
      parameters: physical parameters, in any coherent system of units.
      particles: number of particles N.
    """
    weight = per_particle(particle.net_weight(parameters), particles)
    return jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])


class Gravity(BodyForce):
    """Weight less buoyancy, (m - m_f) g."""

    vector: ArrayLike | None = quantity("m/s^2", "g, (3,)", default=None)
    """Gravity g, (3,) in m/s^2; None for that of `Parameters`, along -z."""

    steady = True
    in_si = False

    def parameters(self, parameters: Parameters) -> Parameters:
        """Returns the parameters with the component of the vector along -z as their gravity."""
        if self.vector is None:
            return parameters
        return parameters.replace(gravity=-jnp.asarray(self.vector)[2])

    def __call__(self, parameters: Parameters, particles: Particles) -> Wrench:
        """Returns the net weight of every particle."""
        count = particles.position.shape[1]
        if self.vector is None:
            return Wrench(net_weight(parameters, count))
        upwards = net_weight(parameters.replace(gravity=-1.0), count)[2]
        return Wrench(jnp.asarray(self.vector)[:, None] * upwards[None, :])
