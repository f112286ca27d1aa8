"""The result of a simulation, and whether it is one."""

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
    """Why a run is not to be trusted."""

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
    Fault.ESCAPED: "a particle went through a wall, faster than its contact could turn it: give a "
    "smaller time_step",
    Fault.THROUGH_COATING: "two surfaces overlap by more than the thickness of the coating, where "
    "its modulus does not describe the contact: give a thicker or stiffer coating, or the "
    "modulus of the core",
    Fault.NOT_FINITE: "a position or velocity is not finite: check the parameters for zero or "
    "negative values, or give a smaller time_step",
}


def reasons(faults: Fault) -> str:
    """Why a run with these faults is not to be trusted, and what to change."""
    return "; and ".join(remedy for fault, remedy in REMEDIES.items() if fault in faults)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Run:
    """Observables along a run, and its last state.

    Where a fault was found inside a traced call, every number here is NaN; a plain call raises.
    """

    times: Array
    """From 0 to the duration, (frames + 1,) in s."""
    heights: Array
    """Height of the centre of every particle, (frames + 1, N) in m."""
    radius: Array
    """Radius of the coated particles, (N,) in m."""
    mean_velocity: Array
    """Mean velocity of all particles, downwards, (frames + 1,) in m/s."""
    mean_speed: Array
    """Mean of the particles' speeds, (frames + 1,) in m/s. Carries no derivative."""
    state: State
    """Positions, velocities, spins and the memory of contacts at the end."""
    deepest_overlap: Array
    """Deepest overlap in the run, as a fraction of the radius of one of the two, ()."""
    coating_overlap: Array
    """Deepest overlap as a fraction of the thickness of a coating, (); 0 without one. The law of a
    homogeneous sphere of the coating's material holds while it is much smaller than 1."""
    fault: Array
    """0, or the sum of every `Fault` that was met, ()."""
    box: Box = field(metadata={"static": True})
    """The container, which the dispersed suspension filled."""
    time_step: float = field(metadata={"static": True})
    """Length of a step, s."""
    steps: int = field(metadata={"static": True})
    """Number of steps."""
    trajectory: Trajectory | None = None
    """Every particle at every time, where `simulate` was asked for it."""
    rising: ArrayLike = False
    """True, (), if the net weights of all particles together point upwards: the suspension creams,
    with its clear layer below and its bed under the lid."""

    @property
    def mudline(self) -> Array:
        """Height of the interface to the clear layer, (frames + 1,) in m.

        The top of the highest particle; of particles that rise, the bottom of the lowest.
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
        """Passes where the run is good, and where it is traced and cannot be looked at.

        Raises:
          SimulationError: the run is not to be trusted; the message says why and what to change.
        """
        found = value_or_none(self.fault)
        if found is None or not found.any():
            return
        faults = Fault(int(found.flat[found.argmax()]))
        raise SimulationError(f"{reasons(faults)} ({self.steps} steps of {self.time_step:.3g} s)")


def from_bed(run: Run, level: Array) -> Array:
    """Levels as distances from where the bed grows: the floor, or the lid where particles rise.

    Its own inverse.

    Args:
      run: one, or several side by side.
      level: heights of one run, or with the leading axis of several; m.
    """
    rising = jnp.asarray(run.rising)
    rising = rising.reshape(rising.shape + (1,) * (level.ndim - rising.ndim))
    return jnp.where(rising, run.initial_height - level, level)
