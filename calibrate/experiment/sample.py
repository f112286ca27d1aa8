"""A measured suspension: its recipe, and numbers with their uncertainty."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from calibrate.experiment.readings import concentrations
from calibrate.experiment.readings.local_understood import LocalUnderstood
from calibrate.experiment.readings.understood import Understood
from calibrate.experiment.readings.velocity_understood import VelocitiesUnderstood
from mrjax import Recipe, Rotor

FEWEST_REPEATS = 3
"""Least degrees of freedom of repeats that give the scatter in place of the fit."""


class Concentration(NamedTuple):
    """The concentration at which a velocity was measured."""

    value: float
    """Value, as in its file."""
    kind: str
    """Kind of the concentration, one of `concentrations.KINDS`."""
    volume_fraction: float
    """Volume fraction of the uncoated particles; 1."""
    place: int
    """Index of its volume fraction among those of the sample."""

    @property
    def said(self) -> str:
        """The concentration in words, with its unit."""
        return concentrations.said(self.kind, self.value)


class Point(NamedTuple):
    """The height and time at which a concentration was measured."""

    height: float
    """Middle of the layer that it averages over, m above the floor."""
    time: float
    """Time from the start, s."""
    thickness: float
    """Thickness of that layer, which ends at the floor and at the top of the suspension; m."""
    place: int
    """Index among the points of the sample."""
    table: str
    """Name of its table."""
    height_unit: str
    """Unit of heights in reports."""
    time_unit: str
    """Unit of times in reports."""


class Scatter(NamedTuple):
    """The scatter of the readings of a file that states no errors."""

    value: float
    """Standard deviation of a reading: in its unit for a curve or a local concentration, over the
    predicted value for a velocity."""
    degrees_of_freedom: float
    """Number of readings less that of values fitted to them; 0 for an assumed scatter."""
    source: Literal["fit", "repeats", "assumed"]
    """Source of the value: residuals of the fit, repeats, or an assumption."""

    @property
    def standard_error(self) -> float:
        """Standard error of the value: s / sqrt(2 nu), that of a standard deviation."""
        if not self.degrees_of_freedom:
            return float("inf")
        return float(self.value / (2.0 * self.degrees_of_freedom) ** 0.5)


class Measurement(NamedTuple):
    """One measured number with its standard deviation."""

    observable: str
    """Observable: `initial_velocity`, `final_ratio`, `viscosity_ratio`, of a curve `mudline` or
    `sedimentation_ratio`, or at a height and time `volume_fraction`."""
    value: float
    """Measured value, in `unit`."""
    standard_deviation: float
    """Standard deviation of the value, in `unit`."""
    unit: str
    """Name of the unit, such as `mm/day`."""
    si: float
    """One unit in SI units."""
    place: int | None = None
    """Index of its time among those of the sample; None if it is of no curve."""
    row: int | None = None
    """Number of its row in the file."""
    concentration: Concentration | None = None
    """Concentration of a velocity of a table; None if measured on the sample as it is."""
    point: Point | None = None
    """Height and time of a local concentration; None for another measurement."""


class LocalTable(NamedTuple):
    """A table of local concentrations, as its file was read."""

    name: str
    """Name in its sample, such as `concentration at height 0.05 m`."""
    unit: str
    """Unit of its volume fractions: `1` or `%`."""
    understood: LocalUnderstood
    """Record of how its file was read."""
    scatter: Scatter | None
    """Scatter of its readings in their unit; None if errors are stated."""


@dataclass(frozen=True)
class Sample:
    """One suspension that was measured."""

    name: str
    """Name in the experiment."""
    recipe: Recipe
    """Recipe of the sample."""
    height: float
    """Height of the suspension when dispersed, m."""
    bed_fraction: float | Literal["particles"] | None
    """Volume fraction of the coated particles in the bed at rest.

    "particles" stands for that of a simulated bed. None if it is fitted, or not known.
    """
    measurements: tuple[Measurement, ...]
    """All measurements of the sample."""
    times: tuple[float, ...] = ()
    """Times of its curve, s, (T,), increasing; several readings may share one."""
    curve: Understood | None = None
    """Record of how the file of its curve was read."""
    fractions: tuple[float, ...] = ()
    """Volume fractions of uncoated particles at which velocities were measured, (K,)."""
    velocities: VelocitiesUnderstood | None = None
    """Record of how the file of its velocities was read."""
    scatter: Scatter | None = None
    """Relative scatter of those velocities; None if errors are stated."""
    curve_scatter: Scatter | None = None
    """Scatter of the curve in its unit; None if errors are stated."""
    points: tuple[Point, ...] = ()
    """Heights and times at which concentrations were measured, (Q,)."""
    concentrations: tuple[LocalTable, ...] = ()
    """Tables of those concentrations."""
    tube: Mapping[str, float] = field(default_factory=dict)
    """Stated values of quantities of its tube, by the names of `suspension.TUBE`."""
    mudline_threshold: float = 0.5
    """Share of the initial volume fraction that the suspension below the mudline exceeds, for
    particles of several sizes."""
    rotor: Rotor | None = None
    """Rotor of the centrifuge in which it settled; None under gravity."""
    gap: float | None = None
    """Distance of the upper from the lower wall of its tube, should that lean; m. None if it is not
    known."""

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
