"""Positions, velocities and spins of all particles at every recorded time of a run."""

from dataclasses import dataclass

import jax
from jax import Array

from mrjax.core.units import Units


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Trajectory:
    """N particles at the times of a run."""

    position: Array
    """Centres, (frames + 1, N, 3) in m. On periodic axes they run on past the box (`Box.wrap`)."""
    velocity: Array
    """(frames + 1, N, 3) in m/s."""
    spin: Array
    """Angular velocity, (frames + 1, N, 3) in rad/s."""

    def in_lab_units(self, units: Units, sound: Array) -> "Trajectory":
        """Reduced units to SI.

        Args:
          units: of the run.
          sound: 1, or not a number for a run that is not to be trusted, ().
        """
        return Trajectory(
            sound * units.length * self.position,
            sound * units.velocity * self.velocity,
            sound / units.time * self.spin,
        )
