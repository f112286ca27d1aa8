# Old names of modules, which `mrjax.core.aliases` keeps.
import mrjax.dem.forces as forces
import mrjax.dem.integrator as leapfrog
import mrjax.laws.closed_forms as theory
import mrjax.laws.dimensionless as validity
import mrjax.laws.effective as surfaces
import mrjax.laws.normal as contact
import mrjax.laws.tangential as friction
import mrjax.laws.time_scales as timestep

from . import figures as figures
from . import kernel as kernel
from . import laws as laws
from .continuum.clock import delayed_times as delayed_times
from .continuum.column import Column as Column
from .continuum.column import column as column
from .continuum.column import column_steps as column_steps
from .continuum.column_file import save_column as save_column
from .continuum.compression import Compression as Compression
from .continuum.rotor import Rotor as Rotor
from .continuum.sizes.column import PolydisperseColumn as PolydisperseColumn
from .continuum.sizes.column import polydisperse_column as polydisperse_column
from .continuum.tilt import Tilt as Tilt
from .core.box import Box as Box
from .core.errors import InputError as InputError
from .core.errors import SimulationError as SimulationError
from .core.errors import SystemRefusal as SystemRefusal
from .core.network import ContactNetwork as ContactNetwork
from .core.parameters import Parameters as Parameters
from .core.quantities import quantity as quantity
from .core.run import Fault as Fault
from .core.run import Run as Run
from .core.state import ContactHistory as ContactHistory
from .core.state import Contacts as Contacts
from .core.state import State as State
from .core.state import place as place
from .core.trajectory import Trajectory as Trajectory
from .core.units import MM_PER_DAY as MM_PER_DAY
from .dem.contact_history import Remembered as Remembered
from .dem.contact_list import ContactList as ContactList
from .dem.contact_list import Touching as Touching
from .dem.contact_list import contact_forces as contact_forces
from .dem.contact_list import coordination_number as coordination_number
from .dem.contact_list import normal_forces as normal_forces
from .dem.contact_network import contact_network as contact_network
from .dem.forces.brownian import Brownian as Brownian
from .dem.forces.contact import Contact as Contact
from .dem.forces.dipoles import Dipoles as Dipoles
from .dem.forces.force import BodyForce as BodyForce
from .dem.forces.force import Noise as Noise
from .dem.forces.force import PairForce as PairForce
from .dem.forces.force import Particles as Particles
from .dem.forces.force import Wrench as Wrench
from .dem.forces.gravity import Gravity as Gravity
from .dem.forces.van_der_waals import VanDerWaals as VanDerWaals
from .io.run_file import load_run as load_run
from .io.run_file import save_run as save_run
from .io.state_file import load_state as load_state
from .io.state_file import save_state as save_state
from .io.viewers import write_gsd as write_gsd
from .io.viewers import write_vtk as write_vtk
from .laws import drag as drag
from .laws import hindrance as hindrance
from .laws import particle as particle
from .laws import rolling as rolling
from .laws.attraction import bond_number as bond_number
from .laws.closed_forms import terminal_velocity as terminal_velocity
from .laws.dimensionless import reynolds_number as reynolds_number
from .laws.magnetism import dipolar_coupling as dipolar_coupling
from .laws.magnetism import magnetic_bond_number as magnetic_bond_number
from .laws.time_scales import time_step as time_step
from .observables.clusters import cluster_sizes as cluster_sizes
from .observables.concentration import bed_front as bed_front
from .observables.concentration import concentration as concentration
from .observables.coordination import Coordination as Coordination
from .observables.coordination import coordination as coordination
from .observables.fabric import fabric_tensor as fabric_tensor
from .observables.fabric import share_along as share_along
from .observables.interface import HEIGHTS as HEIGHTS
from .observables.interface import asymptotes as asymptotes
from .observables.interface import mudline_descent as mudline_descent
from .observables.interface import sedimentation_ratio as sedimentation_ratio
from .observables.interface import settling_velocity as settling_velocity
from .observables.packing import BedPacking as BedPacking
from .observables.packing import bed_packing as bed_packing
from .observables.stress import stress_tensor as stress_tensor
from .observables.stress import vertical_stress as vertical_stress
from .recipe.recipe import Recipe as Recipe
from .simulation.compressive_yield import CompressiveYield as CompressiveYield
from .simulation.compressive_yield import compressive_yield as compressive_yield
from .simulation.disperse import disperse as disperse
from .simulation.ensemble import ensemble as ensemble
from .simulation.follow import follow as follow
from .simulation.magnetised import magnetised as magnetised
from .simulation.options import RunOptions as RunOptions
from .simulation.sedimentation import Sedimentation as Sedimentation
from .simulation.sedimentation import sedimentation as sedimentation
from .simulation.sedimentation import standard_error as standard_error
from .simulation.settle import settle as settle
from .simulation.simulate import simulate as simulate
from .simulation.softening import softened as softened

__version__: str
