"""The result of a simulation, with the faults that make it unusable."""

from dataclasses import dataclass, field
from enum import IntFlag

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.errors import SimulationError
from mrjax.core.state import State
from mrjax.core.tracing import value_or_none
from mrjax.core.trajectory import Trajectory


class Fault(IntFlag):
    """Reasons why the result of a run must not be used."""

    PAIRS_DROPPED = 1
    CELLS_OVERFULL = 2
    OUTRAN_LIST = 4
    UNSTABLE = 8
    TOO_DEEP = 16
    ESCAPED = 32
    NOT_FINITE = 64
    THROUGH_COATING = 128


REMEDIES = {
    Fault.PAIRS_DROPPED: "the neighbour list was too short for this packing: give a larger "
    "capacity",
    Fault.CELLS_OVERFULL: "the search cells were too small for this packing: give a larger "
    "cell_capacity",
    Fault.OUTRAN_LIST: "a particle travelled, or a radius grew, beyond the skin of the neighbour "
    "list: give a smaller rebuild_every or time_step, a wider skin, or a state with a larger "
    "contact_diameter",
    Fault.UNSTABLE: "the contacts became stiffer than the step can follow: give a smaller "
    "time_step",
    Fault.TOO_DEEP: "two surfaces overlap by more than a quarter of a radius, where the contact "
    "law does not hold: give a smaller time_step, a stiffer material, or a start without overlap",
    Fault.ESCAPED: "a particle went through a wall, faster than its contact could stop it: give a "
    "smaller time_step",
    Fault.THROUGH_COATING: "two surfaces overlap by more than the thickness of the coating, where "
    "its modulus does not describe the contact: give a thicker or stiffer coating, or the "
    "modulus of the core",
    Fault.NOT_FINITE: "a position or velocity is not finite: check the parameters for zero or "
    "negative values, or give a smaller time_step",
}


def reasons(faults: Fault) -> str:
    """Returns the reasons and remedies for these faults, as text."""
    return "; and ".join(remedy for fault, remedy in REMEDIES.items() if fault in faults)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Run:
    """Observables along a run, and its last state.

    A fault in a traced call makes every number here NaN; a fault in a plain call raises.
    """

    times: Array
    """Recorded times, from 0 to the duration, (frames + 1,) in s."""
    heights: Array
    """Heights of the centres of the particles, (frames + 1, N) in m."""
    radius: Array
    """Radius of the coated particles, (N,) in m."""
    mean_velocity: Array
    """Mean velocity of all particles, positive downwards, (frames + 1,) in m/s."""
    mean_speed: Array
    """Mean of the particles' speeds, (frames + 1,) in m/s. Carries no derivative."""
    state: State
    """Positions, velocities, spins and contact history at the end."""
    deepest_overlap: Array
    """Largest overlap in the run over the radius of the particle, ()."""
    coating_overlap: Array
    """Largest overlap in the run over the thickness of the coating, (); 0 without a coating. The
    contact law treats a particle as a homogeneous sphere of the coating's material, which holds
    while this ratio is much smaller than 1."""
    fault: Array
    """Sum of all faults (`Fault`) of the run, (); 0 for a good run."""
    box: Box = field(metadata={"static": True})
    """The container, which the dispersed suspension fills at the start."""
    time_step: float = field(metadata={"static": True})
    """Length of a step, s."""
    steps: int = field(metadata={"static": True})
    """Number of steps."""
    trajectory: Trajectory | None = None
    """Every particle at every recorded time, if `simulate` was called with `trajectory=True`."""
    rising: ArrayLike = False
    """True, (), if the sum of the net weights of all particles points upwards: the suspension
    creams, and has its clear layer at the floor and its bed under the lid."""

    @property
    def mudline(self) -> Array:
        """Height of the interface to the clear layer, (frames + 1,) in m.

        It is the top of the highest particle or, if the particles rise, the bottom of the lowest.
        """
        radius = self.radius[..., None, :]
        top = jnp.max(self.heights + radius, axis=-1)
        bottom = jnp.min(self.heights - radius, axis=-1)
        return jnp.where(jnp.asarray(self.rising)[..., None], bottom, top)

    @property
    def initial_height(self) -> float:
        """Height that the dispersed suspension fills, m."""
        return self.box.height

    def check(self) -> None:
        """Raises the fault of the run, if it has one; a traced run passes unchecked.

        Raises:
          SimulationError: the run has a fault; the message says why and what to change.
        """
        fault = value_or_none(self.fault)
        if fault is None or not fault.any():
            return
        faults = Fault(int(fault.flat[fault.argmax()]))
        raise SimulationError(f"{reasons(faults)} ({self.steps} steps of {self.time_step:.3g} s)")


def from_bed(run: Run, level: Array) -> Array:
    """Converts heights to distances from the end where the bed grows.

    The bed grows from the floor or, if the particles rise, from the lid. The function is its own
    inverse.

    Args:
      run: one run, or several along a leading axis.
      level: heights, m, with the same leading axis.
    """
    rising = jnp.asarray(run.rising)
    rising = rising.reshape(rising.shape + (1,) * (level.ndim - rising.ndim))
    return jnp.where(rising, run.initial_height - level, level)
