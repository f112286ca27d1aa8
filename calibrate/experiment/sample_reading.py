"""Reads a sample from its table of the experiment file: its recipe and its readings."""

from pathlib import Path

from calibrate.experiment import curve, local_table, particle_network, velocity_table
from calibrate.experiment.sample import LocalTable, Measurement, Sample
from calibrate.experiment.sheets import SampleSheet
from calibrate.experiment.suspension import TILT
from calibrate.experiment.units import RATIO_UNITS
from calibrate.experiment.velocity_table import VelocityTable
from calibrate.experiment.velocity_units import velocity_unit
from mrjax import InputError, Recipe, Rotor
from mrjax.continuum.tilt import gap_of_round_tube
from mrjax.core.errors import shown
from mrjax.io import reading


def read_sample(
    sheet: SampleSheet, folder: Path, source: str, recipes: dict[Path, Recipe]
) -> Sample:
    """Reads the sample of a table.

    Args:
      sheet: the table.
      folder: folder of the experiment file, to which paths are relative.
      source: name of the experiment, for messages.
      recipes: recipes that were read before, by path; a new one is added.

    Raises:
      InputError: a recipe or curve that cannot be used, or particles that rise.
    """
    recipe = _recipe(sheet, folder, source, recipes)
    rotor = None
    if sheet.rotor is not None:
        rotor = Rotor(**sheet.rotor.model_dump())
        sheet = sheet.model_copy(update={"height": float(rotor.height)})
    measurements = _readings_at_one_time(sheet)
    times: tuple[float, ...] = ()
    understood, curve_scatter = None, None
    if sheet.curve:
        if sheet.height is None:
            raise InputError(
                f"{source}: sample {shown(sheet.name)}: height is missing; give that of the "
                "suspension in its tube in m, which a curve needs"
            )
        read = curve.read(sheet.curve, folder, sheet.height, sheet.tube_diameter)
        times = tuple(sorted(set(read.times)))
        place_of = {time: place for place, time in enumerate(times)}
        measurements += [
            Measurement(read.observable, value, error, read.unit, read.si, place_of[time], row)
            for time, value, error, row in zip(
                read.times, read.values, read.errors, read.rows, strict=True
            )
        ]
        understood, curve_scatter = read.understood, read.scatter
    table = _velocities(sheet, folder, source, recipe)
    measurements += table.measurements if table else []
    tables, local = _concentrations(sheet, folder, source, recipe)
    measurements += local
    if ratio := sheet.viscosity_ratio:
        measurements.append(
            Measurement("viscosity_ratio", ratio.value, ratio.standard_deviation, "1", 1.0)
        )
    return Sample(
        sheet.name,
        recipe,
        recipe.box.height if sheet.height is None else sheet.height,
        sheet.bed_fraction,
        tuple(measurements),
        times,
        understood,
        table.fractions if table else (),
        table.understood if table else None,
        table.scatter if table else None,
        curve_scatter,
        tuple(measurement.point for measurement in local if measurement.point is not None),
        tuple(tables),
        _tube(sheet, recipe, source),
        sheet.mudline_threshold,
        rotor,
        _gap(sheet),
    )


def _velocities(
    sheet: SampleSheet, folder: Path, source: str, recipe: Recipe
) -> VelocityTable | None:
    """The table of velocities of a sample; None if it has none."""
    if sheet.velocities is None:
        return None
    try:
        return velocity_table.read(sheet.velocities, folder, recipe)
    except InputError as error:
        raise InputError(f"{source}: sample {shown(sheet.name)}: {error}") from None


def _concentrations(
    sheet: SampleSheet, folder: Path, source: str, recipe: Recipe
) -> tuple[list[LocalTable], list[Measurement]]:
    """The tables of local concentrations of a sample, and their readings."""
    if not sheet.concentration:
        return [], []
    if sheet.height is None:
        raise InputError(
            f"{source}: sample {shown(sheet.name)}: height is missing; give that of the suspension "
            "in its tube in m, which concentrations at a height need"
        )
    try:
        return local_table.read_all(sheet.concentration, folder, recipe, sheet.height)
    except InputError as error:
        raise InputError(f"{source}: sample {shown(sheet.name)}: {error}") from None


def _tube(sheet: SampleSheet, recipe: Recipe, source: str) -> dict[str, float]:
    """The stated quantities of the tube, by name.

    Raises:
      InputError: the compression is to be that of particles, and cannot be simulated.
    """
    stated: dict[str, float | None] = {
        "delay": sheet.delay,
        TILT: sheet.tube.tilt if sheet.tube else None,
    }
    if sheet.compression == "particles":
        try:
            stated |= particle_network.compression(recipe)
        except InputError as error:
            raise InputError(
                f"{source}: sample {shown(sheet.name)}: compression: {error}"
            ) from None
    elif sheet.compression is not None:
        stated |= {
            f"compression.{name}": value for name, value in sheet.compression.model_dump().items()
        }
    return {name: value for name, value in stated.items() if value is not None}


def _gap(sheet: SampleSheet) -> float | None:
    """The gap of the tube, stated or that of a round one, m; None if it is not known."""
    if sheet.tube is not None and sheet.tube.gap is not None:
        return sheet.tube.gap
    return None if sheet.tube_diameter is None else gap_of_round_tube(sheet.tube_diameter)


def _recipe(sheet: SampleSheet, folder: Path, source: str, recipes: dict[Path, Recipe]) -> Recipe:
    beside = folder / sheet.recipe
    try:
        if beside not in recipes:
            read_from = beside if reading.is_file(beside) else sheet.recipe
            recipes[beside] = Recipe.load(read_from)
        recipe = recipes[beside]
    except InputError as error:
        raise InputError(f"{source}: sample {shown(sheet.name)}: recipe {error}") from None
    if recipe.apparent_density < recipe.fluid.density:
        raise InputError(
            f"{source}: sample {shown(sheet.name)}: its particles, at "
            f"{recipe.apparent_density:.5g} kg/m^3, are lighter than the fluid and rise; a fit "
            "reads mudlines that fall: give a heavier particle or a lighter fluid"
        )
    return recipe


def _readings_at_one_time(sheet: SampleSheet) -> list[Measurement]:
    """The initial velocity and the final ratio, where they were measured."""
    measurements = []
    if velocity := sheet.initial_velocity:
        unit = velocity_unit(velocity.unit)
        assert unit is not None  # the sheet has been validated
        measurements.append(
            Measurement(
                "initial_velocity",
                velocity.value * unit.factor,
                velocity.standard_deviation * unit.factor,
                unit.name,
                unit.si,
            )
        )
    if final := sheet.final_ratio:
        measurements.append(
            Measurement(
                "final_ratio",
                final.value,
                final.standard_deviation,
                final.unit,
                RATIO_UNITS[final.unit],
            )
        )
    return measurements
