"""`mrjax`: simulates a recipe, recomputes the paper."""

import time
from contextlib import nullcontext
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrjax.cli import commands
from mrjax.simulation.overlap import MOST_OVERLAP, OVERLAP

if TYPE_CHECKING:
    from mrjax.core.run import Run
    from mrjax.simulation.sedimentation import Sedimentation

STEADY_AFTER = 10.0
"""Relaxation times after which a velocity is steady to 5e-5."""
RELAXATIONS = 20.0
"""Length of the run that gives the initial settling velocity to eight digits."""


@click.group(no_args_is_help=False, epilog=commands.EXIT_STATUS)
@click.version_option(package_name="mrjax")
def cli() -> None:
    """Settling of magnetorheological fluids by a differentiable discrete element method."""


@cli.command(
    epilog=commands.EXIT_STATUS,
    help="""Follows the particles of a RECIPE, bundled (case1, case2, case3) or a TOML file.

    From dispersed to rest: the whole sedimentation curve at the recipe's viscosity, with contacts
    softened to a greatest overlap (--overlap). With --duration, that long and with the real
    moduli. Writes summary.json, curve.csv, run.npz (`mrjax.load_run`) and figures; until then, what
    --resume goes on from in DIR/checkpoint. A run that fails leaves its last good state,
    last_good_state.npz.

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
@click.argument("recipe", shell_complete=commands.sheet_names("mrjax.recipe.bundled"))
@commands.out_option("run")
@click.option("--duration", type=float, metavar="SECONDS", help="Physical time to cover.")
@click.option(
    "--time-step",
    type=float,
    metavar="SECONDS",
    help="Longest step; left out, what the bed is stable at, or with --duration MIN(t_c, t_r)/20 "
    "(Eq. 29).",
)
@click.option(
    "--frames",
    type=click.IntRange(1, 1_000_000),
    default=200,
    show_default=True,
    help="Times at which the curve is recorded; to rest, in the expected duration.",
)
@click.option(
    "--overlap",
    type=commands.Finite(0, MOST_OVERLAP, min_open=True),
    default=OVERLAP,
    show_default=True,
    metavar="RADII",
    help="Greatest overlap of contacts to which they are softened on the way to rest.",
)
@click.option(
    "--ensemble",
    type=click.IntRange(1, 10_000),
    default=1,
    show_default=True,
    help="Number of random starts, with seeds from --seed on, to rest.",
)
@click.option(
    "--trajectory",
    type=click.Choice(["gsd", "vtk"]),
    multiple=True,
    help="Writes where all particles are in every frame, for OVITO (gsd) or ParaView (vtk).",
)
@click.option(
    "--animate",
    type=click.Choice(["gif", "mp4"]),
    multiple=True,
    help="Writes a film; MP4 needs ffmpeg.",
)
@commands.pdf_option
@commands.distributed_option
@commands.resume_option
@commands.seed_option
@commands.dtype_option
@commands.quiet_option
@commands.json_option
def simulate(
    recipe: str,
    out: str,
    duration: float | None,
    time_step: float | None,
    frames: int,
    overlap: float,
    ensemble: int,
    trajectory: tuple[str, ...],
    animate: tuple[str, ...],
    pdf: bool,
    distributed: tuple[str | None, int | None, int | None] | None,
    resume: bool,
    seed: int,
    dtype: str,
    quiet: bool,
    as_json: bool,
) -> None:
    """Runs a recipe and writes what was observed."""
    began = time.perf_counter()
    commands.start_jax(dtype, devices=distributed is None)
    import jax
    from tqdm import tqdm

    import mrjax
    from mrjax import figures
    from mrjax.cli import environment
    from mrjax.cli.resume import kept
    from mrjax.core import checks
    from mrjax.io import files, results
    from mrjax.laws import dimensionless, time_scales
    from mrjax.simulation import processes

    if distributed is not None:
        if duration is not None:
            raise click.UsageError("--distributed divides an --ensemble: leave out --duration")
        if resume:
            raise click.UsageError("--resume is of a single process: leave out --distributed")
        processes.join(*distributed)
        environment.find_devices()
    sheet = processes.by_first(lambda: mrjax.Recipe.load(recipe))
    for name, value in (("--duration", duration), ("--time-step", time_step)):
        if value is not None:
            checks.positive(value, name, "s")
    if duration is not None and ensemble > 1:
        raise click.UsageError("--ensemble goes to rest: leave out --duration")
    for ending in animate:
        figures.refuse_without_writer(Path(f"settling.{ending}"))
    folder = processes.by_first(lambda: files.result_folder(Path(out)))
    parameters = sheet.parameters()
    relaxation = float(time_scales.relaxation_time(parameters).max())
    notes = list(sheet.notes)
    if duration is not None and duration < STEADY_AFTER * relaxation:
        notes.append(
            f"the run covers {duration / relaxation:.2g} relaxation times, too few for a settling "
            f"velocity: give --duration {STEADY_AFTER * relaxation:.2g} or more"
        )
    recorded = bool(trajectory or animate)
    shown = not quiet and processes.is_first()
    work = dict(
        command="simulate", recipe=sheet, duration=duration, time_step=time_step, frames=frames
    )
    work |= dict(overlap=overlap, ensemble=ensemble, seed=seed, dtype=dtype, trajectory=recorded)
    writes = ["summary.json", "curve.csv", "run.npz", "settling.png"]
    # Processes keep nothing: each would have to be stopped at the same part.
    keeping = nullcontext() if distributed else kept(folder, resume, quiet, writes, **work)
    if distributed:
        processes.by_first(lambda: results.Results.of(folder).refuse_foreign(writes))
    with results.guarded(folder) if distributed else nullcontext(), keeping as checkpoint:
        start = mrjax.disperse(sheet, seed)
        rise = mrjax.follow(
            start,
            parameters,
            sheet.box,
            duration=RELAXATIONS * relaxation if duration is None else duration,
            frames=frames,
            time_step=time_step if duration is not None else None,
            hindrance=sheet.hindrance,
            trajectory=recorded and duration is not None,
            progress=shown,
            checkpoint=checkpoint and checkpoint / "rise",
        )
        velocity = float(mrjax.settling_velocity(rise))
        numbers = dimensionless.numbers(parameters, velocity)
        warnings = dimensionless.warnings(numbers)
        made_by = commands.made_by(sheet, seed, dtype)
        summary: dict[str, Any] = {
            "recipe": sheet.name,
            "settling_velocity_mm_per_day": mrjax.MM_PER_DAY * velocity,
            "closed_form_mm_per_day": mrjax.MM_PER_DAY * mrjax.terminal_velocity(parameters).mean(),
            **{f"{one.name.lower()}_number": one.value for one in numbers},
            "particles": rise.state.particles,
            "volume_fraction": sheet.volume_fraction,
            "coated_volume_fraction": sheet.coated_volume_fraction,
            "f_w": sheet.f_w,
            "f_w_is_local": sheet.drag.local,
            "f_s": sheet.f_s,
            "f_v": sheet.drag.f_v,
            "f_r": sheet.radius_factor,
        }
        if duration is None:
            whole = mrjax.sedimentation(
                sheet,
                range(seed, seed + ensemble),
                overlap=overlap,
                frames=frames,
                time_step=time_step,
                progress=shown,
                trajectory=recorded,
                checkpoint=checkpoint and checkpoint / "rest",
            )
            processes.leave()
            if not processes.is_first():
                return
            run, columns = whole.run, _curve(whole)
            runs = [jax.tree.map(lambda leaf, row=row: leaf[row], run) for row in range(ensemble)]
            made_by["overlap_radii"] = overlap
            summary |= _at_rest(whole)
            drawn = {
                "settling": figures.sedimentation(whole),
                "concentration": figures.concentration(runs[0]),
                "particles": figures.particles(
                    {"dispersed": start.position, "at rest": runs[0].state.position},
                    runs[0].radius,
                    sheet.box,
                ),
            }
        else:
            run, columns, runs = rise, _columns(rise), [rise]
            drawn = {"settling": figures.settling(rise, parameters)}
        summary |= {
            "duration_s": float(run.times.max()),
            "time_step_s": run.time_step,
            "steps": run.steps,
            "deepest_overlap_radii": run.deepest_overlap.max(),
            "deepest_overlap_coatings": run.coating_overlap.max(),
            "notes": notes,
            "warnings": warnings,
            "steady": duration is None or duration >= STEADY_AFTER * relaxation,
            **made_by,
            "wall_seconds": time.perf_counter() - began,
        }
        files.write_json(folder / "summary.json", summary)
        files.write_csv(folder / "curve.csv", columns)
        mrjax.save_run(folder / "run.npz", runs[0] if ensemble == 1 else run, made_by)
        for name, figure in tqdm(drawn.items(), desc="figures", disable=not shown, leave=False):
            files.write_figure(folder, name, figure, made_by, pdf)
        for number, one in enumerate(runs if recorded else []):
            of_seed = "" if ensemble == 1 else f"-seed-{seed + number}"
            if "gsd" in trajectory:
                mrjax.write_gsd(folder / f"trajectory{of_seed}.gsd", one, made_by)
            if "vtk" in trajectory:
                mrjax.write_vtk(folder / f"trajectory{of_seed}.pvd", one)
            for ending in animate:
                film = folder / f"settling{of_seed}.{ending}"
                figures.save_animation(film, one, progress=shown)
    for warning in warnings:
        commands.echo(f"mrjax: warning: {warning}", err=True)
    if as_json:
        click.echo(files.as_json(summary, ascii_only=True))
    if quiet or as_json:
        return
    for note in notes:
        commands.echo(f"Note: {note}.")
    commands.echo(
        f"{summary['particles']} particles settle at {mrjax.MM_PER_DAY * velocity:.5g} mm/day "
        f"(Eq. 27 with the same factors: {float(summary['closed_form_mm_per_day']):.5g})."
    )
    if duration is None:
        error = summary["final_ratio_standard_error"]
        spread = "" if ensemble == 1 else f" +- {100 * error:.2g}, mean of {ensemble}"
        commands.echo(
            f"They rest after {summary['duration_s']:.3g} s at {100 * summary['final_ratio']:.2f} "
            f"%{spread} of the height; contacts softened to {summary['deepest_overlap_radii']:.2g} "
            f"radii, moduli by a factor of {summary['softening']:.2g}."
        )
    commands.echo(f"Numbers, and where the model holds: {dimensionless.in_words(numbers)}.")
    commands.echo(f"{run.steps} steps of {run.time_step:.3g} s on {jax.default_backend()}.")
    commands.echo(f"Results: {folder}")


def _columns(run: "Run") -> dict[str, Any]:
    """The curve of one run."""
    import mrjax

    return {
        "time_s": run.times,
        "mudline_m": run.mudline,
        "sedimentation_ratio": mrjax.sedimentation_ratio(run),
        "mean_velocity_m_per_s": run.mean_velocity,
    }


def _curve(whole: "Sedimentation") -> dict[str, Any]:
    """The curve of an ensemble: means, and the standard error of the ratio where there is one."""
    import mrjax

    columns = {
        "time_s": whole.run.times[0],
        "mudline_m": whole.run.mudline.mean(axis=0),
        "sedimentation_ratio": whole.ratio().mean(axis=0),
        "mean_velocity_m_per_s": whole.run.mean_velocity.mean(axis=0),
    }
    if len(whole.seeds) > 1:
        columns["standard_error_of_ratio"] = mrjax.standard_error(whole.ratio())
    return columns


def _at_rest(whole: "Sedimentation") -> dict[str, Any]:
    """What a run to rest adds to the summary."""
    import jax

    import mrjax

    final = {name: whole.ratio(name)[:, -1] for name in mrjax.HEIGHTS}
    lines = jax.vmap(mrjax.asymptotes)(whole.run)
    contacts = jax.vmap(
        lambda state: mrjax.coordination_number(state, whole.parameters, whole.run.box)
    )(whole.run.state)
    return {
        "final_ratio": final["top"].mean(),
        "final_ratio_standard_error": mrjax.standard_error(final["top"]),
        "final_ratios": final["top"],
        "final_ratio_by_height": {name: values.mean() for name, values in final.items()},
        "initial_slope_mm_per_day": mrjax.MM_PER_DAY * lines.initial_slope.mean(),
        "asymptotes_cross_at_s": lines.crossing_time.mean(),
        "speed_at_rest_over_initial": (
            whole.run.mean_speed[:, -1] / whole.run.mean_speed.max(axis=1)
        ).max(),
        "coordination_number": contacts.mean(),
        "softening": whole.softening,
        "ensemble": len(whole.seeds),
    }


@cli.command(
    epilog=commands.EXIT_STATUS,
    help="""Writes a commented recipe to FILE, to start from.

    \b
    Example:
      mrjax new mine.toml
    """,
)
@click.argument("file", type=click.Path(path_type=Path))
def new(file: Path) -> None:
    """Copies the template."""
    text = resources.files("mrjax.recipe").joinpath("template.toml").read_text("utf-8")
    commands.write_new({file: text})
    commands.echo(f"Change {file}, then: mrjax check {file}")


@cli.command(
    epilog=commands.EXIT_STATUS,
    help="""Shows all that follows from a RECIPE, bundled or a TOML file, without running it.

    Volume fractions, number of particles, densities, drag factors, the settling velocity, time
    scales, the step and cost of a run to rest; warns where an assumption of the model does not
    hold.

    \b
    Examples:
      mrjax check case2
      mrjax check mine.toml --json
    """,
)
@click.argument("recipe", shell_complete=commands.sheet_names("mrjax.recipe.bundled"))
@commands.quiet_option
@commands.json_option
def check(recipe: str, quiet: bool, as_json: bool) -> None:
    """Prints what follows from a recipe."""
    commands.start_jax("float64")
    import mrjax
    from mrjax.io import files
    from mrjax.simulation import derived

    sheet = mrjax.Recipe.load(recipe)
    quantities, warnings = derived.derived(sheet), derived.warnings(sheet)
    for warning in warnings:
        commands.echo(f"mrjax: warning: {warning}", err=True)
    if as_json:
        found = {
            one.key: {"name": one.name, "value": one.value, "unit": one.unit} for one in quantities
        }
        result = {"recipe": sheet.name, "derived": found, "notes": sheet.notes}
        click.echo(files.as_json(result | {"warnings": warnings}, ascii_only=True))
    if quiet or as_json:
        return
    widest = max(len(one.name) for one in quantities)
    for one in quantities:
        unit = "" if one.unit == "1" else f" {one.unit}"
        commands.echo(f"{one.name:{widest}}  {one.value:.5g}{unit}")
    for note in sheet.notes:
        commands.echo(f"Note: {note}.")


@cli.command(
    epilog=commands.EXIT_STATUS,
    help="""Recomputes every number and plot of Son (2018).

    Writes reproduce.json and reproduce.md: the printed and computed numbers of Table 2 and the
    text side by side, each reproduced, corrected or not reproducible, and why; and the paper's
    figures 2 and 4 to 8 from these results. Takes a few minutes; with --resume less, where it was
    stopped.

    \b
    Example:
      mrjax reproduce --out results
    """,
)
@commands.out_option("reproduce")
@click.option(
    "--ensemble",
    type=click.IntRange(1, 10_000),
    default=3,
    show_default=True,
    help="Random starts for each final ratio, with seeds from --seed on.",
)
@commands.pdf_option
@commands.resume_option
@commands.seed_option
@commands.dtype_option
@commands.quiet_option
@commands.json_option
def reproduce(
    out: str,
    ensemble: int,
    pdf: bool,
    resume: bool,
    seed: int,
    dtype: str,
    quiet: bool,
    as_json: bool,
) -> None:
    """Runs the paper's three cases and writes the comparison."""
    commands.start_jax(dtype)
    from tqdm import tqdm

    import mrjax
    from mrjax.cli.resume import kept
    from mrjax.io import files
    from mrjax.paper import figures as paper_figures
    from mrjax.paper import table as paper

    def report(text: str) -> None:
        if not quiet:
            commands.echo(text, err=True)

    folder = files.result_folder(Path(out))
    work = dict(command="reproduce", ensemble=ensemble, seed=seed, dtype=dtype)
    writes = ["reproduce.json", "reproduce.md"]
    with kept(folder, resume, quiet, writes, **work) as checkpoint:
        runs = paper.simulated(seed, ensemble, report, checkpoint, progress=not quiet)
        report("settling case2 at its viscosity")
        settled = mrjax.sedimentation(
            mrjax.Recipe.load("case2"),
            seed,
            progress=not quiet,
            checkpoint=checkpoint / "settled",
        )
        found = paper.rows(runs)
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
        figures = paper_figures.of_paper(found, runs, settled)
        made_by = {"seed": seed, "dtype": dtype, "versions": commands.versions()}
        for one in tqdm(figures, desc="figures", disable=quiet, leave=False):
            files.write_figure(folder, one.name, one.figure, made_by, pdf)
        shown = "\n".join(
            f"![Fig. {one.number}]({one.name}.png)\n\nFig. {one.number}. {one.caption}\n"
            for one in figures
        )
        files.write_json(folder / "reproduce.json", paper.as_tables(found))
        files.write_text(
            folder / "reproduce.md", f"# Son (2018), recomputed\n\n{table}\n## Figures\n\n{shown}"
        )
    if as_json:
        click.echo(files.as_json(paper.as_tables(found), ascii_only=True))
    elif not quiet:
        for line in table.splitlines():
            commands.echo(line)
        commands.echo(f"Results: {folder}")


def main() -> None:
    """Entry point of the command line."""
    commands.run(cli, "mrjax")


if __name__ == "__main__":
    main()
