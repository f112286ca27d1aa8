"""Dates and clock times of cells.

`hh:mm` is hours and minutes. A date is read by the order of its numbers: year first, day first or
month first. A column that two orders can read is refused, unless `date_format` is stated.
"""

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import takewhile

from calibrate.experiment.readings.cells import Cell
from mrjax import InputError
from mrjax.core.errors import shown

_CLOCK = re.compile(
    r"(?P<sign>[-+]?)(?:(?P<days>[0-9]{1,6})\s*(?:d|days?|tage?)[\s,]+)?"
    r"(?P<hours>[0-9]{1,6}):(?P<minutes>[0-9]{1,2})(?::(?P<seconds>[0-9]{1,2}(?:[.,][0-9]+)?))?"
    r"(?:\s*(?P<half>[ap])\.?m\.?)?",
    re.IGNORECASE,
)
_DATE = re.compile(
    r"(?:[A-Za-z]{2,9}[.,]?\s+)?(?:[0-9]{4}\s*[-/.]\s*[0-9]{1,2}\s*[-/.]\s*[0-9]{1,2}|"
    r"[0-9]{1,2}\s*[-/.]\s*[0-9]{1,2}\s*[-/.]\s*(?:[0-9]{4}|[0-9]{2}))(?![0-9]).*|"
    r"[0-9]{1,2}[-.\s]+[A-Za-z]{3,9}[-.,\s]+[0-9]{2,4}.*|"
    r"[A-Za-z]{3,9}[-.\s]+[0-9]{1,2}(?:st|nd|rd|th)?[-,.\s]+[0-9]{4}.*"
)
ORDERS = {
    "year first": ("%Y-%m-%d",),
    "day first": ("%d-%m-%Y", "%d-%m-%y", "%d-%b-%Y", "%d-%B-%Y", "%d-%b-%y"),
    "month first": ("%m-%d-%Y", "%m-%d-%y", "%b-%d-%Y", "%B-%d-%Y"),
    "short year first": ("%y-%m-%d",),
}
"""Formats of dates by the order of their numbers, with `-` for any mark between them."""
TIMES = ("", " %H:%M", " %H:%M:%S", " %H:%M:%S.%f", " %I:%M %p", " %I:%M:%S %p")
"""Formats of the time of day behind a date."""
_DIRECTIVES = set("dmbBjyYHIMSfpzZaAT%")


def is_clock_or_date(text: str) -> bool:
    """True if a cell looks like a time of a clock or a date."""
    return bool(_CLOCK.fullmatch(text) or _DATE.fullmatch(text))


def is_clock(text: str) -> bool:
    """True if a cell looks like hours, minutes and perhaps seconds."""
    return _CLOCK.fullmatch(text) is not None


def is_date(text: str) -> bool:
    """True if a cell looks like a date, perhaps with the time of day."""
    return _DATE.fullmatch(text) is not None


def is_of_day(text: str) -> bool:
    """True if a clock time is a time of day, with AM or PM behind it."""
    match = _CLOCK.fullmatch(text)
    return match is not None and match["half"] is not None


def clock_seconds(cell: Cell, minutes_first: bool = False) -> float:
    """Seconds of `hh:mm` or `hh:mm:ss`, or of `mm:ss` where minutes are first.

    Raises:
      InputError: minutes or seconds of 60 or more.
    """
    match = _CLOCK.fullmatch(cell.text)
    if match is None:
        raise cell.refuse("is no time such as 1:30 or 01:30:00, as others are; mend the row")
    first, second = int(match["hours"]), int(match["minutes"])
    if match["half"]:
        first = first % 12 + (12 if match["half"] in "pP" else 0)
    third = float((match["seconds"] or "0").replace(",", "."))
    if second >= 60 or third >= 60:
        raise cell.refuse(
            "has 60 minutes or seconds or more; write hh:mm or hh:mm:ss, or numbers with a unit"
        )
    seconds = 60.0 * first + second if minutes_first else 3600.0 * first + 60.0 * second + third
    seconds += 86400.0 * int(match["days"] or 0)
    return -seconds if match["sign"] == "-" else seconds


def dates(cells: Sequence[Cell], stated: str | None) -> list[datetime]:
    """The dates of a column, (T,).

    Args:
      cells: cells of one column.
      stated: format for `strptime`, such as `%d/%m/%Y %H:%M`; None to find it.

    Raises:
      InputError: a cell that is no date, or can be read two ways.
    """
    if stated is not None:
        return [_date_in_format(cell, stated) for cell in cells]
    orders = _orders(cells)
    readable: dict[str, list[datetime]] = {}
    for order, formats in orders.items():
        parsed = takewhile(bool, (_parse(_plain(cell.text), formats) for cell in cells))
        values = [date for date in parsed if date is not None]
        if len(values) == len(cells):
            readable[order] = values
    if not readable:
        raise _order_error(cells, orders)
    first_order, *others = readable.items()
    for order, values in others:
        for cell, first, second in zip(cells, first_order[1], values, strict=True):
            if first != second:
                raise cell.refuse(
                    f"can be read {first_order[0]} ({first:%Y-%m-%d}) or {order} "
                    f"({second:%Y-%m-%d}); "
                    'state date_format, such as "%d/%m/%Y" or "%m/%d/%Y"'
                )
    return first_order[1]


def strptime_format(stated: str) -> str:
    """A stated format as `strptime` takes it: `%d.%m.%Y`, or with letters, `DD.MM.YYYY hh:mm`.

    Raises:
      InputError: a format without day or month, or with a directive that is not known.
    """
    pattern = stated
    if "%" not in stated:
        for letters, directive in (
            ("(?<=:)mm?", "%M"),
            ("yyyy", "%Y"),
            ("yy", "%y"),
            ("(?<!%)mmm", "%b"),
            ("(?<!%)mm?", "%m"),
            ("(?<!%)dd?", "%d"),
            ("hh?", "%H"),
            ("ss?", "%S"),
        ):
            pattern = re.sub(f"(?<!%){letters}", directive, pattern, flags=re.IGNORECASE)
    directives = set(re.findall("%(.?)", pattern))
    complete = (
        directives & {"d", "j"} and directives & {"m", "b", "B", "j"} and directives & {"y", "Y"}
    )
    if not complete or not directives <= _DIRECTIVES:
        raise InputError(
            f'date_format = {shown(stated)}: must have day, month and year, as "%d/%m/%Y" or '
            '"%d/%m/%Y %H:%M"'
        )
    return pattern


def _orders(cells: Sequence[Cell]) -> dict[str, list[str]]:
    """Formats, with those of the time of day, by the orders in which dates may be written."""
    short_years = all("-" in cell.text for cell in cells)
    return {
        order: [day + time for day in formats for time in TIMES]
        for order, formats in ORDERS.items()
        if order != "short year first" or short_years
    }


def _order_error(cells: Sequence[Cell], orders: dict[str, list[str]]) -> InputError:
    """The error of the first cell that no order can read, or that has another order."""
    for number in range(1, len(cells) + 1):
        plain = [_plain(cell.text) for cell in cells[:number]]
        if not any(all(_parse(text, formats) for text in plain) for formats in orders.values()):
            break
    return cells[number - 1].refuse(
        "is no date that exists, or not in the order of the others; write it as 2024-01-31 or "
        "2024-01-31 09:30"
    )


def _date_in_format(cell: Cell, pattern: str) -> datetime:
    """The date of a cell in a stated format, with or without a time of day behind it."""
    for text in (cell.text, cell.text.replace("T", " ")):
        for time in TIMES:
            try:
                return without_zone(datetime.strptime(text, pattern + time))
            except (ValueError, re.error):
                continue
    raise cell.refuse("is not as date_format says; mend the row or date_format")


def _plain(text: str) -> str:
    """A date with `-` between its numbers and one blank before the time of day."""
    text = re.sub(r"^(?:mon|tue|wed|thu|fri|sat|sun)[a-z]*[.,]?\s+", "", text, flags=re.IGNORECASE)
    text = re.sub(r"(?<=\d)(?:st|nd|rd|th)\b", "", text)
    if match := re.fullmatch(r"(\S+?)[T\s,]+(\d{1,2}:.*)", text) or re.fullmatch(
        r"(.*?\d)[T\s,]+(\d{1,2}:.*)", text
    ):
        day, time = match[1], match[2]
    else:
        day, time = text, ""
    day = re.sub(r"[-/.,\s]+", "-", day.strip())
    return f"{day} {re.sub(r'(?<=[0-9])(?=[AaPp])', ' ', time.replace(',', '.')).upper()}".strip()


def _parse(text: str, formats: list[str]) -> datetime | None:
    """A date in one of several formats; the one that fits moves to the front for the next cell."""
    zone = re.fullmatch(r"(.*:\d\d(?:\.\d+)?)\s*(Z|[+-]\d\d:?\d\d)", text)
    if zone is not None:
        text = zone[1]
    for place, pattern in enumerate(formats):
        try:
            date = datetime.strptime(text, pattern)
        except ValueError:
            continue
        formats.insert(0, formats.pop(place))
        return date - _offset(zone[2]) if zone else date
    return None


def _offset(zone: str) -> timedelta:
    """Offset of a zone such as +01:00 from universal time."""
    if zone == "Z":
        return timedelta(0)
    sign = -1 if zone[0] == "-" else 1
    digits = zone[1:].replace(":", "")
    return sign * timedelta(hours=int(digits[:2]), minutes=int(digits[2:]))


def without_zone(date: datetime) -> datetime:
    """A date in universal time where its zone is known, else as it is."""
    return date.replace(tzinfo=None) - (date.utcoffset() or timedelta(0))
