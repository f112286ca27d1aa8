"""A measured suspension: its recipe, and numbers with their uncertainty."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from calibrate.experiment.readings import concentrations
from calibrate.experiment.readings.local_understood import LocalUnderstood
from calibrate.experiment.readings.understood import Understood
from calibrate.experiment.readings.velocity_understood import VelocitiesUnderstood
from mrjax import Recipe

FEWEST_REPEATS = 3
"""Degrees of freedom of repeats from which on they give the scatter, and not the fit."""


class Concentration(NamedTuple):
    """The concentration at which a velocity was measured."""

    value: float
    """As its file has it."""
    kind: str
    """Kind of the concentration, one of `concentrations.KINDS`."""
    volume_fraction: float
    """Volume fraction of the uncoated particles; 1."""
    place: int
    """Place of its volume fraction among those of the sample."""

    @property
    def said(self) -> str:
        """In words, with its unit."""
        return concentrations.said(self.kind, self.value)


class Point(NamedTuple):
    """The height and time at which a concentration was measured."""

    height: float
    """Middle of the layer that it averages over, m from the floor."""
    time: float
    """From the start, s."""
    thickness: float
    """Thickness of that layer, which ends at the floor and at the top of the suspension; m."""
    place: int
    """Place among those of the sample."""
    table: str
    """Name of its table."""
    height_unit: str
    """Unit in which heights are told."""
    time_unit: str
    """Unit in which times are told."""


class Scatter(NamedTuple):
    """The scatter of the readings of a file that states no errors."""

    value: float
    """Standard deviation of a reading: of a curve or a local concentration in its unit, of a
    velocity over its predicted value."""
    degrees_of_freedom: float
    """Readings less what was fitted to them; 0 where nothing is left to tell it."""
    source: Literal["fit", "repeats", "assumed"]
    """Residuals of the fit, repeats at one time or concentration, or neither."""

    @property
    def standard_error(self) -> float:
        """Standard error of the value: s / sqrt(2 nu), that of a standard deviation."""
        if not self.degrees_of_freedom:
            return float("inf")
        return float(self.value / (2.0 * self.degrees_of_freedom) ** 0.5)


class Measurement(NamedTuple):
    """One number with its uncertainty, both in `unit`, which is `si` in SI."""

    observable: str
    """Observable: `initial_velocity`, `final_ratio`, `viscosity_ratio`, of a curve `mudline` or
    `sedimentation_ratio`, or at a height and time `volume_fraction`."""
    value: float
    """In `unit`."""
    standard_deviation: float
    """Standard deviation of the value, in `unit`."""
    unit: str
    """Its name, such as `mm/day`."""
    si: float
    """The unit in SI."""
    place: int | None = None
    """Place of its time among those of the sample; None of what is no curve."""
    row: int | None = None
    """Row of its file."""
    concentration: Concentration | None = None
    """Concentration of a velocity of a table; None of what was measured on the sample as it is."""
    point: Point | None = None
    """Height and time of a local concentration; None of another measurement."""


class LocalTable(NamedTuple):
    """A table of local concentrations, as its file was read."""

    name: str
    """Such as `concentration at height 0.05 m`, of one table of its sample."""
    unit: str
    """Unit of its volume fractions: `1` or `%`."""
    understood: LocalUnderstood
    scatter: Scatter | None
    """Scatter of its readings in their unit; None where errors are stated."""


@dataclass(frozen=True)
class Sample:
    """One suspension that was measured."""

    name: str
    """As the experiment has it."""
    recipe: Recipe
    """Recipe of the sample."""
    height: float
    """Height of the suspension when dispersed, m."""
    bed_fraction: float | Literal["particles"] | None
    """Volume fraction of the coated particles in the bed at rest.

    "particles": as a simulated bed packs them.
    """
    measurements: tuple[Measurement, ...]
    """All that was measured on it."""
    times: tuple[float, ...] = ()
    """Times of its curve, increasing, (T,) in s; several readings may be of one."""
    curve: Understood | None = None
    """Record of how the file of its curve was read."""
    fractions: tuple[float, ...] = ()
    """Volume fractions of uncoated particles at which velocities were measured, (K,)."""
    velocities: VelocitiesUnderstood | None = None
    """Record of how the file of its velocities was read."""
    scatter: Scatter | None = None
    """Relative scatter of those velocities where no error is stated."""
    curve_scatter: Scatter | None = None
    """Scatter of the curve where no error is stated, in its unit."""
    points: tuple[Point, ...] = ()
    """Heights and times at which concentrations were measured, (Q,)."""
    concentrations: tuple[LocalTable, ...] = ()
    """Tables of those concentrations."""

    @property
    def readings_of_curve(self) -> tuple[Measurement, ...]:
        """The readings of its curve."""
        return tuple(
            measurement for measurement in self.measurements if measurement.place is not None
        )

    @property
    def time_unit(self) -> str:
        """Unit of time of the file of its curve; s without one."""
        return self.curve.time_unit if self.curve else "s"

    @property
    def scatters(self) -> tuple[Scatter, ...]:
        """The scatter of each file without stated errors."""
        scatters = (
            self.scatter,
            self.curve_scatter,
            *(table.scatter for table in self.concentrations),
        )
        return tuple(scatter for scatter in scatters if scatter is not None)

    @property
    def scatter_to_fit(self) -> bool:
        """True if the scatter of the readings of a file is estimated with the fit."""
        return any(scatter.source != "repeats" for scatter in self.scatters)
