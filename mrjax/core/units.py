"""Reduced units of one run: SI in the public functions, numbers of order one in the kernel.

The laws hold in any coherent system of units, so the same functions serve both.
"""

from dataclasses import dataclass

MM_PER_DAY = 86400e3
"""1 m/s in mm/day."""


@dataclass(frozen=True)
class Units:
    """Reduced units, each given by its value in SI.

    The values are plain floats, so that conversion factors are computed in double precision in runs
    of any dtype: in single precision 1/d**8 of a micrometre particle is already infinite.
    """

    mass: float  # kg
    length: float  # m
    time: float  # s

    def scale(self, dimension: tuple[int, int, int]) -> float:
        """Returns the SI value of one reduced unit of kg^a m^b s^c, for dimension (a, b, c)."""
        mass, length, time = dimension
        return self.mass**mass * self.length**length * self.time**time

    @property
    def velocity(self) -> float:
        """One reduced unit of velocity, m/s."""
        return self.length / self.time


SI = Units(mass=1.0, length=1.0, time=1.0)
"""No reduction."""


def time_in_words(seconds: float) -> str:
    """Returns a duration as text, with its unit."""
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{seconds:.2g} s"
