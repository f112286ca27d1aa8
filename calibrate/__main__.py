"""`mrjax-calibrate`: fits the drag factors of an experiment."""

import time
from pathlib import Path

import click
import numpy as np

from mrjax import InputError, SimulationError, commands, files


@click.command(
    help="""Fits an EXPERIMENT, bundled (fang2005, synthetic) or a TOML file of samples and
    parameters.

    Writes fit.json, report.md, report.html and figures.

    \b
    Examples:
      mrjax-calibrate fang2005 --out results
      mrjax-calibrate mine.toml --model column --starts 8 --posterior
      mrjax-calibrate mine.toml --begin-with closed-form
      mrjax-calibrate mine.toml --leave-one-out
      mrjax-calibrate mine.toml --predict new.toml --like A
    """
)
@click.version_option(package_name="mrjax")
@click.argument("experiment")
@commands.out_option("fit")
@click.option(
    "--model",
    default="particles",
    show_default=True,
    type=click.Choice(["particles", "column", "closed-form"]),
    help="Forward model: a simulation of all particles, of layers in the tube, or Eq. 27.",
)
@click.option(
    "--begin-with",
    type=click.Choice(["column", "closed-form"]),
    help="A cheaper model that is fitted first; the other begins where it ends.",
)
@click.option(
    "--starts",
    default=1,
    show_default=True,
    type=click.IntRange(1, 1000),
    help="Searches from as many points, drawn from the priors; the best is kept.",
)
@click.option(
    "--robust",
    type=click.FloatRange(0, min_open=True),
    metavar="SIGMAS",
    help="Residuals beyond this count linearly, so that outliers pull less.",
)
@click.option("--posterior", is_flag=True, help="Samples the posterior; needs mrjax[posterior].")
@click.option("--leave-one-out", is_flag=True, help="Predicts each sample from the others, too.")
@click.option("--predict", metavar="RECIPE", help="Predicts a recipe that was not measured.")
@click.option("--like", metavar="SAMPLE", help="The sample whose parameters that recipe shares.")
@commands.seed_option
@commands.dtype_option
@click.option("--quiet", is_flag=True, help="No progress, no summary.")
def cli(
    experiment: str,
    out: str,
    model: str,
    begin_with: str | None,
    starts: int,
    robust: float | None,
    posterior: bool,
    leave_one_out: bool,
    predict: str | None,
    like: str | None,
    seed: int,
    dtype: str,
    quiet: bool,
) -> None:
    """Fits an experiment and reports."""
    from calibrate import forecast, plots, report
    from calibrate.data import Experiment
    from calibrate.fit import fit
    from calibrate.identify import identify
    from calibrate.posterior import posterior as sampled
    from calibrate.profile import profiles
    from calibrate.residuals import Problem

    began = time.perf_counter()
    commands.set_precision(dtype)
    loaded = Experiment.load(experiment)
    new = None if predict is None else _new(loaded, predict, like)
    folder = files.result_folder(Path(out))
    problem = Problem.prepare(loaded, model, seed)
    checkpoint = folder / "search.json"
    if checkpoint.exists() and not quiet:
        click.echo(f"Going on with the search kept in {checkpoint}.", err=True)
    try:
        start = problem.start
        if begin_with is not None:
            cheap = Problem.prepare(loaded, begin_with, seed)
            start = fit(
                cheap.residuals, start, priors=cheap.priors, starts=starts, seed=seed, robust=robust
            ).theta
        fitted = fit(
            problem.residuals,
            start,
            priors=problem.priors,
            starts=1 if begin_with else starts,
            seed=seed,
            robust=robust,
            progress=not quiet,
            checkpoint=checkpoint,
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    # Outside the compiled fit a simulation checks itself and raises where it is not to be trusted.
    predicted = np.asarray(problem.predict(fitted.theta))
    usable = fitted.converged
    held = profiles(fitted) if usable else ()
    samples = sampled(fitted, seed) if posterior and usable else None
    result = report.summary(problem, fitted, identify(fitted), predicted, held, samples)
    fault = None
    if leave_one_out:
        try:
            result["left_out"] = report.forecasts(forecast.leave_one_out(loaded, model, seed))
        except SimulationError as error:  # the fit itself is written all the same
            fault = error
    if new is not None and usable:
        result["new"] = report.forecasts(forecast.forecast(new[0], fitted, new[1], model, seed))
    result |= {
        "experiment": loaded.name,
        "model": model,
        "begun_with": begin_with,
        "seed": seed,
        "dtype": dtype,
        "versions": commands.versions(),
        "wall_seconds": time.perf_counter() - began,
    }
    figures = plots.figures(problem, fitted, result, held, samples)
    report.write(folder, report.markdown(loaded.name, model, result, figures), result, figures)
    if not quiet:
        click.echo("\n".join(report.in_words(result)))
        for one in result.get("left_out", []) + result.get("new", []):
            click.echo(report.line(one))
        click.echo(f"Report: {folder / 'report.html'}")
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
    if fault is not None:
        raise fault
    if samples is not None and not samples.converged:
        raise SimulationError(
            f"the samples of the posterior did not converge; what {folder} holds of them is marked "
            "so: give narrower priors"
        )


def _new(experiment, recipe: str, like: str | None):
    """The recipe to be predicted as a sample, and the experiment that says what applies to it."""
    from calibrate import forecast
    from mrjax import Recipe

    if like is None:
        known = ", ".join(sample.name for sample in experiment.samples)
        raise InputError(
            f"--predict {recipe}: say which sample's parameters it shares: --like, one of {known}"
        )
    return forecast.like(experiment, Recipe.load(recipe), like)


def main() -> None:
    """Entry point of the command line."""
    commands.run(cli, "mrjax-calibrate")


if __name__ == "__main__":
    main()
