"""Measurements with their uncertainty, the recipe each belongs to, and what is to be fitted."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from pydantic import Field, field_validator, model_validator

from mrjax import InputError, Parameters, Recipe, sheets
from mrjax.sheets import Sheet

VELOCITY_UNITS = {
    "m/s": 1.0,
    "um/s": 1e-6,
    "mm/s": 1e-3,
    "mm/h": 1e-3 / 3600,
    "mm/day": 1e-3 / 86400,
}
"""SI value of one unit."""

FITTED = ("f_w", "f_s", "f_v")
"""Parameters that a log-normal prior fits: the corrections of Stokes' drag."""


class InitialVelocity(Sheet):
    """Rate at which the boundary of the suspension descends at first."""

    value: float = Field(gt=0, description="the measured velocity, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")
    unit: str = Field(description=f"one of {', '.join(VELOCITY_UNITS)}")

    @field_validator("unit")
    @classmethod
    def _known(cls, unit: str) -> str:
        if unit not in VELOCITY_UNITS:
            raise ValueError(f"unit = {unit!r}: must be one of {', '.join(VELOCITY_UNITS)}")
        return unit


class ViscosityRatio(Sheet):
    """Rheometer: viscosity of the fluid with additives over that of the base fluid."""

    value: float = Field(gt=0, description="the measured ratio, above zero")
    standard_deviation: float = Field(gt=0, description="its uncertainty, above zero")


class SampleSheet(Sheet):
    """One suspension that was measured."""

    name: str = Field(description="a name for the sample")
    recipe: str = Field(description="a bundled recipe's name, or a path from this file")
    initial_velocity: InitialVelocity | None = Field(
        default=None, description="a table with value, standard_deviation and unit"
    )
    viscosity_ratio: ViscosityRatio | None = Field(
        default=None, description="a table with value and standard_deviation"
    )


class ParameterSheet(Sheet):
    """A quantity to be fitted, with its log-normal prior."""

    name: str = Field(description=f"one of {', '.join(FITTED)}")
    median: float = Field(gt=0, description="the prior's median, above zero")
    log_standard_deviation: float = Field(
        gt=0, description="the standard deviation of its logarithm, above zero"
    )
    samples: list[str] | None = Field(default=None, description="names of samples, or leave out")
    per_sample: bool = Field(
        default=False, description="true for a value of its own for each sample"
    )

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in FITTED:
            raise ValueError(f"parameter.name = {name!r}: must be one of {', '.join(FITTED)}")
        return name


class ExperimentSheet(Sheet):
    """A TOML file of samples and parameters."""

    name: str = Field(description="a name for the experiment")
    sample: list[SampleSheet] = Field(min_length=1, description="one [[sample]] for each")
    parameter: list[ParameterSheet] = Field(min_length=1, description="one [[parameter]] for each")

    @model_validator(mode="after")
    def _consistent(self):
        names = [sample.name for sample in self.sample]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"sample.name = {name!r}: given twice; give each its own name")
        for sample in self.sample:
            if not (sample.initial_velocity or sample.viscosity_ratio):
                raise ValueError(
                    f"sample {sample.name!r}: nothing was measured; give it a table "
                    "initial_velocity or viscosity_ratio"
                )
        taken = set()
        for parameter in self.parameter:
            for sample in parameter.samples or names:
                if sample not in names:
                    raise ValueError(
                        f"parameter {parameter.name!r}: samples = {sample!r}: no such sample; "
                        f"known: {', '.join(names)}"
                    )
                if (parameter.name, sample) in taken:
                    raise ValueError(
                        f"parameter.name = {parameter.name!r}: given twice for sample {sample!r}; "
                        "keep one"
                    )
                taken.add((parameter.name, sample))
        return self


class Measurement(NamedTuple):
    """One number with its uncertainty, both in `unit`, which is `si` in SI."""

    observable: str
    value: float
    standard_deviation: float
    unit: str
    si: float


@dataclass(frozen=True)
class Sample:
    """One suspension that was measured."""

    name: str
    recipe: Recipe
    measurements: tuple[Measurement, ...]


@dataclass(frozen=True)
class FittedParameter:
    """A fitted quantity: its label, the parameter it sets, where, and its log-normal prior."""

    label: str
    name: str
    samples: tuple[str, ...]
    median: float
    log_standard_deviation: float


@dataclass(frozen=True)
class Experiment:
    """Samples, and the parameters that are fitted to them."""

    name: str
    samples: tuple[Sample, ...]
    parameters: tuple[FittedParameter, ...]

    @classmethod
    def load(cls, source: str | Path) -> "Experiment":
        """A bundled experiment by name (`fang2005`) or a TOML file by path.

        Raises:
          InputError: the file, a value in it, or a recipe it names cannot be used.
        """
        table, path = sheets.read(source, "calibrate.experiments", "experiment")
        sheet = sheets.validated(ExperimentSheet, table, str(source))
        return cls(
            sheet.name,
            tuple(_sample(sample, path.parent, str(source)) for sample in sheet.sample),
            tuple(
                fitted
                for parameter in sheet.parameter
                for fitted in _fitted(parameter, [sample.name for sample in sheet.sample])
            ),
        )

    def parameters_of(self, sample: Sample, theta: dict) -> Parameters:
        """The sample's parameters with the fitted values, by label, in their places."""
        return sample.recipe.parameters().replace(
            **{
                fitted.name: theta[fitted.label]
                for fitted in self.parameters
                if sample.name in fitted.samples
            }
        )


def _sample(sheet: SampleSheet, folder: Path, source: str) -> Sample:
    beside = folder / sheet.recipe
    try:
        recipe = Recipe.load(beside if beside.is_file() else sheet.recipe)
    except InputError as error:
        raise InputError(f"{source}: sample {sheet.name!r}: recipe {error}") from None
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
    if ratio := sheet.viscosity_ratio:
        measured.append(
            Measurement("viscosity_ratio", ratio.value, ratio.standard_deviation, "1", 1.0)
        )
    return Sample(sheet.name, recipe, tuple(measured))


def _fitted(sheet: ParameterSheet, names: list[str]) -> list[FittedParameter]:
    samples = tuple(sheet.samples or names)
    prior = (sheet.median, sheet.log_standard_deviation)
    if sheet.per_sample:
        return [
            FittedParameter(f"{sheet.name}[{sample}]", sheet.name, (sample,), *prior)
            for sample in samples
        ]
    return [FittedParameter(sheet.name, sheet.name, samples, *prior)]
