"""`mrjax column`: the tube of a recipe in one dimension, without measurements."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrjax.cli import environment, options
from mrjax.cli.completion import sheet_names
from mrjax.cli.exit_status import EXIT_STATUS
from mrjax.cli.terminal import echo

if TYPE_CHECKING:
    from mrjax import Column, PolydisperseColumn, Recipe

TIMES = 101
"""Times of the fields."""
RIGID_BED = 0.6
"""Volume fraction of a rigid bed, unless it is stated or flocs fill it before."""
FILES = ("column.json", "curve.csv", "fields.csv", "fields.npz", "fields.png")


@click.command(
    epilog=EXIT_STATUS,
    help="""Settles a RECIPE, bundled or a TOML file, in a tube of layers (Kynch's theory).

    Particles of several sizes settle in classes. With --compression the bed yields under its
    weight. Writes column.json, curve.csv, fields.csv and fields.npz (volume fraction, settling
    velocity and solid stress over time and height) and fields.png.

    \b
    Examples:
      mrjax column case2 --height 0.1 --hours 240 --out tube
      mrjax column mine.toml --height 0.3 --hours 24 --bed-fraction 0.5
      mrjax column mine.toml --height 0.3 --hours 24 --compression 0.3 5 4
    """,
)
@click.argument("recipe", shell_complete=sheet_names("mrjax.recipe.bundled"))
@click.option(
    "--height",
    required=True,
    type=options.Finite(min=0.0, min_open=True),
    metavar="M",
    help="Height of the suspension, m.",
)
@click.option(
    "--hours",
    required=True,
    type=options.Finite(min=0.0, min_open=True),
    help="Last time, h.",
)
@click.option(
    "--bed-fraction",
    type=options.Finite(0.0, 1.0, min_open=True, max_open=True),
    help="Volume fraction of the coated particles in the bed at rest; 0.6 by default. With "
    "--compression that which the bed does not exceed; 0.74 by default.",
)
@click.option(
    "--compression",
    nargs=3,
    type=options.Finite(min=0.0, min_open=True),
    metavar="GEL STRESS EXPONENT",
    help="Effective solid stress of the bed: gel fraction, scale in Pa, and exponent.",
)
@options.out_option("column")
@options.pdf_option
@options.quiet_option
@options.json_option
def column(
    recipe: str,
    height: float,
    hours: float,
    bed_fraction: float | None,
    compression: tuple[float, float, float] | None,
    out: str,
    pdf: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Settles a recipe in one dimension and writes the results."""
    environment.start_jax("float64")
    import mrjax
    from mrjax import figures
    from mrjax.cli import provenance
    from mrjax.continuum.compression import densest_bed
    from mrjax.io import files, results

    sheet = mrjax.Recipe.load(recipe)
    if bed_fraction is None:
        densest = float(densest_bed(sheet.closure))
        bed_fraction = min(RIGID_BED, densest) if compression is None else densest
    folder = files.result_folder(Path(out))
    with results.guarded(folder, FILES):
        tube = _settle(sheet, height, hours, bed_fraction, compression)
        made_by = provenance.made_by(sheet, 0, "float64")
        numbers = _numbers(sheet, tube, bed_fraction) | made_by
        files.write_json(folder / "column.json", numbers)
        curve: dict[str, Any] = {
            "time_s": tube.times,
            "mudline_m": tube.mudline,
            "bed_front_m": tube.bed_front,
        }
        curve["sedimentation_ratio"] = tube.sedimentation_ratio
        files.write_csv(folder / "curve.csv", curve)
        for suffix in ("csv", "npz"):
            mrjax.save_column(folder / f"fields.{suffix}", tube, made_by)
        files.write_figure(folder, "fields", figures.column_field(tube), made_by, pdf)
    for warning in numbers["warnings"]:
        echo(f"mrjax: warning: {warning}", err=True)
    if as_json:
        click.echo(files.as_json(numbers, ascii_only=True))
    elif not quiet:
        echo(
            f"The suspension settles at {numbers['initial_velocity_mm_per_day']:.5g} mm/day at "
            f"first. After {hours:g} h its mudline is at {1e3 * numbers['mudline_m']:.4g} of "
            f"{1e3 * height:.4g} mm, and the front of its bed at "
            f"{1e3 * numbers['bed_front_m']:.4g} mm."
        )
        echo(f"Results: {folder}")


def _settle(
    sheet: "Recipe",
    height: float,
    hours: float,
    bed_fraction: float,
    compression: tuple[float, float, float] | None,
) -> "Column | PolydisperseColumn":
    """Settles the suspension of a sheet.

    Raises:
      InputError: it cannot be settled so.
    """
    import jax.numpy as jnp
    import numpy as np

    import mrjax

    common: dict[str, Any] = {
        "height": height,
        "bed_fraction": bed_fraction,
        "times": np.linspace(0.0, 3600.0 * hours, TIMES),
        "hindrance": sheet.hindrance,
    }
    if jnp.ndim(mrjax.terminal_velocity(sheet.parameters())):
        if compression is not None:
            raise mrjax.InputError(
                f"--compression: the recipe {sheet.name} has several sizes, whose bed is rigid; "
                "leave it out, or give one diameter"
            )
        powder = sheet.size_classes()
        return mrjax.polydisperse_column(
            powder.parameters, volume_fraction=powder.volume_fraction, **common
        )
    if compression is not None:
        gel, stress, exponent = compression
        common["compression"] = mrjax.Compression(
            gel_fraction=gel, stress=stress, exponent=exponent
        )
    return mrjax.column(sheet.parameters(), volume_fraction=sheet.coated_volume_fraction, **common)


def _numbers(
    sheet: "Recipe", tube: "Column | PolydisperseColumn", bed_fraction: float
) -> dict[str, Any]:
    """Returns the content of column.json, without its provenance."""
    import mrjax
    from mrjax.simulation import derived

    middle = tube.settling_velocity[0, tube.levels.size // 2]
    return {
        "initial_velocity_mm_per_day": mrjax.MM_PER_DAY * middle,
        "height_m": tube.initial_height,
        "bed_fraction": bed_fraction,
        "time_s": tube.times[-1],
        "mudline_m": tube.mudline[-1],
        "bed_front_m": tube.bed_front[-1],
        "sedimentation_ratio": tube.sedimentation_ratio[-1],
        "solid_stress_Pa": tube.solid_stress[-1].max(),
        "warnings": derived.warnings(sheet),
    }
