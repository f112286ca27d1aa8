"""Positions, velocities and spins of all particles at every recorded time of a run."""

from dataclasses import dataclass

import jax
from jax import Array

from mrjax.core.units import Units


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Trajectory:
    """Positions, velocities and spins of N particles at the recorded times of a run."""

    position: Array
    """Centres, (frames + 1, N, 3) in m; not wrapped on periodic axes (see `Box.wrap`)."""
    velocity: Array
    """Velocities, (frames + 1, N, 3) in m/s."""
    spin: Array
    """Angular velocity, (frames + 1, N, 3) in rad/s."""

    def in_lab_units(self, units: Units, sound: Array) -> "Trajectory":
        """Converts from reduced units to SI.

        Args:
          units: reduced units of the run.
          sound: 1, or NaN for a run with a fault, ().
        """
        return Trajectory(
            sound * units.length * self.position,
            sound * units.velocity * self.velocity,
            sound / units.time * self.spin,
        )
