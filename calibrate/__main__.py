"""`mrjax-calibrate`: fits the drag factors of an experiment."""

import time
from pathlib import Path

import click
import numpy as np

from mrjax import SimulationError, commands, files


@click.command(
    help="""Fits an EXPERIMENT, bundled (fang2005) or a TOML file of samples and parameters.

    Writes fit.json, report.md and figures of the predictions and the search.

    \b
    Examples:
      mrjax-calibrate fang2005 --out results
      mrjax-calibrate mine.toml --model closed-form --out results
    """
)
@click.version_option(package_name="mrjax")
@click.argument("experiment")
@commands.out_option("fit")
@click.option(
    "--model",
    default="particles",
    show_default=True,
    type=click.Choice(["particles", "closed-form"]),
    help="Forward model: a simulation of all particles, or Eq. 27.",
)
@commands.seed_option
@commands.dtype_option
@click.option("--quiet", is_flag=True, help="No progress, no summary.")
def cli(experiment: str, out: str, model: str, seed: int, dtype: str, quiet: bool) -> None:
    """Fits an experiment and reports."""
    from calibrate import report
    from calibrate.data import Experiment
    from calibrate.fit import fit
    from calibrate.identify import identify
    from calibrate.residuals import Problem

    began = time.perf_counter()
    commands.set_precision(dtype)
    loaded = Experiment.load(experiment)
    folder = files.result_folder(Path(out))
    problem = Problem.prepare(loaded, model, seed)
    fitted = fit(problem.residuals, problem.start, priors=problem.priors, progress=not quiet)
    # Outside the compiled fit a simulation checks itself and raises where it is not to be trusted.
    predicted = np.asarray(problem.predict(fitted.theta))
    result = report.summary(problem, fitted, identify(fitted), predicted)
    result |= {
        "experiment": loaded.name,
        "model": model,
        "seed": seed,
        "dtype": dtype,
        "versions": commands.versions(),
        "wall_seconds": time.perf_counter() - began,
    }
    report.write(folder, loaded.name, model, fitted, result)
    if not quiet:
        click.echo("\n".join(report.in_words(result)))
        click.echo(f"Report: {folder / 'report.md'}")
    if result["misfit"]:
        worst = max(
            result["predictions"],
            key=lambda one: abs(one["predicted"] - one["measured"]) / one["sigma"],
        )
        click.echo(
            f"mrjax-calibrate: warning: the data do not fit; sample {worst['sample']}: "
            f"{worst['measured']:.4g} {worst['unit']} measured, {worst['predicted']:.4g} "
            "predicted: check value and unit",
            err=True,
        )
    if not fitted.converged:
        raise SimulationError(
            f"the fit did not converge in {fitted.model_runs} model runs; what {folder} holds is "
            "marked so: start nearer, or check the data for values that contradict each other"
        )


def main() -> None:
    """Entry point of the command line."""
    commands.run(cli, "mrjax-calibrate")


if __name__ == "__main__":
    main()
