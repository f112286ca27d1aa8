"""A differentiable simulator for the settling of magnetorheological fluids (Son 2018)."""

from importlib.metadata import version

import mrjax.hush  # noqa: F401 - has to come before JAX
from mrjax.box import Box
from mrjax.column import Column, column, column_steps
from mrjax.compression import Compression
from mrjax.concentration import bed_front, concentration
from mrjax.disperse import disperse
from mrjax.ensemble import ensemble
from mrjax.errors import InputError, SimulationError
from mrjax.history import Contacts
from mrjax.loads import Touching, contact_forces, coordination_number, normal_forces
from mrjax.observe import (
    HEIGHTS,
    asymptotes,
    mudline_descent,
    reynolds_number,
    sedimentation_ratio,
    settling_velocity,
)
from mrjax.parameters import Parameters
from mrjax.recipe import Recipe
from mrjax.run import Fault, Run
from mrjax.run_file import load_run, save_run
from mrjax.sedimentation import Sedimentation, sedimentation, standard_error
from mrjax.settle import settle
from mrjax.simulate import simulate
from mrjax.soften import softened
from mrjax.state import State, place
from mrjax.theory import terminal_velocity
from mrjax.timestep import time_step
from mrjax.trajectory import Trajectory
from mrjax.viewers import write_gsd, write_vtk

__version__ = version("mrjax")

__all__ = [
    "HEIGHTS",
    "Box",
    "Column",
    "Compression",
    "Contacts",
    "Fault",
    "InputError",
    "Parameters",
    "Recipe",
    "Run",
    "Sedimentation",
    "SimulationError",
    "State",
    "Touching",
    "Trajectory",
    "asymptotes",
    "bed_front",
    "column",
    "column_steps",
    "concentration",
    "contact_forces",
    "coordination_number",
    "disperse",
    "ensemble",
    "load_run",
    "mudline_descent",
    "normal_forces",
    "place",
    "reynolds_number",
    "save_run",
    "sedimentation",
    "sedimentation_ratio",
    "settle",
    "settling_velocity",
    "simulate",
    "softened",
    "standard_error",
    "terminal_velocity",
    "time_step",
    "write_gsd",
    "write_vtk",
]
