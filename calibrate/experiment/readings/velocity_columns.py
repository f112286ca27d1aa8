"""The columns of a table of velocities: concentrations, velocities or fluxes, their errors."""

from typing import Literal, NamedTuple, get_args

from calibrate.experiment.readings import vocabulary
from calibrate.experiment.readings.concentrations import kind_of, names_a_concentration
from calibrate.experiment.readings.header import header
from calibrate.experiment.readings.headings import heading
from calibrate.experiment.readings.sheet import VelocitiesSheet
from calibrate.experiment.readings.table import Row, Table
from calibrate.experiment.velocity_units import VelocityUnit, parted
from mrjax import InputError
from mrjax.core.errors import shown

Role = Literal["concentration", "velocity", "flux", "standard_deviation"]
OF_READINGS: tuple[Role, ...] = ("velocity", "flux")
EXAMPLE = "columns = {concentration = 1, velocity = 2}"


class VelocityColumn(NamedTuple):
    """A column of a table of velocities."""

    place: int
    """Index of the column, from 0."""
    written: str
    """Text of its cell in the header."""
    role: Role | None
    unit: VelocityUnit | None
    """Unit of velocity in the header; None if there is none."""
    base: str
    """Its name without the unit and without marks of a repeat."""

    @property
    def named(self) -> str:
        """Its name in messages."""
        return self.written or f"column {self.place + 1}"


class VelocityLayout(NamedTuple):
    """Columns of a table by what they hold, and the rows below the header."""

    concentration: VelocityColumn
    readings: list[VelocityColumn]
    """Columns of velocities or fluxes: one, or several repeats."""
    error: VelocityColumn | None
    others: list[VelocityColumn]
    width: int
    rows: list[Row]
    at: str
    """Place of the header, for messages."""


def layout(table: Table, sheet: VelocitiesSheet) -> VelocityLayout:
    """The columns of a table, from its header or as stated.

    Raises:
      InputError: a header without concentration or velocity, or that names two of them.
    """
    row, rows = header(table, _accepts)
    at = table.at(row or (table.rows[0] if table.rows else Row(1, [])))
    width = max((line.width for line in ([row] if row else rows[:1])), default=0)
    columns = [_column(place, row.cell(place) if row else "") for place in range(width)]
    chosen = {role: _stated_columns(role, sheet, columns, at) for role in get_args(Role)}
    if row is None and not any(chosen.values()) and width == 2:
        chosen["concentration"], chosen[sheet.quantity or "velocity"] = columns[:1], columns[1:]
    concentrations = chosen["concentration"] or _concentrations(columns, sheet, at)
    readings = chosen["velocity"] or chosen["flux"] or _readings(columns, sheet, at)
    if not concentrations or not readings:
        raise InputError(_missing_column(columns, at))
    role: Role = "flux" if chosen["flux"] and not chosen["velocity"] else "velocity"
    readings = [
        column._replace(role=role if column in chosen[role] else column.role) for column in readings
    ]
    errors = chosen["standard_deviation"] or [
        column for column in columns if column.role == "standard_deviation"
    ]
    if len(errors) > 1:
        raise InputError(
            f"{at}: {_column_names(errors)} may be the errors; state columns = "
            f"{{standard_deviation = {shown(errors[0].named)}}}"
        )
    used = [column.place for column in (*concentrations, *readings, *errors)]
    if len(set(used)) < len(used):
        raise InputError(f"{at}: columns names one column twice; mend it")
    others = [
        column for column in columns if column.place not in used and (column.written or row is None)
    ]
    error = errors[0] if errors else None
    return VelocityLayout(concentrations[0], readings, error, others, width, rows, at)


def _accepts(row: Row) -> bool:
    """True if a row names a concentration and a velocity or flux."""
    roles = {_column(place, cell).role for place, cell in enumerate(row.cells)}
    return "concentration" in roles and bool(roles & set(OF_READINGS))


def _column(place: int, written: str) -> VelocityColumn:
    name, unit = parted(written)
    head = heading(name)
    return VelocityColumn(place, written, _role(name, unit), unit, head.base or name)


def named_quantity(written: str) -> str | None:
    """The quantity that a header names: `velocity`, `flux` or neither."""
    name = parted(written)[0]
    words = heading(name).words | set(name.split())
    if words & vocabulary.FLUX:
        return "flux"
    return "velocity" if words & vocabulary.VELOCITY else None


def _role(name: str, unit: VelocityUnit | None) -> Role | None:
    words = heading(name).words | set(name.split())
    if words & vocabulary.ERROR or name in ("±", "+/-"):
        return "standard_deviation"
    if words & vocabulary.FLUX:
        return "flux"
    if unit is not None or (words & vocabulary.VELOCITY and not names_a_concentration(name)):
        return "velocity"
    return "concentration" if names_a_concentration(name) else None


def _stated_columns(
    role: Role, sheet: VelocitiesSheet, columns: list[VelocityColumn], at: str
) -> list[VelocityColumn]:
    """The columns that the experiment file states for a role."""
    named = getattr(sheet.columns, role)
    chosen: list[VelocityColumn] = []
    for name in named if isinstance(named, list) else [named]:
        if name is None:
            continue
        fits = [
            column
            for column in columns
            if (column.place + 1 == name if isinstance(name, int) else _is_named(column, name))
        ]
        if len(fits) != 1:
            count = "no column" if not fits else f"{len(fits)} columns"
            raise InputError(
                f"{at}: columns.{role} = {shown(name)}: it has {count} of that name; give a name "
                f"or number of the header, which is {_column_names(columns)}"
            )
        chosen += fits
    return chosen


def _is_named(column: VelocityColumn, name: str) -> bool:
    """True if a header's cell is a stated name, whole or without its unit, in any case."""
    written, plain = " ".join(name.split()).casefold(), column.written.casefold()
    return written == plain or (bool(column.unit) and written == parted(column.written)[0])


def _concentrations(
    columns: list[VelocityColumn], sheet: VelocitiesSheet, at: str
) -> list[VelocityColumn]:
    """The column of concentrations: that of the stated kind where there are several."""
    candidates = [column for column in columns if column.role == "concentration"]
    of_kind = [column for column in candidates if kind_of(column.written) == sheet.concentration]
    if len(candidates) > 1 and len(of_kind) != 1:
        raise InputError(
            f"{at}: {_column_names(candidates)} may be the concentration; state columns = "
            f"{{concentration = {shown(candidates[0].named)}}}"
        )
    return of_kind if len(candidates) > 1 else candidates


def _readings(
    columns: list[VelocityColumn], sheet: VelocitiesSheet, at: str
) -> list[VelocityColumn]:
    """The columns of velocities or fluxes, which have one name and one unit."""
    for role in [sheet.quantity] if sheet.quantity else OF_READINGS:
        candidates = [column for column in columns if column.role == role]
        candidates = candidates or [
            column for column in columns if sheet.quantity and column.role in OF_READINGS
        ]
        if len({(column.base, column.unit) for column in candidates}) > 1:
            raise InputError(
                f"{at}: {_column_names(candidates)} may be the {role}; state columns = {{{role} = "
                f"{shown(candidates[0].named)}}}, or a list of repeats"
            )
        if candidates:
            return candidates
    return []


def _column_names(columns: list[VelocityColumn]) -> str:
    names = [shown(column.named) for column in columns[:4]]
    return " and ".join(names) if len(columns) <= 4 else ", ".join(names) + ", ..."


def _missing_column(columns: list[VelocityColumn], at: str) -> str:
    named = any(column.written for column in columns)
    header_text = shown(", ".join(column.written for column in columns[:4])) if named else "missing"
    return (
        f"{at}: the header is {header_text}; give a concentration and one of velocity or flux, or "
        f"state {EXAMPLE}"
    )
