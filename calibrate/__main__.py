"""`mrjax-calibrate`: fits the drag factors of an experiment."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrjax import InputError, SimulationError
from mrjax.cli import environment, options, provenance, templates
from mrjax.cli.completion import sheet_names
from mrjax.cli.exit_status import EXIT_STATUS, run
from mrjax.cli.terminal import echo
from mrjax.core.text import in_toml

if TYPE_CHECKING:
    from calibrate.experiment.experiment import Experiment
    from calibrate.experiment.sample import Sample


def _new_experiment(context: click.Context, _option: click.Parameter, file: Path | None) -> None:
    """Writes the template and its readings, and ends."""
    if file is None or context.resilient_parsing:
        return
    if file.suffix != ".toml":
        raise InputError(f"--new {file}: must end in .toml; the readings go beside it, in .csv")
    readings = file.with_suffix(".csv")
    template, example = (
        resources.files("calibrate.experiment").joinpath(name).read_text("utf-8")
        for name in ("template.toml", "template.csv")
    )
    template = template.replace('"template.csv"', in_toml(readings.name))
    templates.write_new({file: template, readings: example})
    echo(
        f"Put your readings into {readings}, and into {file} what they are of; then: "
        f"mrjax-calibrate {file} --model column"
    )
    context.exit()


@click.command(
    epilog=EXIT_STATUS,
    help="""Fits an EXPERIMENT, bundled (fang2005, synthetic) or a TOML file of samples and
    parameters.

    Writes fit.json, report.md, report.html and figures; until then, what --resume goes on from in
    DIR/checkpoint.

    \b
    Examples:
      mrjax-calibrate --new mine.toml
      mrjax-calibrate fang2005 --out results
      mrjax-calibrate mine.toml --model column --starts 8 --posterior
      mrjax-calibrate mine.toml --model column --starts 8 --posterior --resume   # if stopped
      mrjax-calibrate mine.toml --begin-with closed-form
      mrjax-calibrate mine.toml --leave-one-out
      mrjax-calibrate mine.toml --predict new.toml --like A
    """,
)
@click.version_option(package_name="mrjax")
@click.option(
    "--new",
    type=click.Path(path_type=Path),
    is_eager=True,
    expose_value=False,
    callback=_new_experiment,
    metavar="FILE",
    help="Writes a commented experiment to FILE, to start from, and readings beside it; then ends.",
)
@click.argument("experiment", shell_complete=sheet_names("calibrate.experiment.bundled"))
@options.out_option("fit")
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
    type=options.Finite(0, min_open=True),
    metavar="SIGMAS",
    help="Residuals beyond this count linearly, so that outliers pull less.",
)
@click.option("--posterior", is_flag=True, help="Samples the posterior; needs mrjax[posterior].")
@click.option("--leave-one-out", is_flag=True, help="Predicts each sample from the others, too.")
@click.option(
    "--predict",
    metavar="RECIPE",
    shell_complete=sheet_names("mrjax.recipe.bundled"),
    help="Predicts a recipe that was not measured.",
)
@click.option("--like", metavar="SAMPLE", help="The sample whose parameters that recipe shares.")
@options.pdf_option
@options.resume_option
@options.seed_option
@options.dtype_option
@options.quiet_option
@options.json_option
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
    pdf: bool,
    resume: bool,
    seed: int,
    dtype: str,
    quiet: bool,
    as_json: bool,
) -> None:
    """Fits an experiment and reports."""
    began = time.perf_counter()
    environment.start_jax(dtype)
    import numpy as np

    from calibrate import report
    from calibrate.experiment.experiment import Experiment
    from calibrate.inference import forecast
    from calibrate.inference.identify import identify
    from calibrate.inference.posterior import posterior as sampled
    from calibrate.inference.posterior import refuse_without_sampler
    from calibrate.inference.profile import profiles
    from calibrate.problem.solve import fit_experiment
    from calibrate.report import figures as report_figures
    from mrjax.cli.resume import checkpointed
    from mrjax.io import files

    loaded = Experiment.load(experiment)
    for warning in loaded.warnings:  # before the work that it may save
        echo(f"mrjax-calibrate: warning: {warning}", err=True)
    _refuse_options(model, begin_with, predict, like)
    if leave_one_out:
        forecast.refuse_leaving_out(loaded)
    if posterior:
        refuse_without_sampler()
    new = None if predict is None else _new(loaded, predict, like)
    folder = files.result_folder(Path(out))
    choices: dict[str, Any] = dict(begin_with=begin_with, starts=starts, seed=seed, robust=robust)
    work = dict(command="fit", experiment=loaded, model=model, **choices, dtype=dtype)
    writes = ["fit.json", "report.md", "report.html"]
    with checkpointed(folder, resume, quiet, writes, **work) as checkpoint:
        try:
            problem, fitted = fit_experiment(
                loaded, model, **choices, progress=not quiet, checkpoint=checkpoint / "fit"
            )
        except ValueError as error:
            raise InputError(str(error)) from None
        if not np.isfinite(fitted.jacobian).all() or not np.isfinite(fitted.values).all():
            raise SimulationError(
                f"the fit ended in {fitted.model_runs} model runs where nothing can be predicted; "
                "give medians from which something can, or more --starts"
            )
        # Outside the compiled fit a simulation checks itself and raises if not to be trusted.
        predicted = np.asarray(problem.predict(fitted.theta))
        usable = fitted.converged
        held = profiles(fitted, progress=not quiet) if usable else ()
        # What goes wrong from here on is told when the fit itself is written.
        faults: list[Exception] = []
        samples, further = None, {}
        if posterior and usable:
            with _told_later(faults):
                samples = sampled(
                    fitted, seed, checkpoint=checkpoint / "posterior", progress=not quiet
                )
        if leave_one_out:
            with _told_later(faults):
                left_out = forecast.leave_one_out(
                    loaded,
                    model,
                    **choices,
                    checkpoint=checkpoint / "left-out",
                    progress=not quiet,
                )
                further["left_out"] = report.forecasts(left_out)
        if new is not None and usable:
            with _told_later(faults):
                expected = forecast.forecast(
                    new[0], fitted, new[1], model, seed, checkpoint / "forecast"
                )
                further["new"] = report.forecasts(expected)
        result = report.summary(problem, fitted, identify(fitted), predicted, held, samples)
        result |= further
        result |= {
            "experiment": loaded.name,
            "lab_sheets": {
                sample.name: sample.recipe.model_dump(mode="json", exclude_none=True)
                for sample in loaded.samples
            },
            "model": model,
            "begun_with": begin_with,
            "seed": seed,
            "dtype": dtype,
            "versions": provenance.versions(),
            "wall_seconds": time.perf_counter() - began,
        }
        figures = report_figures.figures(problem, fitted, result, held, samples)
        text = report.markdown(loaded.name, model, result, figures)
        report.write(folder, text, result, figures, pdf, progress=not quiet)
    if as_json:
        click.echo(files.as_json(result, ascii_only=True))
    elif not quiet:
        for line in report.in_words(result):
            echo(line)
        for one in result.get("left_out", []) + result.get("new", []):
            echo(report.line(one))
        echo(f"Report: {folder / 'report.html'}")
    for warning in result["warnings"][len(loaded.warnings) :]:
        echo(f"mrjax-calibrate: warning: {warning}", err=True)
    if result["misfit"]:
        worst = max(
            result["predictions"],
            key=lambda one: abs(one["predicted"] - one["measured"]) / one["sigma"],
        )
        echo(
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
    if result["contradicts"]:
        raise SimulationError(
            "the data contradict the model, or each other: p "
            f"{report.by_chance(result['p_value'])}, and residuals are "
            f"{result['residuals_over_range']:.2g} of the range of the readings; what {folder} "
            "holds is marked so: check values and units, or give larger errors"
        )
    if faults:
        raise faults[0]
    if samples is not None and not samples.converged:
        raise SimulationError(
            f"the samples of the posterior did not converge; what {folder} holds of them is marked "
            "so: give narrower priors"
        )


@contextmanager
def _told_later(faults: list[Exception]) -> Iterator[None]:
    try:
        yield
    except (InputError, SimulationError) as error:
        faults.append(error)


def _refuse_options(
    model: str, begin_with: str | None, predict: str | None, like: str | None
) -> None:
    """Refuses options that mean nothing together."""
    if like is not None and predict is None:
        raise InputError(
            f"--like {like}: says whose parameters a new recipe shares; give --predict"
        )
    cost = ["closed-form", "column", "particles"]
    if begin_with is not None and cost.index(begin_with) >= cost.index(model):
        raise InputError(
            f"--begin-with {begin_with}: is no cheaper than --model {model}; leave it out"
        )


def _new(experiment: "Experiment", recipe: str, like: str | None) -> "tuple[Experiment, Sample]":
    """The recipe to be predicted as a sample, and the experiment that says what applies to it."""
    from calibrate.inference import forecast
    from mrjax import Recipe

    if like is None:
        known = ", ".join(sample.name for sample in experiment.samples)
        raise InputError(
            f"--predict {recipe}: say which sample's parameters it shares: --like, one of {known}"
        )
    return forecast.like(experiment, Recipe.load(recipe), like)


def main() -> None:
    """Entry point of the command line."""
    run(cli, "mrjax-calibrate")


if __name__ == "__main__":
    main()
