"""A measured suspension: its recipe, and numbers with their uncertainty."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from calibrate.experiment.readings.understood import Understood
from mrjax import Recipe


class Measurement(NamedTuple):
    """One number with its uncertainty, both in `unit`, which is `si` in SI."""

    observable: str
    """Observable: `initial_velocity`, `final_ratio`, `viscosity_ratio`, or of a curve
    `mudline` or `sedimentation_ratio`."""
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
    """How the file of its curve was read."""
