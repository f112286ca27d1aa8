"""`mrjax`: simulates a recipe, recomputes the paper."""

import time
from pathlib import Path

import click

from mrjax import commands, files

STEADY_AFTER = 10.0
"""Relaxation times after which a velocity is steady to 5e-5."""


@click.group(no_args_is_help=False)
@click.version_option(package_name="mrjax")
def cli() -> None:
    """Settling of magnetorheological fluids by a differentiable discrete element method."""


@cli.command(
    help="""Follows the particles of a RECIPE, bundled (case1, case2, case3) or a TOML file.

    Writes summary.json, curve.csv and settling.png. Without --duration the run covers 20
    relaxation times, in which the initial settling velocity is reached to eight digits.

    \b
    Examples:
      mrjax simulate case2 --out results
      mrjax simulate mine.toml --duration 1e-6 --frames 200 --seed 3
    """
)
@click.argument("recipe")
@commands.out_option("run")
@click.option("--duration", type=float, metavar="SECONDS", help="Physical time to cover.")
@click.option(
    "--time-step",
    type=float,
    metavar="SECONDS",
    help="Longest step; left out, MIN(t_c, t_r)/20 (Eq. 29), or t_r/20 while nothing can touch.",
)
@click.option(
    "--frames",
    type=click.IntRange(1, 1_000_000),
    default=100,
    show_default=True,
    help="Times at which the curve is recorded.",
)
@commands.seed_option
@commands.dtype_option
@click.option("--quiet", is_flag=True, help="No summary on the terminal.")
def simulate(
    recipe: str,
    out: str,
    duration: float | None,
    time_step: float | None,
    frames: int,
    seed: int,
    dtype: str,
    quiet: bool,
) -> None:
    """Runs a recipe and writes what was observed."""
    import jax

    import mrjax
    from mrjax import checks, figures, timestep

    began = time.perf_counter()
    commands.set_precision(dtype)
    sheet = mrjax.Recipe.load(recipe)
    for name, value in (("--duration", duration), ("--time-step", time_step)):
        if value is not None:
            checks.positive(value, name, "s")
    folder = files.result_folder(Path(out))
    parameters = sheet.parameters()
    relaxation = float(timestep.relaxation_time(parameters).max())
    if duration is None:
        duration = 20.0 * relaxation
    notes = list(sheet.notes)
    if duration < STEADY_AFTER * relaxation:
        notes.append(
            f"the run covers {duration / relaxation:.2g} relaxation times, too few for a settling "
            f"velocity: give --duration {STEADY_AFTER * relaxation:.2g} or more"
        )
    run = mrjax.simulate(
        mrjax.disperse(sheet, seed),
        parameters,
        sheet.box,
        duration=duration,
        frames=frames,
        time_step=time_step,
    )
    velocity = float(mrjax.settling_velocity(run))
    ratio = mrjax.sedimentation_ratio(run)
    summary = {
        "recipe": sheet.name,
        "settling_velocity_mm_per_day": figures.MM_PER_DAY * velocity,
        "closed_form_mm_per_day": figures.MM_PER_DAY * mrjax.terminal_velocity(parameters).mean(),
        "reynolds_number": mrjax.reynolds_number(velocity, parameters).max(),
        "particles": run.state.particles,
        "volume_fraction": sheet.volume_fraction,
        "coated_volume_fraction": sheet.coated_volume_fraction,
        "f_w": sheet.f_w,
        "f_s": sheet.f_s,
        "f_v": sheet.drag.f_v,
        "f_r": sheet.radius_factor,
        "duration_s": duration,
        "time_step_s": run.time_step,
        "steps": run.steps,
        "deepest_overlap_radii": run.deepest_overlap,
        "deepest_overlap_coatings": run.coating_overlap,
        "seed": seed,
        "dtype": dtype,
        "notes": notes,
        "steady": duration >= STEADY_AFTER * relaxation,
        "versions": commands.versions(),
        "wall_seconds": time.perf_counter() - began,
    }
    files.write_json(folder / "summary.json", summary)
    files.write_csv(
        folder / "curve.csv",
        {
            "time_s": run.times,
            "mudline_m": run.mudline,
            "sedimentation_ratio": ratio,
            "mean_velocity_m_per_s": run.mean_velocity,
        },
    )
    figures.settling(run, parameters).savefig(folder / "settling.png", dpi=150)
    if not quiet:
        for note in notes:
            click.echo(f"Note: {note}.")
        click.echo(
            f"{run.state.particles} particles settle at {figures.MM_PER_DAY * velocity:.5g} mm/day "
            f"(Eq. 27 with the same factors: {float(summary['closed_form_mm_per_day']):.5g}); "
            f"{run.steps} steps of {run.time_step:.3g} s on {jax.default_backend()}."
        )
        click.echo(f"Results: {folder}")


@cli.command(
    help="""Recomputes every number of Son (2018), Table 2 and text.

    Writes reproduce.json and reproduce.md: printed and computed numbers side by side, each
    reproduced, corrected or not reproducible, and why.

    \b
    Example:
      mrjax reproduce --out results
    """
)
@commands.out_option("reproduce")
@commands.seed_option
@commands.dtype_option
@click.option("--quiet", is_flag=True, help="No progress, no table on the terminal.")
def reproduce(out: str, seed: int, dtype: str, quiet: bool) -> None:
    """Runs the paper's three cases and writes the comparison."""
    from mrjax import reproduce as paper

    commands.set_precision(dtype)
    folder = files.result_folder(Path(out))
    found = paper.rows(seed, report=lambda text: None if quiet else click.echo(text, err=True))
    files.write_json(folder / "reproduce.json", paper.as_tables(found))
    table = files.markdown_table(
        ["case", "quantity", "printed", "computed", "unit", "status", "reason"],
        (
            [
                one.case,
                one.quantity,
                f"{one.printed:g}",
                "" if one.computed is None else f"{one.computed:.6g}",
                one.unit,
                one.status,
                one.reason,
            ]
            for one in found
        ),
    )
    files.write_text(folder / "reproduce.md", f"# Son (2018), recomputed\n\n{table}")
    if not quiet:
        click.echo(table)


def main() -> None:
    """Entry point of the command line."""
    commands.run(cli, "mrjax")


if __name__ == "__main__":
    main()
