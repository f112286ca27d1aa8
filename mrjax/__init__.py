"""A differentiable simulator for the settling of magnetorheological fluids (Son 2018)."""

from importlib.metadata import version

from mrjax.box import Box
from mrjax.disperse import disperse
from mrjax.errors import InputError, SimulationError
from mrjax.history import Contacts
from mrjax.loads import contact_forces
from mrjax.observe import mudline_descent, reynolds_number, sedimentation_ratio, settling_velocity
from mrjax.parameters import Parameters
from mrjax.recipe import Recipe
from mrjax.run import Fault, Run
from mrjax.settle import settle
from mrjax.simulate import simulate
from mrjax.soften import softened
from mrjax.state import State, place
from mrjax.theory import terminal_velocity
from mrjax.timestep import time_step

__version__ = version("mrjax")

__all__ = [
    "Box",
    "Contacts",
    "Fault",
    "InputError",
    "Parameters",
    "Recipe",
    "Run",
    "SimulationError",
    "State",
    "contact_forces",
    "disperse",
    "mudline_descent",
    "place",
    "reynolds_number",
    "sedimentation_ratio",
    "settle",
    "settling_velocity",
    "simulate",
    "softened",
    "terminal_velocity",
    "time_step",
]
