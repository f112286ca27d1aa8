"""Size distributions of particles: a list of classes, or log-normal; by number or by volume.

A suspension of N particles takes its diameters at the quantiles (i + 1/2)/N of the distribution by
number: the same ones whatever the seed, and no stray giant.
"""

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from mrjax.core.errors import InputError, shown, shown_key

LEAST_DIAMETER = 1e-10
"""Diameter of an atom, m: what is smaller was given in another unit."""
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
        object.__setattr__(self, "values", _positive_list("values", self.values, "diameters in m"))
        refuse_tiny("values", min(self.values))
        if self.fractions is not None:
            fractions = _positive_list("fractions", self.fractions, "fractions")
            if len(fractions) != len(self.values):
                raise InputError(
                    f"fractions = {shown(list(fractions))}: {len(fractions)} for "
                    f"{len(self.values)} values; give one for each"
                )
            object.__setattr__(self, "fractions", fractions)
        _basis(self.by)

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return float(self._number_fractions() @ np.array(self.values) ** 3)

    def sample(self, particles: int) -> np.ndarray:
        """Diameters of that many particles, (N,) in m, ascending."""
        order = np.argsort(self.values)
        upto = np.cumsum(self._number_fractions()[order])
        quantiles = (np.arange(particles) + 0.5) / particles
        row = np.minimum(np.searchsorted(upto, quantiles), len(order) - 1)
        return np.array(self.values)[order][row]

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
        if not _is_positive(self.median):
            raise InputError(
                f"median = {shown(self.median)}: must be a diameter in m, above zero, at most 1e30"
            )
        refuse_tiny("median", self.median)
        if not _is_positive(spread) or not 1 < spread <= WIDEST:
            raise InputError(
                f"geometric_standard_deviation = {shown(spread)}: must be above 1, at most "
                f"{WIDEST:g}; without spread, give the diameter alone"
            )
        _basis(self.by)

    @property
    def number_median(self) -> float:
        """Diameter that half of the particles fall below, m."""
        shift = 3.0 * self._log_spread**2 if self.by == "volume" else 0.0
        return self.median * math.exp(-shift)

    @property
    def mean_cube(self) -> float:
        """Mean of d^3 over the particles, m^3."""
        return self.number_median**3 * math.exp(4.5 * self._log_spread**2)

    def sample(self, particles: int) -> np.ndarray:
        """Diameters of that many particles, (N,) in m, ascending."""
        from scipy.special import ndtri  # a fifth of a second, for this alone

        quantiles = (np.arange(particles) + 0.5) / particles
        return self.number_median * np.exp(self._log_spread * ndtri(quantiles))

    @property
    def _log_spread(self) -> float:
        return math.log(self.geometric_standard_deviation)


Sizes = Classes | LogNormal


def parse(diameter: Any) -> Sizes:
    """Parses the `diameter` of a lab sheet: a list, or a table of a distribution.

    Raises:
      InputError: what it gives is none of these.
    """
    if isinstance(diameter, Classes | LogNormal):
        return diameter
    if isinstance(diameter, list | tuple):
        return Classes(tuple(diameter))
    if not isinstance(diameter, dict):
        raise InputError(
            f"values = {shown(diameter)}: must be a list of diameters in m; or give the "
            "diameter as a number, or a table"
        )
    kind = LogNormal if "median" in diameter else Classes
    known = list(kind.__dataclass_fields__)
    for key in diameter:
        if key not in known:
            raise InputError(
                f"{shown_key(key)} = {shown(diameter[key])}: unknown key; known: {', '.join(known)}"
            )
    needed = ("median", "geometric_standard_deviation") if kind is LogNormal else ("values",)
    for key in needed:
        if key not in diameter:
            raise InputError(
                f"{key} is missing; give values, or median and geometric_standard_deviation"
            )
    return kind(**diameter)


def refuse_tiny(key: str, diameter: float) -> None:
    """Passes a diameter in m that a particle may have.

    Raises:
      InputError: it is smaller than an atom.
    """
    if diameter < LEAST_DIAMETER:
        raise InputError(f"{key} = {diameter:g}: smaller than an atom; give m: 4 um is 4e-6")


def _is_positive(value: Any) -> bool:
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and 1e-30 <= value <= 1e30  # what follows from others is not finite


def _positive_list(name: str, values: Any, what: str) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or not values or not all(map(_is_positive, values)):
        given = list(values) if isinstance(values, tuple) else values
        raise InputError(
            f"{name} = {shown(given)}: must be a list of {what}, all above zero, at most 1e30"
        )
    return tuple(float(value) for value in values)


def _basis(by: Any) -> None:
    if by not in ("number", "volume"):
        raise InputError(f'by = {shown(by)}: must be "number" or "volume"')
