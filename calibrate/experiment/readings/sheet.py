"""Files of readings in an experiment file, and their settings."""

from datetime import date, datetime, time
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from calibrate.experiment.readings.concentrations import KINDS, OF_CONCENTRATION
from calibrate.experiment.readings.dates import strptime_format
from calibrate.experiment.units import LEVEL, READINGS, TIME, spelled
from calibrate.experiment.velocity_units import EXAMPLES, OF_VELOCITY
from mrjax.recipe.sheets import FileName, Name, Sheet

Column = Name | Annotated[int, Field(ge=1)]
"""A column by its name in the header, or its number from 1."""


class ColumnsSheet(Sheet):
    """Columns of a file by what they hold: names in its header, or numbers from 1."""

    time: Column | None = Field(default=None, description="the column of times")
    mudline: Column | list[Column] | None = Field(
        default=None, description="the column of the mudline, or a list of repeats"
    )
    sedimentation_ratio: Column | list[Column] | None = Field(
        default=None, description="the column of the ratio, or a list of repeats"
    )
    supernatant: Column | list[Column] | None = Field(
        default=None, description="the column of the clear layer, or a list of repeats"
    )
    standard_deviation: Column | None = Field(
        default=None, description="the column of the errors of readings"
    )


class FileSheet(Sheet):
    """A file of readings, with the settings that all kinds of files share."""

    file: FileName = Field(description="a CSV or .xlsx file, as a path from this file")
    delimiter: str | None = Field(default=None, description='",", ";", "\\t", "|" or " "')
    decimal: str | None = Field(default=None, description='"." or ","')
    encoding: str | None = Field(default=None, description="utf-8, utf-16 or latin-1")
    sheet: Name | Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="the name of a sheet of a workbook, or its number from 1"
    )

    @field_validator("decimal")
    @classmethod
    def _a_mark(cls, decimal: str | None) -> str | None:
        if decimal not in (None, ".", ","):
            raise ValueError(f'decimal = {decimal!r}: must be "." or ","')
        return decimal


class TimesSheet(FileSheet):
    """A file of readings at times, with the settings of times."""

    time_unit: Annotated[str, spelled(TIME)] | None = Field(
        default=None, description=f"one of {', '.join(TIME.units)}"
    )
    date_format: Name | None = Field(default=None, description='such as "%d/%m/%Y %H:%M"')
    start: Name | datetime | date | time | None = Field(
        default=None, description='when settling began, such as "2024-01-31 09:30" or "09:30"'
    )

    @field_validator("date_format")
    @classmethod
    def _a_format(cls, date_format: str | None) -> str | None:
        return None if date_format is None else strptime_format(date_format)


class CurveSheet(TimesSheet):
    """The table of a curve: its file and settings."""

    columns: ColumnsSheet = Field(
        default=ColumnsSheet(), description='a table such as {time = "t", mudline = "h"}'
    )
    unit: Annotated[str, spelled(READINGS)] | None = Field(
        default=None,
        description=f"that of the readings, one of {', '.join(READINGS.units)}",
    )
    standard_deviation: float | None = Field(
        default=None,
        gt=0,
        description="the uncertainty of every point in this unit, above zero",
    )


class VelocityColumnsSheet(Sheet):
    """Columns of a table of velocities by what they hold: names in its header, or numbers."""

    concentration: Column | None = Field(default=None, description="the column of concentrations")
    velocity: Column | list[Column] | None = Field(
        default=None, description="the column of velocities, or a list of repeats"
    )
    flux: Column | list[Column] | None = Field(
        default=None, description="the column of fluxes, or a list of repeats"
    )
    standard_deviation: Column | None = Field(
        default=None, description="the column of the errors of readings"
    )


class VelocitiesSheet(FileSheet):
    """A table of velocities or fluxes against concentration: its file and settings."""

    columns: VelocityColumnsSheet = Field(
        default=VelocityColumnsSheet(),
        description='a table such as {concentration = "phi", velocity = "v"}',
    )
    concentration: Annotated[str, OF_CONCENTRATION] | None = Field(
        default=None, description=f"what the concentrations are: {', '.join(KINDS)}"
    )
    quantity: Literal["velocity", "flux"] | None = Field(
        default=None, description='"velocity", or "flux" for velocity times volume fraction'
    )
    unit: Annotated[str, OF_VELOCITY] | None = Field(
        default=None, description=f"that of the readings, a length over a time, such as {EXAMPLES}"
    )
    standard_deviation: float | None = Field(
        default=None, gt=0, description="the uncertainty of every reading in this unit, above zero"
    )
    relative_standard_deviation: float | None = Field(
        default=None, gt=0, lt=1, description="that of every reading as a share of it, 0 to 1"
    )

    @model_validator(mode="after")
    def _one_quantity(self) -> Self:
        stated = {self.quantity} - {None}
        stated |= {key for key in ("velocity", "flux") if getattr(self.columns, key) is not None}
        if len(stated) > 1:
            raise ValueError("columns or quantity name both velocity and flux: keep one")
        return self

    @model_validator(mode="after")
    def _one_error(self) -> Self:
        if None not in (self.standard_deviation, self.relative_standard_deviation):
            raise ValueError(
                f"standard_deviation = {self.standard_deviation:g} and "
                f"relative_standard_deviation = {self.relative_standard_deviation:g}: keep one"
            )
        return self


class LocalColumnsSheet(Sheet):
    """Columns of a table of local concentrations: names in its header, or numbers."""

    time: Column | None = Field(default=None, description="the column of times")
    height: Column | None = Field(default=None, description="the column of heights")
    concentration: Column | list[Column] | None = Field(
        default=None, description="the column of concentrations, or a list of repeats"
    )
    standard_deviation: Column | None = Field(
        default=None, description="the column of the errors of readings"
    )


class LocalSheet(TimesSheet):
    """A table of concentrations, at one height against time, or at one time against height."""

    height: float | None = Field(
        default=None,
        ge=0,
        description="the height of the readings above the floor in m, for a file of times",
    )
    time: float | None = Field(
        default=None,
        ge=0,
        description="the time of the profile, in time_unit or s, for a file of heights",
    )
    thickness: float | None = Field(
        default=None,
        gt=0,
        description="the thickness of the layer that a reading averages over, in m",
    )
    columns: LocalColumnsSheet = Field(
        default=LocalColumnsSheet(),
        description='a table such as {time = "t", concentration = "c"}',
    )
    concentration: Annotated[str, OF_CONCENTRATION] | None = Field(
        default=None, description=f"what the concentrations are: {', '.join(KINDS)}"
    )
    height_unit: Annotated[str, spelled(LEVEL)] | None = Field(
        default=None, description=f"that of the file's heights, one of {', '.join(LEVEL.units)}"
    )
    standard_deviation: float | None = Field(
        default=None, gt=0, description="the uncertainty of every reading in its unit, above zero"
    )

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.height is None) == (self.time is None):
            stated = "both are given" if self.height is not None else "neither is given"
            raise ValueError(
                f"height or time: {stated}; give height in m for a file of times, or time for one "
                "of heights"
            )
        if self.height is None:
            unused = [key for key in ("date_format", "start") if getattr(self, key) is not None]
            unused += ["columns.time"] if self.columns.time is not None else []
        else:
            unused = ["height_unit"] if self.height_unit is not None else []
            unused += ["columns.height"] if self.columns.height is not None else []
        if unused:
            stated = "time" if self.height is None else "height"
            raise ValueError(f"{unused[0]}: is not used where {stated} is stated; keep one")
        return self
