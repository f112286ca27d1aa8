"""Forward models: from the parameters of a sample to what was measured on it.

Each takes a recipe, and the parameters near which it will be asked, and gives a function of
`Parameters` to predictions in SI units. What does not depend on the parameters is done once.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jax import Array

import mrjax
from mrjax import Parameters, Recipe, checks, particle, timestep

RELAXATIONS = 40
"""Length of a run, and its number of steps: the start is forgotten to e^-40, and to 1e-5 where
the fit ends at a drag 3 times smaller. The fall is exact at any step."""

MARGIN = 10.0
"""How much faster than expected the particles may fall before they could meet within a run."""

Prediction = dict[str, Array]
ForwardModel = Callable[[Parameters], Prediction]


def closed_form(recipe: Recipe, near: Parameters, seed: int = 0) -> ForwardModel:
    """The terminal velocity of a particle with its corrected drag (Eq. 27), mean over sizes."""

    def predict(parameters: Parameters) -> Prediction:
        return {
            "initial_velocity": jnp.mean(mrjax.terminal_velocity(parameters)),
            "viscosity_ratio": parameters.f_v,
        }

    return predict


def particles(recipe: Recipe, near: Parameters, seed: int = 0) -> ForwardModel:
    """The settling velocity that a simulation of all particles of the box shows.

    Raises:
      InputError: the particles cannot be dispersed in the box.
    """
    state = mrjax.disperse(recipe, seed)
    relaxation = float(timestep.relaxation_time(near).max())
    duration = RELAXATIONS * relaxation
    travel = MARGIN * float(mrjax.terminal_velocity(near).max()) * duration
    radius = np.asarray(particle.outer_radius(near))
    apart = not checks.may_touch(
        np.asarray(state.position), radius, recipe.box, 2 * travel, state.contact_diameter
    )

    def predict(parameters: Parameters) -> Prediction:
        if apart:  # friction would change nothing, and take twice as long to compile
            parameters = parameters.replace(friction=0.0, rolling_friction=0.0)
        run = mrjax.simulate(state, parameters, recipe.box, duration=duration, time_step=relaxation)
        return {
            "initial_velocity": mrjax.settling_velocity(run),
            "viscosity_ratio": parameters.f_v,
        }

    return predict


FORWARD_MODELS: dict[str, Callable[..., ForwardModel]] = {
    "closed-form": closed_form,
    "particles": particles,
}
"""The forward models by the names of the command line."""
