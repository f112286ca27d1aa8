"""The TOML file of an experiment: its tables, and their checks."""

from collections import Counter
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from calibrate.experiment.free_parameters import ParameterSheet
from calibrate.experiment.readings.sheet import CurveSheet, LocalSheet, VelocitiesSheet
from calibrate.experiment.suspension import LARGEST_TILT
from calibrate.experiment.units import RATIO_UNITS, one_of
from calibrate.experiment.velocity_units import EXAMPLES, OF_VELOCITY
from mrjax.continuum.rotor import LEAST_RATIO
from mrjax.core.errors import shown
from mrjax.recipe.sheets import FileName, Name, Sheet

SAME_HEIGHT = 1e-3
"""Relative difference of a height from that between the radii of a rotor that is rounding."""
MOST = 1000
"""Samples, or parameters, of an experiment."""


class InitialVelocity(Sheet):
    """Rate at which the boundary of the suspension descends at first."""

    value: float = Field(gt=0, description="the measured velocity, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")
    unit: Annotated[str, OF_VELOCITY] = Field(
        description=f"a length over a time, such as {EXAMPLES}"
    )


class FinalRatio(Sheet):
    """Height of the bed at rest over that of the dispersed suspension."""

    value: float = Field(gt=0, description="the measured ratio, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")
    unit: Annotated[str, one_of(RATIO_UNITS)] = Field(default="1", description="1 or %")

    @model_validator(mode="after")
    def _a_ratio(self) -> Self:
        if self.value * RATIO_UNITS[self.unit] > 1.0:
            raise ValueError(
                f"final_ratio.value = {self.value:g}: must be at most 1, or 100 with unit = "
                '"%": a bed is no higher than its suspension'
            )
        return self


class ViscosityRatio(Sheet):
    """Rheometer: viscosity of the fluid with additives over that of the base fluid."""

    value: float = Field(gt=0, description="the measured ratio, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")


class CompressionSheet(Sheet):
    """The effective solid stress of a yielding bed; what is left out is fitted."""

    gel_fraction: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="the volume fraction from which particles form a network, between 0 and 1",
    )
    stress: float | None = Field(default=None, gt=0, description="its scale in Pa, above zero")
    exponent: float | None = Field(default=None, gt=0, description="its exponent, above zero")


class TubeSheet(Sheet):
    """The tube of a sample, if it leans."""

    tilt: float | None = Field(
        default=None,
        ge=0,
        le=LARGEST_TILT,
        description=f"its angle from the vertical in degrees, from 0 to {LARGEST_TILT:g}",
    )
    gap: float | None = Field(
        default=None,
        gt=0,
        description="the distance of its upper from its lower wall in m, above zero",
    )


class RotorSheet(Sheet):
    """The rotor of a centrifuge in which a sample settled."""

    speed: float = Field(gt=0, description="its speed in rpm, above zero")
    top_radius: float = Field(
        gt=0, description="distance of the top of the suspension from the axis in m, above zero"
    )
    floor_radius: float = Field(
        gt=0, description="distance of the floor of the tube from the axis in m, above zero"
    )
    shape: Literal["sector", "straight"] = Field(
        default="straight", description='of the tube: "sector", with radial walls, or "straight"'
    )

    @model_validator(mode="after")
    def _top_above_floor(self) -> Self:
        if not LEAST_RATIO * self.floor_radius <= self.top_radius < self.floor_radius:
            raise ValueError(
                f"rotor.top_radius = {self.top_radius:g}: must be below floor_radius, "
                f"{self.floor_radius:g}, and at least {LEAST_RATIO:g} of it"
            )
        return self


class SampleSheet(Sheet):
    """One suspension that was measured."""

    name: Name = Field(description="a name for the sample")
    recipe: FileName = Field(description="a bundled recipe's name, or a path from this file")
    height: float | None = Field(
        default=None, gt=0, description="that of the suspension in its tube in m, above zero"
    )
    tube_diameter: float | None = Field(
        default=None, gt=0, description="that of the inside in m, above zero, for readings in mL"
    )
    bed_fraction: float | Literal["particles"] | None = Field(
        default=None,
        description='the volume fraction of coated particles in the bed at rest, or "particles"',
    )
    compression: CompressionSheet | Literal["particles"] | None = Field(
        default=None,
        description='a table with gel_fraction, stress and exponent of a bed, or "particles"',
    )
    tube: TubeSheet | None = Field(
        default=None, description="a table with tilt and gap of a tube that leans"
    )
    rotor: RotorSheet | None = Field(
        default=None, description="a table with speed, top_radius, floor_radius and shape"
    )
    delay: float | None = Field(
        default=None, gt=0, description="the time scale of aggregation at the start in s, above 0"
    )
    mudline_threshold: float = Field(
        default=0.5,
        gt=0,
        lt=1,
        description="the share of the initial volume fraction at the mudline, between 0 and 1",
    )
    initial_velocity: InitialVelocity | None = Field(
        default=None, description="a table with value, standard_deviation and unit"
    )
    final_ratio: FinalRatio | None = Field(
        default=None, description="a table with value and standard_deviation"
    )
    curve: CurveSheet | None = Field(
        default=None, description="a table with file, and settings that it does not show"
    )
    velocities: VelocitiesSheet | None = Field(
        default=None, description="a table with file: velocities or fluxes by concentration"
    )
    concentration: list[LocalSheet] = Field(
        default=[],
        max_length=MOST,
        description="one [[sample.concentration]] for each, with file and height or time",
    )
    viscosity_ratio: ViscosityRatio | None = Field(
        default=None, description="a table with value and standard_deviation"
    )

    @model_validator(mode="after")
    def _height_between_radii(self) -> Self:
        if self.rotor is None:
            return self
        between = self.rotor.floor_radius - self.rotor.top_radius
        if self.height is not None and abs(self.height - between) > SAME_HEIGHT * between:
            raise ValueError(
                f"height = {self.height:g}: must be that between the radii of its rotor, "
                f"{between:g}, or left out"
            )
        return self

    @field_validator("bed_fraction")
    @classmethod
    def _a_fraction(cls, bed_fraction: float | str | None) -> float | str | None:
        if isinstance(bed_fraction, float) and not 0 < bed_fraction < 1:
            raise ValueError(f"bed_fraction = {bed_fraction:g}: must be between 0 and 1, about 0.6")
        return bed_fraction


class ExperimentSheet(Sheet):
    """A TOML file of samples and parameters."""

    name: Name = Field(description="a name for the experiment")
    sample: list[SampleSheet] = Field(
        min_length=1, max_length=MOST, description=f"one [[sample]] for each, at most {MOST}"
    )
    parameter: list[ParameterSheet] = Field(
        min_length=1, max_length=MOST, description=f"one [[parameter]] for each, at most {MOST}"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = [sample.name for sample in self.sample]
        for name, count in Counter(names).items():
            if count > 1:
                raise ValueError(
                    f"sample.name = {shown(name)}: given twice; give each its own name"
                )
        for sample in self.sample:
            measured = (
                sample.initial_velocity,
                sample.final_ratio,
                sample.curve,
                sample.velocities,
                sample.concentration,
                sample.viscosity_ratio,
            )
            if not any(measured):
                raise ValueError(
                    f"sample {shown(sample.name)}: nothing was measured; give it a table "
                    "initial_velocity, final_ratio, curve, velocities, concentration or "
                    "viscosity_ratio"
                )
        known, taken = set(names), set()
        for parameter in self.parameter:
            for name in parameter.samples or names:
                if name not in known:
                    raise ValueError(
                        f"parameter {shown(parameter.name)}: samples = {shown(name)}: no such "
                        f"sample; known: {', '.join(names)}"
                    )
                if (parameter.name, name) in taken:
                    raise ValueError(
                        f"parameter.name = {shown(parameter.name)}: given twice for sample "
                        f"{shown(name)}; keep one"
                    )
                taken.add((parameter.name, name))
        if all(parameter.value is not None for parameter in self.parameter):
            raise ValueError("every [[parameter]] is held at a value; give one a median to fit it")
        return self
