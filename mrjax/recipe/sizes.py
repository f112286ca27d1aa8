"""Size distributions of particles: a list of classes, log-normal, or three percentiles.

The N particles of a suspension have the diameters at the quantiles (i + 1/2)/N of the distribution
by number. They do not depend on the seed, and there are no outliers.
"""

import math
from dataclasses import MISSING, dataclass, fields
from typing import Any

import numpy as np

from mrjax.core.errors import InputError, shown, shown_key
from mrjax.recipe.percentiles import Percentiles
from mrjax.recipe.size_checks import is_positive, positive_list, refuse_basis, refuse_tiny

WIDEST = 3.0
"""Largest geometric standard deviation; beyond it, a few particles have all the volume."""


@dataclass(frozen=True)
class Classes:
    """A size distribution of discrete diameters.

    Args:
      values: diameters, m.
      fractions: fraction of each diameter, equal by default; normalised to the sum 1.
      by: basis of the fractions, "number" or "volume".

    Raises:
      InputError: `values` or `fractions` cannot be used.
    """

    values: tuple[float, ...]
    fractions: tuple[float, ...] | None = None
    by: str = "number"

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", positive_list("values", self.values, "diameters in m"))
        refuse_tiny("values", min(self.values))
        if self.fractions is not None:
            fractions = positive_list("fractions", self.fractions, "fractions")
            if len(fractions) != len(self.values):
                raise InputError(
                    f"fractions = {shown(list(fractions))}: {len(fractions)} for "
                    f"{len(self.values)} values; give one for each"
                )
            object.__setattr__(self, "fractions", fractions)
        refuse_basis(self.by)

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return self._mean_power(3)

    @property
    def settling_diameter(self) -> float:
        """Diameter of a particle with the mass-averaged Stokes velocity, m."""
        return math.sqrt(self._mean_power(5) / self._mean_power(3))

    def sample(self, particles: int) -> np.ndarray:
        """Returns the diameters of N particles at the quantiles, (N,) in m, ascending."""
        order = np.argsort(self.values)
        cumulative = np.cumsum(self._number_fractions()[order])
        quantiles = (np.arange(particles) + 0.5) / particles
        row = np.minimum(np.searchsorted(cumulative, quantiles), len(order) - 1)
        return np.array(self.values)[order][row]

    def by_volume(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns the diameters, (K,) in m, ascending, and their shares of the volume, (K,); 1."""
        order = np.argsort(self.values)
        values = np.array(self.values)[order]
        volumes = self._number_fractions()[order] * values**3
        return values, volumes / volumes.sum()

    def _mean_power(self, power: int) -> float:
        return float(self._number_fractions() @ np.array(self.values) ** power)

    def _number_fractions(self) -> np.ndarray:
        values = np.array(self.values)
        weights = np.ones(len(values)) if self.fractions is None else np.array(self.fractions)
        weights = weights / values**3 if self.by == "volume" else weights
        return weights / weights.sum()


@dataclass(frozen=True)
class LogNormal:
    """A log-normal distribution of diameters.

    Args:
      median: median diameter, m; half of the particles, or of their volume, is smaller.
      geometric_standard_deviation: s, above 1; 68 % lie within this factor of the median.
      by: basis of the median, "number" or "volume". They are converted by Hatch and Choate (1929):
        ln d_number = ln d_volume - 3 ln^2 s.

    Raises:
      InputError: a value is out of range.
    """

    median: float
    geometric_standard_deviation: float
    by: str = "number"

    def __post_init__(self) -> None:
        spread = self.geometric_standard_deviation
        if not is_positive(self.median):
            raise InputError(
                f"median = {shown(self.median)}: must be a diameter in m, above zero, at most 1e30"
            )
        refuse_tiny("median", self.median)
        if not is_positive(spread) or not 1 < spread <= WIDEST:
            raise InputError(
                f"geometric_standard_deviation = {shown(spread)}: must be above 1, at most "
                f"{WIDEST:g}; without spread, give the diameter alone"
            )
        refuse_basis(self.by)

    @property
    def number_median(self) -> float:
        """Median diameter by number, m."""
        shift = 3.0 * self._log_spread**2 if self.by == "volume" else 0.0
        return self.median * math.exp(-shift)

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return self.number_median**3 * math.exp(4.5 * self._log_spread**2)

    @property
    def settling_diameter(self) -> float:
        """Diameter of a particle with the mass-averaged Stokes velocity, m."""
        return self.number_median * math.exp(4.0 * self._log_spread**2)

    def sample(self, particles: int) -> np.ndarray:
        """Returns the diameters of N particles at the quantiles, (N,) in m, ascending."""
        from scipy.special import ndtri  # its import takes a fifth of a second

        quantiles = (np.arange(particles) + 0.5) / particles
        return self.number_median * np.exp(self._log_spread * ndtri(quantiles))

    def volume_quantiles(self, shares: np.ndarray) -> np.ndarray:
        """Returns the diameters below which these shares of the volume lie; m."""
        from scipy.special import ndtri

        median = self.number_median * math.exp(3.0 * self._log_spread**2)
        return median * np.exp(self._log_spread * ndtri(shares))

    @property
    def _log_spread(self) -> float:
        return math.log(self.geometric_standard_deviation)


Sizes = Classes | LogNormal | Percentiles


def parse(diameter: Any) -> Sizes:
    """Parses the `diameter` of a lab sheet: a list of diameters, or a table of a distribution.

    Raises:
      InputError: the value is neither, or the table has a fault.
    """
    if isinstance(diameter, Sizes):
        return diameter
    if isinstance(diameter, list | tuple):
        return Classes(tuple(diameter))
    if not isinstance(diameter, dict):
        raise InputError(
            f"values = {shown(diameter)}: must be a list of diameters in m; or give the "
            "diameter as a number, or a table"
        )
    kind = _kind(diameter)
    valid = [field.name for field in fields(kind)]
    for key in diameter:
        if key not in valid:
            raise InputError(
                f"{shown_key(key)} = {shown(diameter[key])}: unknown key; known: {', '.join(valid)}"
            )
    for field in fields(kind):
        if field.default is MISSING and field.name not in diameter:
            raise InputError(
                f"{field.name} is missing; give values, or median and "
                "geometric_standard_deviation, or d10, d50 and d90"
            )
    return kind(**diameter)


def _kind(table: dict) -> type[Classes] | type[LogNormal] | type[Percentiles]:
    """Returns the class of distribution that a table describes."""
    if "median" in table:
        return LogNormal
    return Percentiles if {"d10", "d50", "d90"} & set(table) else Classes
