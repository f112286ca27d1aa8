"""A size distribution given by three percentiles, as a laser granulometer prints them.

The cumulative volume is linear in ln d from d10 to d50 and from d50 to d90. Beyond d10 and d90 it
continues with the same slopes, from d0 = d10 (d10 / d50)^(1/4) to d100 = d90 (d90 / d50)^(1/4).
"""

import math
from dataclasses import dataclass

import numpy as np

from mrjax.core.errors import InputError, shown
from mrjax.recipe.size_checks import is_positive, refuse_tiny

SHARES = np.array([0.0, 0.1, 0.5, 0.9, 1.0])
"""Cumulative volume at the nodes d0, d10, d50, d90 and d100."""
WIDEST_RATIO = 1e3
"""Largest d90 / d10; the widest powders have a hundred."""


@dataclass(frozen=True)
class Percentiles:
    """Diameters below which 10, 50 and 90 % of the volume of the particles lie.

    Args:
      d10: diameter below which 10 % of the volume lies, m.
      d50: diameter below which 50 % of the volume lies, m.
      d90: diameter below which 90 % of the volume lies, m.

    Raises:
      InputError: a value is no diameter, or the three do not ascend.
    """

    d10: float
    d50: float
    d90: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not is_positive(value):
                raise InputError(
                    f"{name} = {shown(value)}: must be a diameter in m, above zero, at most 1e30"
                )
            refuse_tiny(name, value)
        if not self.d10 < self.d50 < self.d90:
            raise InputError(
                f"d10, d50, d90 = {self.d10:g}, {self.d50:g}, {self.d90:g}: must ascend; without "
                "spread, give the diameter alone"
            )
        if self.d90 > WIDEST_RATIO * self.d10:
            raise InputError(
                f"d90 = {self.d90:g}: more than {WIDEST_RATIO:g} times d10 = {self.d10:g}; give "
                "both in m"
            )

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return 1.0 / float(np.sum(self._moment_parts(-3)))

    @property
    def settling_diameter(self) -> float:
        """Diameter of a particle with the mass-averaged Stokes velocity, m."""
        return math.sqrt(float(np.sum(self._moment_parts(2))))

    def sample(self, particles: int) -> np.ndarray:
        """Returns the diameters of N particles at the quantiles, (N,) in m, ascending."""
        numbers, nodes = self._moment_parts(-3), self._nodes()
        cumulative = np.concatenate([[0.0], np.cumsum(numbers)])
        target = (np.arange(particles) + 0.5) / particles * cumulative[-1]
        row = np.clip(np.searchsorted(cumulative, target, side="right") - 1, 0, len(numbers) - 1)
        part = (target - cumulative[row]) / numbers[row]
        # If the volume below d is linear in ln d, the number below d is linear in d^-3.
        lower, upper = nodes[row] ** -3.0, nodes[row + 1] ** -3.0
        return (lower + part * (upper - lower)) ** (-1.0 / 3.0)

    def volume_quantiles(self, shares: np.ndarray) -> np.ndarray:
        """Returns the diameters below which these shares of the volume lie; m."""
        return np.exp(np.interp(shares, SHARES, np.log(self._nodes())))

    def _nodes(self) -> np.ndarray:
        """Returns d0, d10, d50, d90 and d100, (5,) in m."""
        least = self.d10 * (self.d10 / self.d50) ** 0.25
        largest = self.d90 * (self.d90 / self.d50) ** 0.25
        return np.array([least, self.d10, self.d50, self.d90, largest], float)

    def _moment_parts(self, power: int) -> np.ndarray:
        """Returns the part of each interval of nodes in the mean of d^k by volume, (4,) in m^k."""
        nodes = self._nodes()
        powers, logs = nodes ** float(power), np.log(nodes)
        return np.diff(SHARES) * np.diff(powers) / (power * np.diff(logs))
