"""The columns of a table of local concentrations: times or heights, readings, their errors."""

from typing import Literal, NamedTuple

from calibrate.experiment.readings.columns import Column, in_words, stated_places, time_columns
from calibrate.experiment.readings.concentrations import kind_of, names_a_concentration
from calibrate.experiment.readings.header import header
from calibrate.experiment.readings.headings import Heading, heading
from calibrate.experiment.readings.sheet import LocalColumnsSheet, LocalSheet
from calibrate.experiment.readings.table import Row, Table
from mrjax import InputError
from mrjax.core.errors import shown

Role = Literal["time", "height", "concentration", "standard_deviation"]
FROM_ABOVE = frozenset(["depth", "depths", "top", "surface", "below", "tiefe", "profondeur"])
"""Words of a height that is not measured from the floor."""


class LocalLayout(NamedTuple):
    """Columns of a table by what they hold, and the rows below the header."""

    axis: Column
    """Column of the times, or of the heights."""
    date: Column | None
    """The date of a time of day that has a column of its own."""
    concentrations: list[Column]
    """Columns of the concentrations: one, or several repeats."""
    error: Column | None
    others: list[Column]
    width: int
    rows: list[Row]
    at: str
    """Place of the header, for messages."""


def layout(table: Table, sheet: LocalSheet) -> LocalLayout:
    """The columns of a table, from its header or as stated.

    Args:
      table: rows of the file.
      sheet: settings of the file. With a height it is a file of times, with a time one of heights.

    Raises:
      InputError: the header lacks a column, or names one twice.
    """
    by_time = sheet.height is not None
    row, rows = header(table, lambda line: _accepts(line, by_time))
    at = table.at(row or (table.rows[0] if table.rows else Row(1, [])))
    width = max((line.width for line in ([row] if row else rows[:1])), default=0)
    columns = [_column(place, row.cell(place) if row else "") for place in range(width)]
    role: Role = "time" if by_time else "height"
    if row is None and sheet.columns == LocalColumnsSheet() and width == 2:
        columns = [
            columns[0]._replace(role=role),
            columns[1]._replace(role="concentration"),
        ]
    axis = _stated_columns(role, sheet, columns, at)
    concentrations = _stated_columns("concentration", sheet, columns, at)
    concentrations = concentrations or _concentrations(columns, sheet, at)
    date = None
    if by_time:
        time, date = time_columns(axis, columns, sheet.time_unit, at)
        axis = [time] if time else []
    axis = axis or _only([column for column in columns if column.role == role], role, at)
    if not axis or not concentrations:
        raise InputError(_missing_column(columns, by_time, at))
    errors = _stated_columns("standard_deviation", sheet, columns, at)
    errors = errors or [column for column in columns if column.role == "standard_deviation"]
    errors = _only(errors, "standard_deviation", at)
    used = [column.place for column in (*axis, *concentrations, *errors)]
    if len(set(used)) < len(used):
        raise InputError(f"{at}: columns names one column twice; mend it")
    used += [date.place] if date else []
    others = [
        column
        for column in columns
        if column.place not in used and (column.heading.written or row is None)
    ]
    error = errors[0] if errors else None
    return LocalLayout(axis[0], date, concentrations, error, others, width, rows, at)


def _column(place: int, written: str) -> Column:
    head = heading(written)
    kind = head.kind
    if kind and kind[0] in ("time", "standard_deviation"):
        return Column(place, head, kind[0])
    if names_a_concentration(written):
        return Column(place, head, "concentration")
    return Column(place, head, "height" if kind or head.words & FROM_ABOVE else "other")


def _accepts(row: Row, by_time: bool) -> bool:
    """True if a row names a concentration, and a time or height."""
    roles = {_column(place, cell).role for place, cell in enumerate(row.cells)}
    return {"concentration", "time" if by_time else "height"} <= roles


def _stated_columns(role: Role, sheet: LocalSheet, columns: list[Column], at: str) -> list[Column]:
    """The columns that the experiment file states for a role."""
    named = getattr(sheet.columns, role)
    stated = named if isinstance(named, list) else [named] if named is not None else []
    heads: list[Heading] = [column.heading for column in columns]
    places = stated_places(role, stated, heads, at, several=False)
    return [columns[place]._replace(role=role) for place in places]


def _concentrations(columns: list[Column], sheet: LocalSheet, at: str) -> list[Column]:
    """The column of concentrations: that of the stated kind where there are several."""
    candidates = [column for column in columns if column.role == "concentration"]
    of_kind = [
        column for column in candidates if kind_of(column.heading.written) == sheet.concentration
    ]
    candidates = of_kind if len(candidates) > 1 and len(of_kind) == 1 else candidates
    if len(candidates) > 1:
        raise InputError(
            f"{at}: {in_words(candidates)} may be the concentration; state columns = "
            f"{{concentration = {shown(candidates[0].named)}}}, or a list of repeats"
        )
    return candidates


def _only(columns: list[Column], role: str, at: str) -> list[Column]:
    """The only column of a role, or none."""
    if len(columns) > 1:
        raise InputError(
            f"{at}: {in_words(columns)} may be the {role}; state columns = {{{role} = "
            f"{shown(columns[0].named)}}}"
        )
    return columns


def _missing_column(columns: list[Column], by_time: bool, at: str) -> str:
    """The message about a header that lacks a column."""
    written = ", ".join(column.heading.written for column in columns[:4])
    axis, stated = ("time", "height") if by_time else ("height", "time")
    return (
        f"{at}: the header is {shown(written) if written.strip(', ') else 'missing'}; where "
        f"{stated} is stated give {axis} and concentration, or state columns = {{{axis} = 1, "
        "concentration = 2}"
    )
