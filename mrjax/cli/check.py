"""`mrjax check`: the quantities derived from a recipe, without a simulation."""

from typing import TYPE_CHECKING, Any

import click

from mrjax.cli import environment, options
from mrjax.cli.completion import sheet_names
from mrjax.cli.exit_status import EXIT_STATUS
from mrjax.cli.terminal import echo

if TYPE_CHECKING:
    from mrjax.simulation.derived import Quantity


@click.command(
    epilog=EXIT_STATUS,
    help="""Shows quantities derived from a RECIPE, bundled or a TOML file, without a simulation.

    These are volume fractions, number of particles, densities, drag factors, settling velocity,
    time scales, and step and cost of a run to rest. Warnings name assumptions of the model that do
    not hold. Notes name assumed values, quantities that the recipe does not determine, the branch
    of hindered settling, what moves in a fluid with a yield stress, and whether particles stick.

    \b
    Examples:
      mrjax check case2
      mrjax check mine.toml --json
      mrjax check thick.toml --tube-diameter 0.02 --tube-height 0.2
      mrjax check case2 --tube-height 0.1 --compression 0.3 200 8
    """,
)
@click.argument("recipe", shell_complete=sheet_names("mrjax.recipe.bundled"))
@click.option(
    "--tube-diameter",
    type=options.Finite(min=0.0, min_open=True),
    help="Inner diameter of the tube in m, whose wall may hold a suspension with a yield stress.",
)
@click.option(
    "--tube-height",
    type=options.Finite(min=0.0, min_open=True),
    help="Height of the suspension in that tube in m: a tall, narrow one settles faster if tilted, "
    "and a bed of many layers may yield under its weight.",
)
@click.option(
    "--compression",
    nargs=3,
    type=options.Finite(min=0.0, min_open=True),
    metavar="GEL STRESS EXPONENT",
    help="Effective solid stress of the bed, as for mrjax column: with --tube-height, whether the "
    "suspension stands without settling.",
)
@options.quiet_option
@options.json_option
def check(
    recipe: str,
    tube_diameter: float | None,
    tube_height: float | None,
    compression: tuple[float, float, float] | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Prints the derived quantities, notes and warnings of a recipe."""
    environment.start_jax("float64")
    import mrjax
    from mrjax.io import files
    from mrjax.simulation import derived

    sheet = mrjax.Recipe.load(recipe)
    quantities = derived.derived(sheet)
    warnings = derived.warnings(sheet, tube_diameter, tube_height)
    law = None
    if compression is not None:
        if tube_height is None:
            raise mrjax.InputError(
                "--compression: needs the height of the tube; give --tube-height"
            )
        gel, stress, exponent = compression
        law = mrjax.Compression(gel_fraction=gel, stress=stress, exponent=exponent)
    notes = derived.notes(sheet, tube_diameter, tube_height, law)
    for warning in warnings:
        echo(f"mrjax: warning: {warning}", err=True)
    if as_json:
        result = {
            "recipe": sheet.name,
            "derived": _as_table(quantities),
            "notes": notes,
            "warnings": warnings,
        }
        click.echo(files.as_json(result, ascii_only=True))
    if quiet or as_json:
        return
    widest = max(len(quantity.name) for quantity in quantities)
    for quantity in quantities:
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        echo(f"{quantity.name:{widest}}  {quantity.value:.5g}{unit}")
    for note in notes:
        echo(f"Note: {note}.")


def _as_table(quantities: "list[Quantity]") -> dict[str, Any]:
    return {
        quantity.key: {"name": quantity.name, "value": quantity.value, "unit": quantity.unit}
        for quantity in quantities
    }
