"""The columns of a file: those of times, readings and errors, and those that are not read."""

from typing import Literal, NamedTuple, get_args

from calibrate.experiment.readings import headings, vocabulary
from calibrate.experiment.readings.headings import OF_READINGS, Heading, Role, heading
from calibrate.experiment.readings.rows import is_numbers
from calibrate.experiment.readings.sheet import ColumnsSheet
from calibrate.experiment.readings.table import Row, Table
from calibrate.experiment.units import READINGS, TIME
from mrjax import InputError
from mrjax.core.errors import shown, shown_key

LOOKED_AT = 50
"""Number of rows in which the header is searched."""
STATED = "state columns, such as columns = {time = 1, mudline = 2}"


class Column(NamedTuple):
    """A column that is read."""

    place: int
    """Index of the column, from 0."""
    heading: Heading
    role: Role | Literal["height", "concentration", "other"]

    @property
    def named(self) -> str:
        """Its name in messages and records."""
        return self.heading.written or f"column {self.place + 1}"


class Layout(NamedTuple):
    """Columns of a table by what they hold, and the rows of readings."""

    time: Column
    date: Column | None
    """Column of the date or the day number, if the time of day has a column of its own."""
    readings: list[Column]
    """Columns of the mudline: one, or several repeats."""
    errors: list[Column]
    """Columns of errors: none, one for all readings, or one for each repeat."""
    others: list[Column]
    """Columns that are not read."""
    width: int
    """Number of columns."""
    rows: list[Row]
    """Rows below the header."""


def layout(
    table: Table, stated: ColumnsSheet, time_unit: str | None = None, unit: str | None = None
) -> Layout:
    """The columns of a table, from its header or as stated.

    Args:
      table: rows of the file.
      stated: columns that the experiment file states.
      time_unit, unit: stated units, which distinguish columns of one name.

    Raises:
      InputError: a header without time or mudline, or that names two of them.
    """
    row, rows = _header(table, stated)
    width = max((line.width for line in ([row] if row else rows[:1])), default=0)
    units = rows[0] if row and rows and _is_units(rows[0]) else None
    if units:
        rows = rows[1:]
    heads = [_heading(row, units, place) for place in range(width)]
    at = table.at(row or (table.rows[0] if table.rows else Row(1, [])))
    chosen = {role: _stated_columns(role, stated, heads, at) for role in get_args(Role)}
    if row is None and not any(chosen.values()):
        if width != 2:
            raise InputError(_no_header(table, at, width))
        chosen |= {"time": [Column(0, heads[0], "time")]}
        chosen |= {"mudline": [Column(1, heads[1], "mudline")]}
    columns = [
        Column(place, head, head.kind[0])
        for place, head in enumerate(heads)
        if head.kind is not None
    ]
    time, date = time_columns(chosen["time"], columns, time_unit, at)
    readings = [column for role in OF_READINGS for column in chosen[role]] or _readings(
        columns, unit, at
    )
    if time is None or not readings:
        raise InputError(_missing_column(heads, at, row is None))
    errors = chosen["standard_deviation"]
    errors = errors or [column for column in columns if column.role == "standard_deviation"]
    if len(errors) not in (0, 1, len(readings)):
        raise InputError(
            f"{at}: has {len(errors)} columns of errors for {len(readings)} of readings; give one "
            "for all, or one for each"
        )
    used = [column.place for column in (time, date, *readings, *errors) if column is not None]
    if len(set(used)) < len(used):
        raise InputError(
            f"{at}: columns names one column twice, for time, mudline or errors; mend it"
        )
    others = [
        Column(place, head, "other")
        for place, head in enumerate(heads)
        if place not in used and (head.written or row is None)
    ]
    return Layout(time, date, readings, errors, others, width, rows)


def refuse_several_samples(table: Table, others: list[Column], rows: list[Row]) -> None:
    """Refuses rows of several suspensions, as a column of sample names shows.

    Args:
      table: table of the rows.
      others: columns that are not read.
      rows: rows below the header.

    Raises:
      InputError: two names in one column.
    """
    for column in others:
        if not column.heading.words & vocabulary.SAMPLE:
            continue
        first = ""
        for row in rows:
            name = row.cell(column.place)
            if first and name and name != first:
                raise InputError(
                    f"{table.at(row)}: {shown_key(column.named)} = {shown(name)} comes after "
                    f"{shown(first)}; give each sample a file, a sheet or columns of its own"
                )
            first = first or name


def _header(table: Table, stated: ColumnsSheet) -> tuple[Row | None, list[Row]]:
    """The header, which may be the last comment, and the rows below it."""
    names = _all_stated_names(stated)
    for place, row in enumerate(table.rows[:LOOKED_AT]):
        if is_numbers(row) and not (names and _accepts(row, stated, names)):
            comment = table.last_comment
            alike = place == 0 and comment is not None and comment.width == row.width
            if alike and comment and _accepts(comment, stated, names):
                return comment, table.rows
            return (table.rows[place - 1] if place else None), table.rows[place:]
        if _accepts(row, stated, names):
            return row, table.rows[place + 1 :]
    if not table.rows:
        return None, []
    return table.rows[0], table.rows[1:]


def _accepts(row: Row, stated: ColumnsSheet, names: list[str]) -> bool:
    """True if a row has the stated names, and names a time and a mudline that are not stated."""
    heads = [heading(cell) for cell in row.cells]
    if not all(any(_is_named(head, name) for head in heads) for name in names):
        return False
    roles = {head.kind[0] for head in heads if head.kind is not None}
    time = stated.time is not None or "time" in roles
    reading = any(getattr(stated, role) is not None for role in OF_READINGS)
    return time and (reading or bool(roles & set(OF_READINGS))) and bool(names or roles)


def _heading(row: Row | None, units: Row | None, place: int) -> Heading:
    """The heading of a column, with the unit of the row below the header."""
    head = heading(row.cell(place)) if row else Heading("", "", "", False)
    unit = headings.unit_of_cell(units.cell(place)) if units else ""
    return head._replace(unit=unit, explicit=True) if unit and not head.unit else head


def _is_units(row: Row) -> bool:
    return all(map(headings.is_unit_cell, row.cells)) and not is_numbers(row)


def _stated_names(stated: ColumnsSheet, role: Role) -> list[str | int]:
    columns = getattr(stated, role)
    if columns is None:
        return []
    return columns if isinstance(columns, list) else [columns]


def _all_stated_names(stated: ColumnsSheet) -> list[str]:
    roles: tuple[Role, ...] = get_args(Role)
    return [name for role in roles for name in _stated_names(stated, role) if isinstance(name, str)]


def _is_named(head: Heading, name: str) -> bool:
    """True if a header's cell is a stated name, whole or without its unit, in any case."""
    plain = heading(name)
    whole = " ".join(name.casefold().split())
    return whole == head.written.casefold() or bool(
        plain.name and plain.name == head.name and (not plain.unit or plain.unit == head.unit)
    )


def _stated_columns(
    role: Role, stated: ColumnsSheet, heads: list[Heading], at: str
) -> list[Column]:
    """The columns that the experiment file states for a role."""
    places = stated_places(
        role, _stated_names(stated, role), heads, at, several=role in OF_READINGS
    )
    return [Column(place, heads[place], _role(role, heads[place])) for place in places]


def stated_places(
    role: str, stated: list[str | int], heads: list[Heading], at: str, several: bool
) -> list[int]:
    """Indices of the columns of a header that are stated by name or number.

    Args:
      role: key of `columns` that states them.
      stated: names, or numbers from 1.
      heads: the header.
      at: place of the header, for messages.
      several: True if several columns may have one name.

    Raises:
      InputError: no such column, or more than one.
    """
    found_places: list[int] = []
    for column in stated:
        if isinstance(column, int):
            places = [column - 1] if column <= len(heads) else []
        else:
            exact = [place for place, head in enumerate(heads) if head.written == column]
            places = exact or [place for place, head in enumerate(heads) if _is_named(head, column)]
        if not places or (len(places) > 1 and not several):
            count = "no column" if not places else f"{len(places)} columns"
            raise InputError(
                f"{at}: columns.{role} = {shown(column)}: it has {count} of that name; give a "
                f"name or number of the header, which is {_header_text(heads)}"
            )
        found_places += places
    return found_places


def _role(role: Role, head: Heading) -> Role:
    """The role of a column that is stated as the mudline: its header may say the clear layer."""
    kind = head.kind
    return kind[0] if role == "mudline" and kind and kind[0] in OF_READINGS else role


def time_columns(
    stated: list[Column], columns: list[Column], time_unit: str | None, at: str
) -> tuple[Column | None, Column | None]:
    """The column of times, and that of dates if the time of day has a column of its own.

    Args:
      stated: columns that are stated to be times.
      columns: all other columns.
      time_unit: stated unit, which distinguishes times in several units.
      at: place of the header, for messages.

    Raises:
      InputError: several columns may be the time.
    """
    times = stated or [column for column in columns if column.role == "time"]
    if len(times) < 2:
        return (times[0] if times else None), None
    dates = [column for column in times if _is_day(column.heading)]
    clocks = [column for column in times if column not in dates and not column.heading.of_dates]
    if len(dates) == 1 and len(clocks) == 1 and not clocks[0].heading.unit:
        return clocks[0], dates[0]
    in_unit = [
        column for column in times if time_unit and TIME.named(column.heading.unit) == time_unit
    ]
    rank = min(column.heading.kind[1] for column in times if column.heading.kind)
    best = [column for column in times if column.heading.kind and column.heading.kind[1] == rank]
    if len(in_unit) == 1:
        return in_unit[0], None
    if len(best) > 1 and len({column.heading.unit for column in best}) < len(best):
        raise InputError(
            f"{at}: {in_words(best)} may be the time; state columns = {{time = "
            f"{shown(best[0].named)}}}"
        )
    return best[0], None


def _is_day(head: Heading) -> bool:
    """True for a header that says date or day, and nothing else."""
    day = not head.name and TIME.named(head.unit) == "day"
    return day or (head.of_dates and not head.words - vocabulary.DATE)


def _readings(columns: list[Column], unit: str | None, at: str) -> list[Column]:
    """The columns of the mudline: those with the plainest name, which they must share.

    If readings are given in several units, those in the stated unit are taken, or in the first.
    """
    candidates = [column for column in columns if column.role in OF_READINGS]
    rank = min((column.heading.kind[1] for column in candidates if column.heading.kind), default=0)
    best = [
        column for column in candidates if column.heading.kind and column.heading.kind[1] == rank
    ]
    named = [column for column in best if column.heading.name == best[0].heading.name]
    in_unit = [column for column in named if READINGS.named(column.heading.unit) == unit] or [
        column for column in named if column.heading.unit == named[0].heading.unit
    ]
    best = [column for column in best if column in in_unit or column not in named]
    if len({column.heading.base for column in best}) > 1:
        raise InputError(
            f"{at}: {in_words(best)} may be the mudline; state columns = {{mudline = "
            f"{shown(best[0].named)}}}, or a list of repeats"
        )
    return best


def in_words(columns: list[Column]) -> str:
    """Columns in words."""
    return "columns " + " and ".join(shown(column.named) for column in columns[:3])


def _header_text(heads: list[Heading]) -> str:
    names = [shown(head.written) for head in heads[:4]]
    return (", ".join(names) + (", ..." if len(heads) > 4 else "")) if any(names) else "missing"


def _missing_column(heads: list[Heading], at: str, missing: bool) -> str:
    """The message about a header that lacks a time or a mudline."""
    header = "missing" if missing or not heads else ", ".join(head.written for head in heads[:4])
    header = header if len(header) <= 60 else shown(header)
    return (
        f"{at}: the header is {header}; give time and one of mudline or sedimentation_ratio, or "
        f"{STATED}"
    )


def _no_header(table: Table, at: str, width: int) -> str:
    """The message about numbers without a header."""
    if not table.rows:
        return _missing_column([], at, True)
    if width < 2:
        return (
            f"{at}: has one column, {shown(table.rows[0].cells[0])}; separate times and readings "
            "by commas, semicolons or tabs"
        )
    return (
        f"{at}: has {width} columns and no header; write one above them, such as time,mudline, or "
        f"{STATED}"
    )
