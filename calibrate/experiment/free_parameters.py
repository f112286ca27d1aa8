"""A quantity that is fitted: its samples, its bounds and its prior.

The fit works with positive numbers x and their logarithms. A positive quantity without bounds is
its own x. A quantity between bounds a and b has the odds x = (value - a) / (b - value).
"""

from dataclasses import dataclass
from typing import Self

from jax import Array
from jax.typing import ArrayLike
from pydantic import Field, model_validator

from calibrate.experiment.suspension import BED, COMPRESSION
from calibrate.least_squares.priors import LogNormal
from mrjax.core.errors import shown
from mrjax.recipe.sheets import Name, Sheet

GEL = COMPRESSION[0]


class PriorSheet(Sheet):
    """A quantity to be fitted, with its prior, or to be held at a value."""

    name: Name = Field(
        description="a leaf of mrjax.Parameters such as f_s, a coefficient of the closure such as "
        "f_w.exponent, bed_fraction, compression.stress or another of the tube"
    )
    value: float | None = Field(
        default=None, gt=0, description="the value it is held at, above zero"
    )
    median: float | None = Field(default=None, gt=0, description="the prior's median, above zero")
    start: float | None = Field(
        default=None, gt=0, description="where the search begins, above zero, or leave out"
    )
    log_standard_deviation: float | None = Field(
        default=None, gt=0, description="the standard deviation of its logarithm, above zero"
    )
    bounds: list[float] | None = Field(default=None, description="[lower, upper], or leave out")
    standard_deviation: float | None = Field(
        default=None, gt=0, description="that of the prior between bounds, above zero"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        at = f"parameter {shown(self.name)}"
        if (self.value is None) == (self.median is None):
            raise ValueError(f"{at}: give either median, that of the prior, or value, to hold it")
        fitted = (self.bounds, self.log_standard_deviation, self.standard_deviation, self.start)
        if self.value is not None and any(value is not None for value in fitted):
            raise ValueError(
                f"{at}: value = {self.value:g} holds it; leave out prior, bounds and start"
            )
        if self.bounds is None or self.median is None:
            if self.standard_deviation is not None:
                raise ValueError(
                    f"{at}: standard_deviation = {self.standard_deviation:g} is for a parameter "
                    "with bounds; give log_standard_deviation"
                )
            return self
        if self.log_standard_deviation is not None:
            raise ValueError(
                f"{at}: log_standard_deviation = {self.log_standard_deviation:g} is for a "
                "parameter without bounds; give standard_deviation"
            )
        if len(self.bounds) != 2 or not self.bounds[0] < self.median < self.bounds[1]:
            raise ValueError(
                f"{at}: bounds = {shown(self.bounds)}: must be [lower, upper] on either side of "
                f"the median, {self.median:g}"
            )
        if self.start is not None and not self.bounds[0] < self.start < self.bounds[1]:
            raise ValueError(
                f"{at}: start = {self.start:g}: must be between its bounds, {self.bounds[0]:g} and "
                f"{self.bounds[1]:g}"
            )
        return self


class ParameterSheet(PriorSheet):
    """A quantity of samples to be fitted, or held at a value."""

    samples: list[Name] | None = Field(
        default=None, min_length=1, description="names of samples, or leave out"
    )
    per_sample: bool = Field(
        default=False, description="true for a value of its own for each sample"
    )

    @model_validator(mode="after")
    def _a_fraction(self) -> Self:
        stated = (self.value, self.median, self.start, *(self.bounds or ()))
        ends = [value for value in stated if value is not None]
        if self.name in (BED, GEL) and not all(0 <= value <= 1 for value in ends):
            raise ValueError(
                f"parameter {shown(self.name)}: {max(ends, key=abs):g} is no volume fraction; give "
                "values between 0 and 1, such as 0.6"
            )
        return self


@dataclass(frozen=True)
class FreeParameter:
    """A fitted quantity: its name, its samples, its bounds and its prior.

    The median belongs to the prior, `begin` to the search: they need not agree.
    """

    label: str
    """Name in reports, with the samples if other parameters have the same name."""
    name: str
    """Name of the quantity in the suspension."""
    samples: tuple[str, ...]
    """Names of the samples that share the value."""
    median: float
    """Median of the prior; without a prior, the default start."""
    log_standard_deviation: float | None
    """Standard deviation of the prior of ln x; None without a prior."""
    bounds: tuple[float, float] | None = None
    """Lower and upper bound; None for any positive value."""
    begin: float | None = None
    """Start of the search; None for the median."""

    @property
    def variable(self) -> str:
        """Name of x, the variable of the fit."""
        return f"odds({self.label})" if self.bounds else self.label

    @property
    def start(self) -> float:
        """Start of the search, as x."""
        return self._to_variable(self.median if self.begin is None else self.begin)

    @property
    def middle(self) -> float:
        """The x of the median."""
        return self._to_variable(self.median)

    def _to_variable(self, value: float) -> float:
        if not self.bounds:
            return value
        lower, upper = self.bounds
        return (value - lower) / (upper - value)

    @property
    def prior(self) -> LogNormal | None:
        """The prior of x; None without one."""
        if self.log_standard_deviation is None:
            return None
        return LogNormal(self.middle, self.log_standard_deviation)

    def value(self, x: ArrayLike) -> Array:
        """The value of the quantity whose variable is x."""
        if not self.bounds:
            return x
        lower, upper = self.bounds
        return lower + (upper - lower) * x / (1.0 + x)

    def per_log(self, x: ArrayLike) -> Array:
        """Derivative of the quantity with respect to ln x."""
        if not self.bounds:
            return x
        lower, upper = self.bounds
        return (upper - lower) * x / (1.0 + x) ** 2


def free_parameters(
    sheet: ParameterSheet, names: list[str], once: bool = True
) -> list[FreeParameter]:
    """The free parameters of a sheet: one for all of its samples, or one for each.

    Args:
      sheet: sheet with a median.
      names: names of all samples.
      once: True if no other sheet has its name; else the label includes its samples.
    """
    samples = tuple(sheet.samples or names)
    if not sheet.per_sample:
        label = sheet.name if once else f"{sheet.name}[{', '.join(samples)}]"
        return [free_parameter(sheet, label, samples)]
    return [free_parameter(sheet, f"{sheet.name}[{sample}]", (sample,)) for sample in samples]


def free_parameter(sheet: PriorSheet, label: str, samples: tuple[str, ...] = ()) -> FreeParameter:
    """The free parameter of a sheet with a median."""
    if sheet.median is None:
        raise ValueError(f"{sheet.name} is held at {sheet.value}: there is nothing to fit")
    median, spread, bounds = sheet.median, sheet.log_standard_deviation, None
    if sheet.bounds:
        lower, upper = bounds = (sheet.bounds[0], sheet.bounds[1])
        if sheet.standard_deviation is not None:
            # d ln x = d value (b - a) / ((value - a) (b - value))
            left, right = median - lower, upper - median
            spread = sheet.standard_deviation * (upper - lower) / (left * right)
    return FreeParameter(label, sheet.name, samples, median, spread, bounds, sheet.start)


Fitted, fitted = FreeParameter, free_parameters
"""Their names of before."""
