"""Measurements with their uncertainty, the recipe each belongs to, and what is to be fitted."""

from collections import Counter, OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Self

from jax.typing import ArrayLike
from pydantic import Field, field_validator, model_validator

from calibrate.experiment import curve, plausibility
from calibrate.experiment.curve import CurveSheet
from calibrate.experiment.free_parameters import Fitted, ParameterSheet, fitted
from calibrate.experiment.suspension import BED, CLOSURE, Suspension, refuse_unknown, suspension
from calibrate.experiment.units import RATIO_UNITS, VELOCITY_UNITS, one_of
from mrjax import InputError, Recipe
from mrjax.core.errors import shown
from mrjax.io import reading
from mrjax.recipe import sheets
from mrjax.recipe.sheets import FileName, Name, Sheet

MOST = 1000
"""Samples, or parameters, of an experiment."""


class InitialVelocity(Sheet):
    """Rate at which the boundary of the suspension descends at first."""

    value: float = Field(gt=0, description="the measured velocity, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")
    unit: Annotated[str, one_of(VELOCITY_UNITS)] = Field(
        description=f"one of {', '.join(VELOCITY_UNITS)}"
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


class SampleSheet(Sheet):
    """One suspension that was measured."""

    name: Name = Field(description="a name for the sample")
    recipe: FileName = Field(description="a bundled recipe's name, or a path from this file")
    height: float | None = Field(
        default=None, gt=0, description="of the suspension in its tube in m, above zero"
    )
    bed_fraction: float | Literal["particles"] | None = Field(
        default=None,
        description='the volume fraction of coated particles in the bed at rest, or "particles"',
    )
    initial_velocity: InitialVelocity | None = Field(
        default=None, description="a table with value, standard_deviation and unit"
    )
    final_ratio: FinalRatio | None = Field(
        default=None, description="a table with value and standard_deviation"
    )
    curve: CurveSheet | None = Field(
        default=None, description="a table with file, time_unit, unit and standard_deviation"
    )
    viscosity_ratio: ViscosityRatio | None = Field(
        default=None, description="a table with value and standard_deviation"
    )

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
                sample.viscosity_ratio,
            )
            if not any(measured):
                raise ValueError(
                    f"sample {shown(sample.name)}: nothing was measured; give it a table "
                    "initial_velocity, final_ratio, curve or viscosity_ratio"
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


class Measurement(NamedTuple):
    """One number with its uncertainty, both in `unit`, which is `si` in SI."""

    observable: str
    """What was measured: `initial_velocity`, `final_ratio`, `viscosity_ratio`, or of a curve
    `mudline` or `sedimentation_ratio`."""
    value: float
    """In `unit`."""
    standard_deviation: float
    """Of the value, in `unit`."""
    unit: str
    """Its name, such as `mm/day`."""
    si: float
    """The unit in SI."""
    place: int | None = None
    """Which point of the sample's curve this is."""


@dataclass(frozen=True)
class Sample:
    """One suspension that was measured."""

    name: str
    """As the experiment has it."""
    recipe: Recipe
    """What the sample is made of."""
    height: float
    """Of the suspension when dispersed, m."""
    bed_fraction: float | Literal["particles"] | None
    """Of the coated particles in the bed at rest; "particles": as a simulated bed packs them."""
    measurements: tuple[Measurement, ...]
    """All that was measured on it."""
    times: tuple[float, ...] = ()
    """Of the points of its curve, (T,) in s."""


@dataclass(frozen=True)
class Experiment:
    """Samples, and the parameters that are fitted to them."""

    name: str
    """As its file has it."""
    samples: tuple[Sample, ...]
    """What was measured."""
    parameters: tuple[Fitted, ...]
    """What is fitted, in the order of the values of a fit."""
    held: tuple[tuple[str, str, float], ...] = ()
    """Sample, name and value of what the experiment holds at another value than the recipe."""
    warnings: tuple[str, ...] = ()
    """What is odd about the readings, and may be right all the same."""

    @classmethod
    def load(cls, source: str | Path) -> "Experiment":
        """A bundled experiment by name (`fang2005`) or a TOML file by path.

        Raises:
          InputError: the file, a value in it, a recipe or a curve it names cannot be used, or
            readings that cannot be true of their tube.

        Example:
          >>> experiment = calibrate.Experiment.load("fang2005")
          >>> [one.label for one in experiment.parameters]
          ['f_w', 'f_s', 'f_v', 'bed_fraction[A]', 'bed_fraction[B]']
        """
        table, path = sheets.read(source, "calibrate.experiment.bundled", "experiment")
        sheet = sheets.validated(ExperimentSheet, table, str(source))
        recipes: dict[Path, Recipe] = {}
        samples = tuple(
            _sample(sample, path.parent, str(source), recipes) for sample in sheet.sample
        )
        _refuse_a_file_twice(sheet, path.parent, str(source))
        warnings = tuple(_odd_readings(sheet, samples, str(source)))
        names = [sample.name for sample in samples]
        given = Counter(parameter.name for parameter in sheet.parameter)
        _refuse_parameters(sheet, samples, str(source))
        found = cls(
            sheet.name,
            samples,
            tuple(
                one
                for parameter in sheet.parameter
                if parameter.value is None
                for one in fitted(parameter, names, once=given[parameter.name] == 1)
            ),
            tuple(
                (name, parameter.name, parameter.value)
                for parameter in sheet.parameter
                if parameter.value is not None
                for name in parameter.samples or names
            ),
        )
        return replace(found, warnings=(*warnings, *plausibility.oddities(found)))

    @property
    def start(self) -> OrderedDict[str, float]:
        """The medians, by variable."""
        return OrderedDict((one.variable, one.start) for one in self.parameters)

    def varied(self, sample: Sample) -> tuple[str, ...]:
        """Names of what is fitted of a sample."""
        return tuple(one.name for one in self.parameters if sample.name in one.samples)

    def suspension_of(self, sample: Sample, theta: Mapping[str, ArrayLike]) -> Suspension:
        """The sample with the held and the fitted values in their places.

        Args:
          sample: one of the experiment's, or like one of them.
          theta: the fitted values, by variable.
        """
        held = {name: value for of, name, value in self.held if of == sample.name}
        changes = {
            one.name: one.value(theta[one.variable])
            for one in self.parameters
            if sample.name in one.samples
        }
        bed = None if sample.bed_fraction == "particles" else sample.bed_fraction
        return suspension(sample.recipe, bed, held | changes)


def _refuse_parameters(sheet: ExperimentSheet, samples: tuple["Sample", ...], source: str) -> None:
    """Passes where each sample has what is fitted of it, once."""
    of: dict[str, list[str]] = {sample.name: [] for sample in samples}
    for parameter in sheet.parameter:
        for name in parameter.samples or of:
            of[name].append(parameter.name)
    made = {id(sample.recipe): sample.recipe for sample in samples}
    leaves = {key: recipe.parameters() for key, recipe in made.items()}
    for sample in samples:
        for name in of[sample.name]:
            try:
                refuse_unknown(name, sample.recipe, leaves[id(sample.recipe)])
                _refuse_twice(name, sample, of[sample.name])
            except InputError as error:
                at = f"parameter.name = {shown(name)}: sample {shown(sample.name)}"
                raise InputError(f"{source}: {at}: {error}") from None


def _refuse_twice(name: str, sample: Sample, names: list[str]) -> None:
    """Passes where no other of the names, nor the sample itself, says the same."""
    if name == "f_w" and (clash := sorted(one for one in names if one.startswith(CLOSURE))):
        raise InputError(f"f_w follows from {clash[0]}; fit one of the two")
    if name == BED and sample.bed_fraction is not None:
        raise InputError(
            f"has bed_fraction = {sample.bed_fraction!r} of its own; take one of them away"
        )


def _refuse_a_file_twice(sheet: ExperimentSheet, folder: Path, source: str) -> None:
    """Passes where each sample has readings of its own: those that count twice seem better."""
    of: dict[Path, str] = {}
    for sample in sheet.sample:
        if sample.curve is None:
            continue
        path = (folder / sample.curve.file).resolve()
        if path in of:
            raise InputError(
                f"{source}: sample {sample.name!r}: curve.file = {sample.curve.file!r} is that of "
                f"sample {of[path]!r}, too, and its readings would count twice; give each its own"
            )
        of[path] = sample.name


def _odd_readings(
    sheet: ExperimentSheet, samples: tuple["Sample", ...], source: str
) -> Iterator[str]:
    """What is odd about the curve of each sample."""
    for one, sample in zip(sheet.sample, samples, strict=True):
        if one.curve is not None:
            try:
                said = plausibility.refuse_senseless(sample, one.curve.time_unit)
            except InputError as error:
                raise InputError(f"{source}: sample {sample.name!r}: {error}") from None
            yield from (f"sample {sample.name!r}: {odd}" for odd in said)


def _sample(sheet: SampleSheet, folder: Path, source: str, recipes: dict[Path, Recipe]) -> Sample:
    """A sample, with its recipe from those that were read already, or else put there."""
    beside = folder / sheet.recipe
    try:
        if beside not in recipes:
            read_from = beside if reading.is_file(beside) else sheet.recipe
            recipes[beside] = Recipe.load(read_from)
        recipe = recipes[beside]
    except InputError as error:
        raise InputError(f"{source}: sample {shown(sheet.name)}: recipe {error}") from None
    if recipe.apparent_density < recipe.fluid.density:
        raise InputError(
            f"{source}: sample {shown(sheet.name)}: its particles, at "
            f"{recipe.apparent_density:.5g} kg/m^3, are lighter than the fluid and rise; a fit "
            "reads mudlines that fall: give a heavier particle or a lighter fluid"
        )
    measured = []
    if velocity := sheet.initial_velocity:
        measured.append(
            Measurement(
                "initial_velocity",
                velocity.value,
                velocity.standard_deviation,
                velocity.unit,
                VELOCITY_UNITS[velocity.unit],
            )
        )
    if final := sheet.final_ratio:
        of = (final.value, final.standard_deviation, final.unit, RATIO_UNITS[final.unit])
        measured.append(Measurement("final_ratio", *of))
    times: tuple[float, ...] = ()
    if sheet.curve:
        if sheet.height is None:
            raise InputError(
                f"{source}: sample {shown(sheet.name)}: height is missing; give that of the "
                "suspension in its tube in m, which a curve needs"
            )
        read = curve.read(sheet.curve, folder)
        times = tuple(read.times)
        measured += [
            Measurement(read.observable, value, error, read.unit, read.si, place)
            for place, (value, error) in enumerate(zip(read.values, read.errors, strict=True))
        ]
    if ratio := sheet.viscosity_ratio:
        measured.append(
            Measurement("viscosity_ratio", ratio.value, ratio.standard_deviation, "1", 1.0)
        )
    return Sample(
        sheet.name,
        recipe,
        recipe.box.height if sheet.height is None else sheet.height,
        sheet.bed_fraction,
        tuple(measured),
        times,
    )
