"""The command `mrjax simulate`."""

import time
from typing import Any

import click

from mrjax.cli import environment, options
from mrjax.cli.completion import sheet_names
from mrjax.cli.exit_status import EXIT_STATUS
from mrjax.cli.simulate.request import Request
from mrjax.simulation.overlap import MOST_OVERLAP, OVERLAP


@click.command(
    epilog=EXIT_STATUS,
    help="""Simulates the particles of a RECIPE, bundled (case1, case2, case3) or a TOML file.

    The run goes from dispersed to rest: the whole sedimentation curve at the recipe's viscosity,
    with contacts softened to a largest overlap (--overlap). With --duration, the run has that
    duration and the real moduli. Writes summary.json, curve.csv, run.npz (`mrjax.load_run`) and
    figures. Until then DIR/checkpoint has the state from which --resume continues. A failed run
    leaves its last good state in last_good_state.npz.

    \b
    Examples:
      mrjax simulate case2 --out results
      mrjax simulate case2 --out results --resume         # if that was stopped
      mrjax simulate mine.toml --ensemble 8 --overlap 0.02
      mrjax simulate mine.toml --duration 1e-6 --frames 200 --seed 3
      mrjax simulate case2 --trajectory gsd --animate gif --pdf
      mrjax simulate mine.toml --ensemble 64 --distributed node7:1234,4,0   # 1, 2, 3 elsewhere
    """,
)
@click.argument("recipe", shell_complete=sheet_names("mrjax.recipe.bundled"))
@options.out_option("run")
@click.option("--duration", type=float, metavar="SECONDS", help="Physical time to simulate.")
@click.option(
    "--time-step",
    type=float,
    metavar="SECONDS",
    help="Longest step. By default the largest stable step of the bed, or with --duration "
    "MIN(t_c, t_r)/20 (Eq. 29).",
)
@click.option(
    "--frames",
    type=click.IntRange(1, 1_000_000),
    default=200,
    show_default=True,
    help="Number of recorded times in the duration; in the expected duration if the run goes to "
    "rest.",
)
@click.option(
    "--overlap",
    type=options.Finite(0, MOST_OVERLAP, min_open=True),
    default=OVERLAP,
    show_default=True,
    metavar="RADII",
    help="Largest overlap of the contacts, which are softened accordingly in a run to rest.",
)
@click.option(
    "--ensemble",
    type=click.IntRange(1, 10_000),
    default=1,
    show_default=True,
    help="Number of random starts of runs to rest, with consecutive seeds from --seed.",
)
@click.option(
    "--trajectory",
    type=click.Choice(["gsd", "vtk"]),
    multiple=True,
    help="Writes the positions of all particles in every frame, for OVITO (gsd) or ParaView (vtk).",
)
@click.option(
    "--animate",
    type=click.Choice(["gif", "mp4"]),
    multiple=True,
    help="Writes an animation; MP4 needs ffmpeg.",
)
@options.pdf_option
@options.distributed_option
@options.resume_option
@options.seed_option
@options.dtype_option
@options.quiet_option
@options.json_option
def simulate(**options: Any) -> None:
    """Simulates a recipe and writes the results."""
    start = time.perf_counter()
    request = Request(**options)
    environment.start_jax(request.dtype, devices=request.distributed is None)
    from mrjax.cli.simulate import output, summary
    from mrjax.cli.simulate.run import checkpointed, plan_run, simulate_recipe

    plan = plan_run(request)
    with checkpointed(plan) as checkpoint:
        result = simulate_recipe(plan, checkpoint)
        if result is None:
            return
        made_by = summary.made_by(plan)
        figures = output.figures(plan, result)
        numbers = summary.summary(plan, result, made_by)
        numbers["wall_seconds"] = time.perf_counter() - start
        output.write(plan, result, numbers, figures, made_by)
    output.report(plan, result, numbers)
