"""The plan of a run, decided before it: its schedule, its buffers and its laws."""

from dataclasses import dataclass, replace
from typing import NamedTuple

from jax import Array

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.run import Fault
from mrjax.core.state import State
from mrjax.core.units import Units
from mrjax.dem.forces import ActiveLaws
from mrjax.dem.neighbours import ListPlan
from mrjax.dem.schedule import Schedule
from mrjax.laws.hindrance import Hindrance


class System(NamedTuple):
    """Particles, their laws and their container: the arguments of every run."""

    state: State
    parameters: Parameters
    hindrance: Hindrance | None
    box: Box

    @property
    def particles(self) -> int:
        """N."""
        return self.state.particles


class Matter(NamedTuple):
    """Parameters, materials and local drag of a run, in reduced units."""

    parameters: Parameters
    material: Array | None
    hindrance: Hindrance | None


@dataclass(frozen=True)
class EngineSettings:
    """Static settings of the engine, which fix its compiled program; in reduced units."""

    box: Box
    neighbour_list: ListPlan
    steps: int  # in an interval
    laws: ActiveLaws
    trajectory: bool  # whether positions, velocities and spins are observed


@dataclass(frozen=True)
class RunPlan:
    """The plan of a run; it fixes the compiled program."""

    duration: float  # s
    unit_length: float  # largest contact radius, m
    neighbour_list: ListPlan
    schedule: Schedule
    laws: ActiveLaws
    trajectory: bool
    nan_on_fault: bool = True  # whether a fault makes all numbers NaN

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
        """The largest contact radius as unit of length, the step as unit of time."""
        length = self.unit_length
        return Units(mass=1000.0 * length**3, length=length, time=self.time_step)

    def settings(self, box: Box) -> EngineSettings:
        """Settings of the engine, for a box in m."""
        return EngineSettings(
            box.scaled(1 / self.unit_length),
            self.neighbour_list,
            self.schedule.steps,
            self.laws,
            self.trajectory,
        )

    def with_schedule(self, schedule: Schedule) -> "RunPlan":
        """The same steps for as long as another schedule lasts."""
        return replace(self, duration=self.time_step * schedule.total, schedule=schedule)

    def with_larger_buffers(self, fault: int, particles: int) -> "RunPlan | None":
        """A plan with more room, or more rebuilds, where a run failed for want of it.

        None for other faults.
        """
        if overflow := fault & (Fault.PAIRS_DROPPED | Fault.CELLS_OVERFULL):
            return replace(self, neighbour_list=self.neighbour_list.grown(overflow, particles))
        if fault == Fault.OUTRAN_LIST and self.schedule.steps > 1:
            return replace(self, schedule=self.schedule.rebuilt_more_often())
        return None
