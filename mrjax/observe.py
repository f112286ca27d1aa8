"""What an experimenter would read off a run: mudline, settling velocity, sedimentation ratio."""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax import drag, particle
from mrjax.parameters import Parameters
from mrjax.run import Run


def settling_velocity(run: Run) -> Array:
    """Initial settling velocity: the greatest mean descent speed of the frames after the start.

    Particles reach it after a few relaxation times (Eq. 27: 99 % after ln 100 = 4.6 of them) and
    keep it until a bed has grown under them: at least one frame must lie in between, and a run that
    is shorter has no settling velocity yet. m/s, ().

    Raises:
      SimulationError: the run is not to be trusted.
    """
    run.check()
    return jnp.max(run.mean_velocity[1:])


def sedimentation_ratio(run: Run) -> Array:
    """Mudline over the initial height of the suspension, which filled the box; 1, (frames + 1,).

    Raises:
      SimulationError: the run is not to be trusted.
    """
    run.check()
    return run.mudline / run.initial_height


def mudline_descent(run: Run) -> Array:
    """Rate of descent of the mudline from each frame to the next; m/s, (frames,).

    Raises:
      SimulationError: the run is not to be trusted.
    """
    run.check()
    return -jnp.diff(run.mudline) / jnp.diff(run.times)


def reynolds_number(velocity: ArrayLike, parameters: Parameters) -> Array:
    """Re = rho_f v 2 f_r R / (f_v mu) of a coated particle in the thickened fluid; 1.

    Args:
      velocity: settling velocity, m/s.
    """
    diameter = 2.0 * particle.outer_radius(parameters)
    viscosity = drag.carrier_viscosity(parameters)
    return parameters.fluid_density * velocity * diameter / viscosity
