"""Size distributions of particles: a list of classes, log-normal, or three percentiles.

A suspension of N particles takes its diameters at the quantiles (i + 1/2)/N of the distribution by
number: the same ones whatever the seed, and no stray giant.
"""

import math
from dataclasses import MISSING, dataclass, fields
from typing import Any

import numpy as np

from mrjax.core.errors import InputError, shown, shown_key
from mrjax.recipe.percentiles import Percentiles
from mrjax.recipe.size_checks import is_positive, positive_list, refuse_basis, refuse_tiny

WIDEST = 3.0
"""Largest geometric standard deviation: beyond, a few particles hold all the volume."""


@dataclass(frozen=True)
class Classes:
    """Diameters and how much of each there is.

    Args:
      values: diameters, m.
      fractions: of each; left out, equal. They are made to sum to 1.
      by: "number" or "volume", which the fractions are of.

    Raises:
      InputError: values or fractions that cannot be used.
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
        """Root of the mean of d^2 by volume, m: its Stokes velocity is the mean by mass."""
        return math.sqrt(self._mean_power(5) / self._mean_power(3))

    def sample(self, particles: int) -> np.ndarray:
        """Diameters of that many particles, (N,) in m, ascending."""
        order = np.argsort(self.values)
        upto = np.cumsum(self._number_fractions()[order])
        quantiles = (np.arange(particles) + 0.5) / particles
        row = np.minimum(np.searchsorted(upto, quantiles), len(order) - 1)
        return np.array(self.values)[order][row]

    def _mean_power(self, power: int) -> float:
        return float(self._number_fractions() @ np.array(self.values) ** power)

    def _number_fractions(self) -> np.ndarray:
        values = np.array(self.values)
        shares = np.ones(len(values)) if self.fractions is None else np.array(self.fractions)
        shares = shares / values**3 if self.by == "volume" else shares
        return shares / shares.sum()


@dataclass(frozen=True)
class LogNormal:
    """A log-normal distribution of diameters.

    Args:
      median: m; half of the particles, or half of their volume, is smaller.
      geometric_standard_deviation: above 1; 68 % lie within this factor of the median.
      by: "number" or "volume", which the median is of. One is turned into the other by
        Hatch and Choate (1929): ln d_number = ln d_volume - 3 ln^2 s.

    Raises:
      InputError: a value out of range.
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
        """Diameter that half of the particles fall below, m."""
        shift = 3.0 * self._log_spread**2 if self.by == "volume" else 0.0
        return self.median * math.exp(-shift)

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return self.number_median**3 * math.exp(4.5 * self._log_spread**2)

    @property
    def settling_diameter(self) -> float:
        """Root of the mean of d^2 by volume, m: its Stokes velocity is the mean by mass."""
        return self.number_median * math.exp(4.0 * self._log_spread**2)

    def sample(self, particles: int) -> np.ndarray:
        """Diameters of that many particles, (N,) in m, ascending."""
        from scipy.special import ndtri  # a fifth of a second, for this alone

        quantiles = (np.arange(particles) + 0.5) / particles
        return self.number_median * np.exp(self._log_spread * ndtri(quantiles))

    @property
    def _log_spread(self) -> float:
        return math.log(self.geometric_standard_deviation)


Sizes = Classes | LogNormal | Percentiles


def parse(diameter: Any) -> Sizes:
    """Parses the `diameter` of a lab sheet: a list, or a table of a distribution.

    Raises:
      InputError: what it gives is none of these.
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
    known = [field.name for field in fields(kind)]
    for key in diameter:
        if key not in known:
            raise InputError(
                f"{shown_key(key)} = {shown(diameter[key])}: unknown key; known: {', '.join(known)}"
            )
    for field in fields(kind):
        if field.default is MISSING and field.name not in diameter:
            raise InputError(
                f"{field.name} is missing; give values, or median and "
                "geometric_standard_deviation, or d10, d50 and d90"
            )
    return kind(**diameter)


def _kind(table: dict) -> type[Classes] | type[LogNormal] | type[Percentiles]:
    """The distribution that a table describes."""
    if "median" in table:
        return LogNormal
    return Percentiles if {"d10", "d50", "d90"} & set(table) else Classes
