"""The files that `mrjax simulate` writes, and its output on the terminal."""

from typing import Any

import click
import jax
from matplotlib.figure import Figure
from tqdm import tqdm

import mrjax
from mrjax import figures as drawing
from mrjax.cli.simulate import summary
from mrjax.cli.simulate.run import Plan, Result
from mrjax.cli.terminal import echo
from mrjax.io import files
from mrjax.laws import dimensionless


def figures(plan: Plan, result: Result) -> dict[str, Figure]:
    """Draws the figures; returns them by the names of their files."""
    if result.to_rest is None:
        return {"settling": drawing.settling(result.initial, plan.parameters)}
    first = result.runs[0]
    return {
        "settling": drawing.sedimentation(result.to_rest),
        "concentration": drawing.concentration(first),
        "particles": drawing.particles(
            {"dispersed": result.start.position, "at rest": first.state.position},
            first.radius,
            plan.sheet.box,
        ),
    }


def write(
    plan: Plan,
    result: Result,
    numbers: dict[str, Any],
    figures: dict[str, Figure],
    made_by: dict[str, Any],
) -> None:
    """Writes all result files.

    Args:
      plan: decisions before the run.
      result: the runs.
      numbers: content of summary.json, from `summary.summary`.
      figures: figures by the names of their files.
      made_by: provenance, which is stored with the run, its trajectory and the figures.
    """
    request, folder, runs = plan.request, plan.folder, result.runs
    files.write_json(folder / "summary.json", numbers)
    files.write_csv(folder / "curve.csv", summary.curve(result))
    mrjax.save_run(folder / "run.npz", runs[0] if request.ensemble == 1 else result.run, made_by)
    bars = tqdm(figures.items(), desc="figures", disable=not plan.progress, leave=False)
    for name, figure in bars:
        files.write_figure(folder, name, figure, made_by, request.pdf)
    if not request.records_trajectory:
        return
    for seed, run in zip(request.seeds, runs, strict=True):
        suffix = "" if request.ensemble == 1 else f"-seed-{seed}"
        if "gsd" in request.trajectory:
            mrjax.write_gsd(folder / f"trajectory{suffix}.gsd", run, made_by)
        if "vtk" in request.trajectory:
            mrjax.write_vtk(folder / f"trajectory{suffix}.pvd", run)
        for ending in request.animate:
            film = folder / f"settling{suffix}.{ending}"
            drawing.save_animation(film, run, progress=plan.progress)


def report(plan: Plan, result: Result, numbers: dict[str, Any]) -> None:
    """Prints warnings, and the summary as JSON or as sentences."""
    request = plan.request
    for warning in numbers["warnings"]:
        echo(f"mrjax: warning: {warning}", err=True)
    if request.as_json:
        click.echo(files.as_json(numbers, ascii_only=True))
    if request.quiet or request.as_json:
        return
    for note in numbers["notes"]:
        echo(f"Note: {note}.")
    echo(
        f"{numbers['particles']} particles settle at {mrjax.MM_PER_DAY * result.velocity:.5g} "
        "mm/day (Eq. 27 with the same factors: "
        f"{float(numbers['closed_form_mm_per_day']):.5g})."
    )
    if request.to_rest:
        error = numbers["final_ratio_standard_error"]
        ensemble = request.ensemble
        spread = "" if ensemble == 1 else f" +- {100 * error:.2g}, mean of {ensemble}"
        echo(
            f"They rest after {numbers['duration_s']:.3g} s at {100 * numbers['final_ratio']:.2f} "
            f"%{spread} of the height; contacts softened to {numbers['deepest_overlap_radii']:.2g} "
            f"radii, moduli by a factor of {numbers['softening']:.2g}."
        )
    ranges = dimensionless.in_words(summary.dimensionless_numbers(plan, result))
    echo(f"Dimensionless numbers, with the ranges in which the model holds: {ranges}.")
    steps, step = result.run.steps, result.run.time_step
    echo(f"{steps} steps of {step:.3g} s on {jax.default_backend()}.")
    echo(f"Results: {plan.folder}")
