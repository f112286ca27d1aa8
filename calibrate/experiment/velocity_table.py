"""The velocities of a sample at many concentrations, as measurements."""

from pathlib import Path
from typing import NamedTuple

from calibrate.experiment.readings import concentrations, velocities
from calibrate.experiment.readings.sheet import VelocitiesSheet
from calibrate.experiment.readings.velocities import Velocity
from calibrate.experiment.readings.velocity_understood import VelocitiesUnderstood
from calibrate.experiment.repeats import BEFORE_THE_FIT, LEAST_SCATTER, scatter_of_repeats
from calibrate.experiment.sample import Concentration, Measurement, Scatter
from mrjax import InputError, Recipe
from mrjax.laws.closures.table import valid_range


class VelocityTable(NamedTuple):
    """A table of velocities as measurements."""

    measurements: list[Measurement]
    fractions: tuple[float, ...]
    """Volume fractions of the uncoated particles, increasing, (K,)."""
    scatter: Scatter | None
    """Relative scatter of the velocities; None if errors are stated."""
    understood: VelocitiesUnderstood


def read(sheet: VelocitiesSheet, folder: Path, recipe: Recipe) -> VelocityTable:
    """Reads the table of velocities of a sample.

    Args:
      sheet: the file and its settings.
      folder: folder of the experiment file.
      recipe: recipe, whose densities give volume fractions, and whose closure gives f_w at each.

    Raises:
      InputError: a file that cannot be used, or a recipe whose f_w is one number.
    """
    if recipe.closure is None:
        raise InputError(
            f"the recipe {recipe.name} has f_w = {recipe.f_w:g} at every concentration; name a "
            'closure in [drag], such as f_w = "richardson-zaki"'
        )

    holds = valid_range(recipe.closure)

    def fraction(kind: str, value: float) -> float:
        solids = concentrations.volume_fraction(kind, value, recipe)
        fault = holds and holds.fault(solids * recipe.radius_factor**3)
        if fault:
            raise InputError(
                f"a volume fraction of {solids:.4g} is out of the range of the closure of "
                f"{recipe.name}, which {fault}; give other coefficients in [drag], another "
                "closure, or leave the row out"
            )
        return solids

    table_read = velocities.read(sheet, folder, fraction)
    fractions = tuple(sorted({reading.volume_fraction for reading in table_read.readings}))
    place_of = {fraction_read: place for place, fraction_read in enumerate(fractions)}
    scatter = _scatter(table_read.readings) if table_read.understood.errors == "estimated" else None
    measurements = [
        Measurement(
            "initial_velocity",
            reading.value,
            scatter.value * reading.value if scatter else reading.error,
            table_read.unit.name,
            table_read.unit.si,
            row=reading.row,
            concentration=Concentration(
                reading.concentration,
                table_read.kind,
                reading.volume_fraction,
                place_of[reading.volume_fraction],
            ),
        )
        for reading in table_read.readings
    ]
    return VelocityTable(measurements, fractions, scatter, table_read.understood)


def _scatter(readings: list[Velocity]) -> Scatter:
    """Relative scatter of repeats at one concentration, or a first guess if these are few."""
    repeated = scatter_of_repeats(
        [reading.volume_fraction for reading in readings],
        [reading.value for reading in readings],
        relative=True,
    )
    if repeated is None:
        return Scatter(BEFORE_THE_FIT, 0.0, "assumed")
    return repeated._replace(value=max(repeated.value, LEAST_SCATTER))
