"""Brownian motion, in F_W of Eq. 1; see `mrjax.laws.brownian`."""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.core.quantities import quantity
from mrjax.dem.forces.force import Noise, Wrench
from mrjax.laws import brownian


class Brownian(Noise):
    """Random force and torque of a fluid at the temperature of the parameters, `temperature`.

    They follow from the drag on the particle at this moment: with local drag, from that of its
    height. Its change along the path of a particle is left out, so that local drag makes particles
    drift where it changes, with a velocity of k T d(1/gamma)/dz towards the stronger drag.
    Without drag there is no Brownian motion.

    A run stays the same for the same state: `State.random` has the random numbers, and a run goes
    on where the one before has ended. Other numbers: `state.with_seed(1)`.

    Example:
      >>> state = mrjax.place([[5e-6, 5e-6, 5e-6]], seed=0)
      >>> water = mrjax.Recipe.load("case2").parameters().replace(viscosity=1e-3, radius=1e-7)
      >>> run = mrjax.simulate(
      ...     state,
      ...     water.replace(temperature=293.15),
      ...     mrjax.Box((1e-5, 1e-5, 1e-5)),
      ...     duration=1e-3,
      ...     time_step=1e-5,
      ...     forces=[mrjax.Brownian()],
      ... )
      >>> run.steps
      100
    """

    boltzmann: ArrayLike = quantity("J/K", "k, Boltzmann's constant", default=brownian.BOLTZMANN)

    in_si = False

    def active(self, parameters: Parameters) -> "Brownian":
        """Returns the force.

        Raises:
          InputError: the parameters have no temperature.
        """
        brownian.refuse_without_temperature(parameters)
        return self

    def __call__(self, parameters: Parameters, numbers: Array, time_step: ArrayLike) -> Wrench:
        """Returns the random force and torque of a step.

        Args:
          parameters: parameters, with the drag of this moment.
          numbers: standard normal numbers of the particles, (6, N).
          time_step: length of the step.
        """
        force, torque = brownian.random_force_and_torque(parameters, time_step, self.boltzmann)
        return Wrench(jnp.atleast_2d(force) * numbers[:3], jnp.atleast_2d(torque) * numbers[3:])
