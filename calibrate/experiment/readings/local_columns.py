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
"""Words of a height that is not told from the floor."""


class LocalLayout(NamedTuple):
    """Columns of a table by what they hold, and the rows below the header."""

    axis: Column
    """Times, or heights."""
    date: Column | None
    """The date of a time of day that has a column of its own."""
    concentrations: list[Column]
    """Once or with their repeats."""
    error: Column | None
    others: list[Column]
    width: int
    rows: list[Row]
    at: str
    """The place of the header, as messages name it."""


def layout(table: Table, sheet: LocalSheet) -> LocalLayout:
    """The columns of a table, from its header or as stated.

    Args:
      table: rows of the file.
      sheet: what is stated of them; with a height a file of times, with a time one of heights.

    Raises:
      InputError: a header without them, or that names two of one.
    """
    by_time = sheet.height is not None
    row, rows = header(table, lambda one: _accepts(one, by_time))
    at = table.at(row or (table.rows[0] if table.rows else Row(1, [])))
    width = max((one.width for one in ([row] if row else rows[:1])), default=0)
    columns = [_column(place, row.cell(place) if row else "") for place in range(width)]
    role: Role = "time" if by_time else "height"
    if row is None and sheet.columns == LocalColumnsSheet() and width == 2:
        columns = [
            columns[0]._replace(role=role),
            columns[1]._replace(role="concentration"),
        ]
    axis = _stated(role, sheet, columns, at)
    concentrations = _stated("concentration", sheet, columns, at)
    concentrations = concentrations or _concentrations(columns, sheet, at)
    date = None
    if by_time:
        time, date = time_columns(axis, columns, sheet.time_unit, at)
        axis = [time] if time else []
    axis = axis or _only([one for one in columns if one.role == role], role, at)
    if not axis or not concentrations:
        raise InputError(_without(columns, by_time, at))
    errors = _stated("standard_deviation", sheet, columns, at)
    errors = errors or [one for one in columns if one.role == "standard_deviation"]
    errors = _only(errors, "standard_deviation", at)
    used = [one.place for one in (*axis, *concentrations, *errors)]
    if len(set(used)) < len(used):
        raise InputError(f"{at}: columns has one twice; mend it")
    used += [date.place] if date else []
    others = [
        one for one in columns if one.place not in used and (one.heading.written or row is None)
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


def _stated(role: Role, sheet: LocalSheet, columns: list[Column], at: str) -> list[Column]:
    """The columns that the experiment file states for a role."""
    given = getattr(sheet.columns, role)
    stated = given if isinstance(given, list) else [given] if given is not None else []
    heads: list[Heading] = [one.heading for one in columns]
    places = stated_places(role, stated, heads, at, several=False)
    return [columns[place]._replace(role=role) for place in places]


def _concentrations(columns: list[Column], sheet: LocalSheet, at: str) -> list[Column]:
    """The column of concentrations: that of the stated kind where there are several."""
    found = [one for one in columns if one.role == "concentration"]
    of_kind = [one for one in found if kind_of(one.heading.written) == sheet.concentration]
    found = of_kind if len(found) > 1 and len(of_kind) == 1 else found
    if len(found) > 1:
        raise InputError(
            f"{at}: {in_words(found)} may be the concentration; state columns = {{concentration = "
            f"{shown(found[0].named)}}}, or a list of repeats"
        )
    return found


def _only(columns: list[Column], role: str, at: str) -> list[Column]:
    """The one column of a role, or none."""
    if len(columns) > 1:
        raise InputError(
            f"{at}: {in_words(columns)} may be the {role}; state columns = {{{role} = "
            f"{shown(columns[0].named)}}}"
        )
    return columns


def _without(columns: list[Column], by_time: bool, at: str) -> str:
    """The message about a header that lacks a column."""
    written = ", ".join(one.heading.written for one in columns[:4])
    axis, stated = ("time", "height") if by_time else ("height", "time")
    return (
        f"{at}: the header is {shown(written) if written.strip(', ') else 'missing'}; where "
        f"{stated} is stated give {axis} and concentration, or state columns = {{{axis} = 1, "
        "concentration = 2}"
    )
