"""Plan of a run, made before it starts: schedule, buffer sizes, and forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from jax import Array

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.run import Fault
from mrjax.core.state import State
from mrjax.core.units import Units
from mrjax.dem.forces import Contact, Force, active_forces, with_gravity_of
from mrjax.dem.neighbours import ListPlan
from mrjax.dem.schedule import Schedule
from mrjax.laws import yield_stress
from mrjax.laws.hindrance import Hindrance, as_tree, refuse_partial


class System(NamedTuple):
    """Particles, forces and container: the physical arguments of a run."""

    state: State
    parameters: Parameters
    hindrance: Hindrance | None
    box: Box
    forces: tuple[Force, ...]

    @staticmethod
    def of(
        state: State,
        parameters: Parameters,
        box: Box,
        hindrance: Hindrance | None = None,
        forces: Sequence[Force] | None = None,
    ) -> "System":
        """Builds a system from the arguments of a call.

        Args:
          state, parameters, box: state, parameters and container of the run.
          hindrance: function from the local volume fraction to f_w, or None.
          forces: list of forces; None for the bundled ones that act.

        Raises:
          InputError: an argument has the wrong type, the closure does not hold in the bed, or
            the fluid has a yield stress.
        """
        checks.require_run_inputs(state, parameters, box)
        refuse_partial(hindrance)
        yield_stress.refuse_particles(parameters)
        active = tuple(force.within(box) for force in active_forces(forces, parameters))
        return System(state, with_gravity_of(active, parameters), as_tree(hindrance), box, active)

    @property
    def particles(self) -> int:
        """Number of particles N."""
        return self.state.particles

    @property
    def in_contact(self) -> bool:
        """True if `Contact` is among the forces."""
        return any(isinstance(force, Contact) for force in self.forces)


class Matter(NamedTuple):
    """Parameters, materials, local drag and forces of a run, in reduced units."""

    parameters: Parameters
    material: Array | None
    hindrance: Hindrance | None
    forces: tuple[Force, ...]
    stretch: Array | None = None  # edges of the container over those of the box, (3,)


@dataclass(frozen=True)
class EngineSettings:
    """Static settings of the engine, which fix its compiled program; in reduced units."""

    box: Box
    neighbour_list: ListPlan
    steps: int  # number of steps in an interval
    reach: tuple[float, ...]  # reach of each pair force
    trajectory: bool  # True if positions, velocities and spins are recorded


@dataclass(frozen=True)
class RunPlan:
    """Plan of a run, which fixes its compiled program."""

    duration: float  # s
    unit_length: float  # largest contact radius, m
    neighbour_list: ListPlan
    schedule: Schedule
    reach: tuple[float, ...]  # reach of each pair force, m
    touch: bool  # True if surfaces may touch before the end
    trajectory: bool  # True if positions, velocities and spins are recorded
    nan_on_fault: bool = True  # True if a fault sets all numbers to NaN

    @property
    def time_step(self) -> float:
        """Length of a step, s."""
        return self.duration / self.schedule.total

    @property
    def frame_duration(self) -> float:
        """Time between two frames, s."""
        return self.duration / self.schedule.frames

    @property
    def units(self) -> Units:
        """Reduced units, with the largest contact radius as length and the step as time."""
        length = self.unit_length
        return Units(mass=1000.0 * length**3, length=length, time=self.time_step)

    def forces(self, system: System) -> tuple[Force, ...]:
        """Forces of a system, in SI, without contact history if no surfaces touch in this run."""
        return tuple(force if self.touch else force.apart() for force in system.forces)

    def settings(self, box: Box) -> EngineSettings:
        """Settings of the engine in reduced units, for a box in m."""
        return EngineSettings(
            box.scaled(1 / self.unit_length),
            self.neighbour_list,
            self.schedule.steps,
            tuple(reach / self.unit_length for reach in self.reach),
            self.trajectory,
        )

    def with_schedule(self, schedule: Schedule) -> "RunPlan":
        """Returns a plan with the same time step and another schedule."""
        return replace(self, duration=self.time_step * schedule.total, schedule=schedule)

    def with_larger_buffers(self, fault: int, particles: int) -> "RunPlan | None":
        """Returns a plan with larger buffers, or more frequent rebuilds, after a fault.

        Args:
          fault: bits of `Fault` of the failed run.
          particles: number of particles N.

        Returns:
          the plan; None if the fault cannot be repaired in this way.
        """
        if overflow := fault & (Fault.PAIRS_DROPPED | Fault.CELLS_OVERFULL):
            return replace(self, neighbour_list=self.neighbour_list.grown(overflow, particles))
        if fault == Fault.OUTRAN_LIST and self.schedule.steps > 1:
            return replace(self, schedule=self.schedule.rebuilt_more_often())
        return None
