"""Times of a column: numbers with a unit, times of a clock, or dates."""

from collections.abc import Sequence
from datetime import date, datetime, time, timedelta
from typing import NamedTuple

from calibrate.experiment.readings import cells, dates
from calibrate.experiment.readings.cells import Cell
from calibrate.experiment.readings.headings import Heading
from calibrate.experiment.readings.sheet import TimesSheet
from calibrate.experiment.readings.vocabulary import HOURS_FIRST, MINUTES_FIRST
from calibrate.experiment.units import TIME, TIME_UNITS
from mrjax import InputError
from mrjax.core.errors import shown

DAY = 86400.0
NEEDS_A_UNIT = (
    'write the unit into the header, as in "time (min)", or give time_unit, one of '
    f"{', '.join(TIME_UNITS)}"
)


class Times(NamedTuple):
    """Times of readings, (T,)."""

    seconds: list[float]
    """Times from the start, s."""
    unit: str
    """Unit for reports."""
    form: str
    """Form in the file: `min`, `hh:mm:ss`, `dates`."""


def times(column: Sequence[Cell], head: Heading, sheet: TimesSheet, mark: str) -> Times:
    """The times of a column, none of them empty.

    Args:
      column: cells of the column.
      head: header of the column.
      sheet: settings of the file.
      mark: decimal mark.

    Raises:
      InputError: a cell is no time, there is no unit or two units, or a date can be read two ways.
    """
    first = column[0]
    if sheet.date_format is not None or dates.is_date(first.text):
        return _from_dates(column, head, sheet)
    if dates.is_clock(first.text):
        return _from_clock(column, head, sheet)
    return _from_numbers(column, head, sheet, mark)


def _from_numbers(column: Sequence[Cell], head: Heading, sheet: TimesSheet, mark: str) -> Times:
    if sheet.start is not None:
        raise column[0].refuse("is a number; start is for dates and times of the day, take it away")
    of_header = TIME.named(head.unit)
    if head.unit and of_header is None and head.explicit:
        raise column[0].refuse(
            f"is in {shown(head.unit)} by its header, which is no unit of time; {NEEDS_A_UNIT}"
        )
    unit = _agreed_unit(column[0], of_header, sheet.time_unit)
    seconds, units = [], {unit} - {None}
    for cell in column:
        number = cells.number(cell.text)
        if number is None:
            raise cells.not_a_number(cell)
        unit_of_cell = TIME.named(number.unit) if number.unit else unit
        if unit_of_cell is None and number.unit:
            raise cells.not_a_number(cell)
        if unit_of_cell is None:
            raise cell.refuse(f"has no unit; {NEEDS_A_UNIT}")
        if unit is not None and unit_of_cell != unit:
            raise cell.refuse(f"is in {unit_of_cell}, and its column in {unit}; mend one")
        value = cells.value(cell, number.written, mark)
        if value < 0.0:
            raise InputError(f"{cell.at}: {cell.name} = {value:g} is negative; mend the row")
        seconds.append(TIME_UNITS[unit_of_cell] * value)
        units.add(unit_of_cell)
    unit = (units.pop() if len(units) == 1 else None) or _unit_for_reports(seconds)
    return Times(seconds, unit, unit)


def _agreed_unit(first: Cell, of_header: str | None, stated: str | None) -> str | None:
    """The unit of the header or of the experiment file, which must not differ."""
    if of_header and stated and of_header != stated:
        raise InputError(
            f"{first.at}: the header gives the time in {of_header}, and time_unit = "
            f"{shown(stated)} is stated; mend the header, or take time_unit away"
        )
    return of_header or stated


def _from_clock(column: Sequence[Cell], head: Heading, sheet: TimesSheet) -> Times:
    minutes_first = head.unit in MINUTES_FIRST
    if head.unit and head.unit not in HOURS_FIRST | MINUTES_FIRST and TIME.named(head.unit) != "h":
        raise column[0].refuse(
            f"is hours and minutes, and its header says {shown(head.unit)}; write numbers in it, "
            "or hh:mm in the header"
        )
    seconds = [dates.clock_seconds(cell, minutes_first) for cell in column]
    for cell, elapsed, before in zip(column[1:], seconds[1:], seconds, strict=False):
        if elapsed < before - DAY / 2 and before < DAY:
            raise cell.refuse(
                "comes after a later time of day: past midnight give dates with the time, or "
                "elapsed times"
            )
    start = 0.0
    if sheet.start is not None:
        start = _clock_start(sheet.start, column[0])
    elif head.of_day or any(dates.is_of_day(cell.text) for cell in column):
        start = min(seconds)
    form = "mm:ss" if minutes_first else "hh:mm:ss" if column[0].text.count(":") > 1 else "hh:mm"
    seconds = _not_negative(column, [second - start for second in seconds])
    return Times(seconds, sheet.time_unit or _unit_for_reports(seconds), form)


def _from_dates(column: Sequence[Cell], head: Heading, sheet: TimesSheet) -> Times:
    if sheet.date_format is None:
        if head.unit and TIME.named(head.unit) not in (None, "day"):
            raise column[0].refuse(
                f"is a date, and its header says {shown(head.unit)}; mend the header, or write "
                "numbers"
            )
        for cell in column:
            if not dates.is_date(cell.text):
                raise cell.refuse("is no date, as the first is; mend the row")
    moments = dates.dates(column, sheet.date_format)
    start = min(moments) if sheet.start is None else _start(sheet.start, sheet, column[0])
    seconds = _not_negative(column, [(moment - start) / timedelta(seconds=1) for moment in moments])
    return Times(seconds, sheet.time_unit or _unit_for_reports(seconds), "dates")


def _unit_for_reports(seconds: list[float]) -> str:
    """The natural unit for times up to the last of these."""
    return next((unit for unit in ("day", "h", "min") if max(seconds) > 2 * TIME_UNITS[unit]), "s")


def _not_negative(column: Sequence[Cell], seconds: list[float]) -> list[float]:
    """Times from the start, none of them before it."""
    for cell, elapsed in zip(column, seconds, strict=True):
        if elapsed < 0.0:
            raise cell.refuse("is before the start; mend the row or start")
    return seconds


def _start(stated: str | datetime | date | time, sheet: TimesSheet, at: Cell) -> datetime:
    """The stated start of a column of dates."""
    match stated:
        case datetime():
            return dates.without_zone(stated)
        case date():
            return datetime(stated.year, stated.month, stated.day)
        case time():
            raise at.refuse(f"is a date, and start = {stated} has none; give the date, too")
    cell = at._replace(name="start", text=stated)
    if not dates.is_date(stated) and sheet.date_format is None:
        raise cell.refuse("is no date, as the times are; write it as 2024-01-31 09:30")
    return dates.dates([cell], sheet.date_format)[0]


def _clock_start(stated: str | datetime | date | time, at: Cell) -> float:
    """The stated start of a column of times of the day, s."""
    if isinstance(stated, time):
        return 3600.0 * stated.hour + 60.0 * stated.minute + stated.second
    if isinstance(stated, str) and dates.is_clock(stated):
        return dates.clock_seconds(at._replace(name="start", text=stated))
    raise at.refuse('is a time of day, and start is none; write it as "09:30"')
