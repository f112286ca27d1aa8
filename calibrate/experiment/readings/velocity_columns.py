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
    """From 0."""
    written: str
    """Its cell in the header."""
    role: Role | None
    unit: VelocityUnit | None
    """The unit of a velocity that the header gives."""
    base: str
    """Its name without the unit and what tells repeats apart."""

    @property
    def named(self) -> str:
        """Its name in messages."""
        return self.written or f"column {self.place + 1}"


class VelocityLayout(NamedTuple):
    """Columns of a table by what they hold, and the rows below the header."""

    concentration: VelocityColumn
    readings: list[VelocityColumn]
    """Velocities or fluxes, once or with their repeats."""
    error: VelocityColumn | None
    others: list[VelocityColumn]
    width: int
    rows: list[Row]
    at: str
    """The place of the header, as messages name it."""


def layout(table: Table, sheet: VelocitiesSheet) -> VelocityLayout:
    """The columns of a table, from its header or as stated.

    Raises:
      InputError: a header without concentration or velocity, or that names two of them.
    """
    row, rows = header(table, _accepts)
    at = table.at(row or (table.rows[0] if table.rows else Row(1, [])))
    width = max((one.width for one in ([row] if row else rows[:1])), default=0)
    columns = [_column(place, row.cell(place) if row else "") for place in range(width)]
    chosen = {role: _stated(role, sheet, columns, at) for role in get_args(Role)}
    if row is None and not any(chosen.values()) and width == 2:
        chosen["concentration"], chosen[sheet.quantity or "velocity"] = columns[:1], columns[1:]
    concentrations = chosen["concentration"] or _concentrations(columns, sheet, at)
    readings = chosen["velocity"] or chosen["flux"] or _readings(columns, sheet, at)
    if not concentrations or not readings:
        raise InputError(_without(columns, at))
    role: Role = "flux" if chosen["flux"] and not chosen["velocity"] else "velocity"
    readings = [one._replace(role=role if one in chosen[role] else one.role) for one in readings]
    errors = chosen["standard_deviation"] or [
        one for one in columns if one.role == "standard_deviation"
    ]
    if len(errors) > 1:
        raise InputError(
            f"{at}: {_listed(errors)} may be the errors; state columns = {{standard_deviation = "
            f"{shown(errors[0].named)}}}"
        )
    used = [one.place for one in (*concentrations, *readings, *errors)]
    if len(set(used)) < len(used):
        raise InputError(f"{at}: columns has one twice; mend it")
    others = [one for one in columns if one.place not in used and (one.written or row is None)]
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


def _stated(
    role: Role, sheet: VelocitiesSheet, columns: list[VelocityColumn], at: str
) -> list[VelocityColumn]:
    """The columns that the experiment file states for a role."""
    given = getattr(sheet.columns, role)
    found: list[VelocityColumn] = []
    for one in given if isinstance(given, list) else [given]:
        if one is None:
            continue
        fits = [
            column
            for column in columns
            if (column.place + 1 == one if isinstance(one, int) else _is_named(column, one))
        ]
        if len(fits) != 1:
            count = "no column" if not fits else f"{len(fits)} columns"
            raise InputError(
                f"{at}: columns.{role} = {shown(one)}: there is {count} of it; give a name or "
                "number of the header, which is "
                f"{_listed(columns)}"
            )
        found += fits
    return found


def _is_named(column: VelocityColumn, name: str) -> bool:
    """True if a header's cell is a stated name, whole or without its unit, in any case."""
    written, plain = " ".join(name.split()).casefold(), column.written.casefold()
    return written == plain or (bool(column.unit) and written == parted(column.written)[0])


def _concentrations(
    columns: list[VelocityColumn], sheet: VelocitiesSheet, at: str
) -> list[VelocityColumn]:
    """The column of concentrations: that of the stated kind where there are several."""
    found = [one for one in columns if one.role == "concentration"]
    of_kind = [one for one in found if kind_of(one.written) == sheet.concentration]
    if len(found) > 1 and len(of_kind) != 1:
        raise InputError(
            f"{at}: {_listed(found)} may be the concentration; state columns = {{concentration = "
            f"{shown(found[0].named)}}}"
        )
    return of_kind if len(found) > 1 else found


def _readings(
    columns: list[VelocityColumn], sheet: VelocitiesSheet, at: str
) -> list[VelocityColumn]:
    """The columns of velocities or fluxes, which have one name and one unit."""
    for role in [sheet.quantity] if sheet.quantity else OF_READINGS:
        found = [one for one in columns if one.role == role]
        found = found or [one for one in columns if sheet.quantity and one.role in OF_READINGS]
        if len({(one.base, one.unit) for one in found}) > 1:
            raise InputError(
                f"{at}: {_listed(found)} may be the {role}; state columns = {{{role} = "
                f"{shown(found[0].named)}}}, or a list of repeats"
            )
        if found:
            return found
    return []


def _listed(columns: list[VelocityColumn]) -> str:
    names = [shown(one.named) for one in columns[:4]]
    return " and ".join(names) if len(columns) <= 4 else ", ".join(names) + ", ..."


def _without(columns: list[VelocityColumn], at: str) -> str:
    named = any(one.written for one in columns)
    said = shown(", ".join(one.written for one in columns[:4])) if named else "missing"
    return (
        f"{at}: the header is {said}; give a concentration and one of velocity or flux, or state "
        f"{EXAMPLE}"
    )
