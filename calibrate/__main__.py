"""The command `mrjax-calibrate`: fits the parameters of an experiment."""

from collections.abc import Iterable
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrjax import InputError, SimulationError
from mrjax.cli import environment, options, templates
from mrjax.cli.completion import sheet_names
from mrjax.cli.exit_status import EXIT_STATUS, run
from mrjax.cli.terminal import echo
from mrjax.core.text import in_toml

if TYPE_CHECKING:
    from calibrate.calibration import Calibration
    from calibrate.experiment.experiment import Experiment
    from mrjax import Recipe


def _new_experiment(context: click.Context, _option: click.Parameter, file: Path | None) -> None:
    """Writes the template and its readings, and exits."""
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
        f"Put your readings into {readings}, and describe your sample in {file}; then: "
        f"mrjax-calibrate {file} --model column"
    )
    context.exit()


@click.command(
    epilog=EXIT_STATUS,
    help="""Fits an EXPERIMENT: a bundled one (fang2005, synthetic), or a TOML file of samples and
    parameters.

    Writes fit.json, report.md, report.html and figures. Until it is done, DIR/checkpoint stores the
    work that --resume goes on from.

    \b
    Examples:
      mrjax-calibrate --new mine.toml
      mrjax-calibrate fang2005 --out results
      mrjax-calibrate mine.toml --model column --starts 8 --posterior
      mrjax-calibrate mine.toml --model column --starts 8 --posterior --resume   # if stopped
      mrjax-calibrate mine.toml --begin-with closed-form
      mrjax-calibrate mine.toml --leave-one-out
      mrjax-calibrate mine.toml --compare
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
    help="Writes a commented template to FILE, with example readings beside it, and exits.",
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
    help="A cheaper model that is fitted first; --model then starts at its optimum.",
)
@click.option(
    "--starts",
    default=1,
    show_default=True,
    type=click.IntRange(1, 1000),
    help="Number of searches, from points drawn from the priors; the best is kept.",
)
@click.option(
    "--robust",
    type=options.Finite(0, min_open=True),
    metavar="SIGMAS",
    help="Residuals beyond this count linearly, so that outliers have less weight.",
)
@click.option(
    "--compare",
    is_flag=True,
    help="Fits nested columns instead: which effects do the data ask for?",
)
@click.option("--posterior", is_flag=True, help="Samples the posterior; needs mrjax[posterior].")
@click.option("--leave-one-out", is_flag=True, help="Predicts each sample from the others, too.")
@click.option(
    "--predict",
    metavar="RECIPE",
    shell_complete=sheet_names("mrjax.recipe.bundled"),
    help="Predicts a recipe without measurements.",
)
@click.option(
    "--like", metavar="SAMPLE", help="The sample whose parameters the recipe of --predict shares."
)
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
    compare: bool,
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
    if compare:
        _refuse_beside_compare()
    environment.start_jax(dtype)
    import calibrate
    from calibrate.calibration import Options
    from calibrate.experiment.experiment import Experiment
    from mrjax.cli.resume import checkpointed
    from mrjax.io import files

    loaded = Experiment.load(experiment)
    if not quiet and not as_json:
        for name, file in loaded.data_as_understood.items():
            echo(f"Sample {name}: {file.line}")
    _warn(loaded.warnings)  # first, since they may make the work unnecessary
    if compare:
        _compare(
            loaded,
            out,
            starts=starts,
            seed=seed,
            dtype=dtype,
            resume=resume,
            quiet=quiet,
            as_json=as_json,
        )
        return
    _refuse_options(model, begin_with, predict, like)
    run_options = Options(model, begin_with, starts, seed, robust, posterior, leave_one_out)
    run_options.refuse(loaded)
    if predict is not None:
        run_options = replace(run_options, predict=_recipe(loaded, predict, like), like=like)
        run_options.refuse(loaded)
    folder = files.result_folder(Path(out))
    work = dict(
        command="fit", experiment=loaded, model=model, **run_options.fit_options, dtype=dtype
    )
    writes = ["fit.json", "report.md", "report.html"]
    with checkpointed(folder, resume, quiet, writes, **work) as checkpoint:
        calibration = calibrate.run(
            loaded, **run_options.keywords, checkpoint=checkpoint, progress=not quiet
        )
        result = calibration.write(folder, pdf=pdf, progress=not quiet)
    if as_json:
        click.echo(files.as_json(result, ascii_only=True))
    elif not quiet:
        _print(result, folder)
    _warn(result["warnings"][len(loaded.warnings) :])
    _warn_of_misfit(result)
    _refuse_untrusted(calibration, result, folder)


def _refuse_beside_compare() -> None:
    """Refuses options that `--compare` does not take.

    Raises:
      InputError: such an option was given.
    """
    context = click.get_current_context()
    taken = {"experiment", "out", "compare", "starts", "resume", "seed", "dtype", "quiet"}
    for name, value in context.params.items():
        if name in {*taken, "as_json"} or (name, value) == ("model", "column"):
            continue
        if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            raise InputError(
                f"{option}: is not for --compare, which fits nested models with --model column; "
                "leave one of the two out"
            )


def _compare(
    experiment: "Experiment",
    out: str,
    *,
    starts: int,
    seed: int,
    dtype: str,
    resume: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Fits nested models, writes the comparison and prints the verdicts."""
    import calibrate
    from calibrate.comparison import tables
    from mrjax.cli.resume import checkpointed
    from mrjax.io import files

    folder = files.result_folder(Path(out))
    work = dict(command="compare", experiment=experiment, starts=starts, seed=seed, dtype=dtype)
    with checkpointed(folder, resume, quiet, ["compare.json", "compare.md"], **work) as checkpoint:
        comparison = calibrate.compare(
            experiment, starts=starts, seed=seed, checkpoint=checkpoint, progress=not quiet
        )
        result = tables.write(comparison, folder)
    if as_json:
        click.echo(files.as_json(result, ascii_only=True))
    elif not quiet:
        for line in tables.in_words(result):
            echo(line)
        echo(f"Comparison: {folder / 'compare.md'}")


def _print(result: dict[str, Any], folder: Path) -> None:
    """Prints the results, one sentence a line."""
    from calibrate import report

    for line in report.in_words(result):
        echo(line)
    for row in result.get("left_out", []) + result.get("new", []):
        echo(report.line(row))
    echo(f"Report: {folder / 'report.html'}")


def _warn(warnings: Iterable[str]) -> None:
    for warning in warnings:
        echo(f"mrjax-calibrate: warning: {warning}", err=True)


def _warn_of_misfit(result: dict[str, Any]) -> None:
    """Names the worst reading of data that do not fit."""
    from calibrate.report.formatting import when

    if not result["misfit"]:
        return
    worst = max(
        result["predictions"],
        key=lambda row: abs(row["predicted"] - row["measured"]) / row["sigma"],
    )
    _warn(
        [
            f"the data do not fit; sample {worst['sample']}{when(worst)}: {worst['measured']:.4g} "
            f"{worst['unit']} measured, {worst['predicted']:.4g} predicted: check value and unit"
        ]
    )


def _refuse_untrusted(calibration: "Calibration", result: dict[str, Any], folder: Path) -> None:
    """Refuses a result that is not to be trusted.

    Raises:
      SimulationError: it is not; the message says why.
    """
    from calibrate import report

    if not calibration.fit.converged:
        raise SimulationError(
            f"the fit did not converge in {calibration.fit.model_runs} model runs; the results in "
            f"{folder} are marked so: start nearer, or check the data for values that contradict "
            "each other"
        )
    if result["contradicts"]:
        raise SimulationError(
            "the data contradict the model, or each other: p "
            f"{report.by_chance(result['p_value'])}, and residuals are "
            f"{result['residuals_over_range']:.2g} of the range of the readings; the results in "
            f"{folder} are marked so: check values and units, or give larger errors"
        )
    if calibration.faults:
        raise calibration.faults[0]
    if calibration.posterior is not None and not calibration.posterior.converged:
        raise SimulationError(
            f"the samples of the posterior did not converge; those in {folder} are marked so: give "
            "narrower priors"
        )


def _refuse_options(
    model: str, begin_with: str | None, predict: str | None, like: str | None
) -> None:
    """Refuses combinations of options without a meaning."""
    if like is not None and predict is None:
        raise InputError(
            f"--like {like}: says whose parameters a new recipe shares; give --predict"
        )
    cost = ["closed-form", "column", "particles"]
    if begin_with is not None and cost.index(begin_with) >= cost.index(model):
        raise InputError(
            f"--begin-with {begin_with}: is no cheaper than --model {model}; leave it out"
        )


def _recipe(experiment: "Experiment", recipe: str, like: str | None) -> "Recipe":
    """Loads the recipe to be predicted."""
    from mrjax import Recipe

    if like is None:
        names = ", ".join(sample.name for sample in experiment.samples)
        raise InputError(
            f"--predict {recipe}: say which sample's parameters it shares: --like, one of {names}"
        )
    return Recipe.load(recipe)


def main() -> None:
    """Entry point of the command line."""
    run(cli, "mrjax-calibrate")


if __name__ == "__main__":
    main()
