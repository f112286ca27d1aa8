"""The table of a curve in an experiment file: the file, and what may be stated of it."""

from datetime import date, datetime, time
from typing import Annotated

from pydantic import Field, field_validator

from calibrate.experiment.readings.dates import strptime_format
from calibrate.experiment.units import READINGS, TIME, spelled
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


class CurveSheet(Sheet):
    """The table of a curve: its file, and what is not left to be found in it."""

    file: FileName = Field(description="a CSV or .xlsx file, as a path from this file")
    columns: ColumnsSheet = Field(
        default=ColumnsSheet(), description='a table such as {time = "t", mudline = "h"}'
    )
    delimiter: str | None = Field(default=None, description='",", ";", "\\t", "|" or " "')
    decimal: str | None = Field(default=None, description='"." or ","')
    encoding: str | None = Field(default=None, description="utf-8, utf-16 or latin-1")
    sheet: Name | Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="the name of a sheet of a workbook, or its number from 1"
    )
    time_unit: Annotated[str, spelled(TIME)] | None = Field(
        default=None, description=f"one of {', '.join(TIME.units)}"
    )
    unit: Annotated[str, spelled(READINGS)] | None = Field(
        default=None,
        description=f"of the readings, one of {', '.join(READINGS.units)}",
    )
    date_format: Name | None = Field(default=None, description='such as "%d/%m/%Y %H:%M"')
    start: Name | datetime | date | time | None = Field(
        default=None, description='when settling began, such as "2024-01-31 09:30" or "09:30"'
    )
    standard_deviation: float | None = Field(
        default=None,
        gt=0,
        description="the uncertainty of every point in this unit, above zero",
    )

    @field_validator("date_format")
    @classmethod
    def _a_format(cls, date_format: str | None) -> str | None:
        return None if date_format is None else strptime_format(date_format)

    @field_validator("decimal")
    @classmethod
    def _a_mark(cls, decimal: str | None) -> str | None:
        if decimal not in (None, ".", ","):
            raise ValueError(f'decimal = {decimal!r}: must be "." or ","')
        return decimal
