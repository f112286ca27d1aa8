"""An experiment fitted with a forward model, prepared again where the fit ends far from its start.

What a forward model does once (the length of a run, the steps of a column) it does for the values
near which it is asked. Where a fit leads far away, that is done anew there.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from calibrate.experiment.experiment import Experiment
from calibrate.least_squares.fit import Fit, fit
from calibrate.models.prediction import ForwardModelMaker
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import fit_with_scatter
from mrjax import SimulationError
from mrjax.io.checkpoint import refuse_foreign

MOST_PREPARED = 4
"""How often at most; a factor of 3 in velocity each."""


def fit_experiment(
    experiment: Experiment,
    model: str | ForwardModelMaker,
    *,
    begin_with: str | ForwardModelMaker | None = None,
    starts: int = 1,
    seed: int = 0,
    robust: float | None = None,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> tuple[Problem, Fit]:
    """The fit, and the problem whose residuals it knows.

    Not converged, too, where it still leads far from where the model was prepared last.

    Args:
      experiment: samples and parameters.
      model: as for `Problem.prepare`.
      begin_with: a cheaper model that is fitted first, from so many starts; the other begins where
        it ends.
      starts, robust, progress: as for `fit`.
      checkpoint: folder that keeps simulated beds and what the models gave, as for `fit`.
      seed: of the starts, and of suspensions that are simulated.

    Raises:
      InputError: a suspension that cannot be made, or a model that cannot be asked for what was
        measured; or a checkpoint of another fit.
      SimulationError: the fit that was to begin with did not converge.
    """
    refuse_foreign(checkpoint)
    near = None
    if begin_with is not None:
        _, first = fit_experiment(
            experiment,
            begin_with,
            starts=starts,
            seed=seed,
            robust=robust,
            progress=progress,
            checkpoint=checkpoint and Path(checkpoint) / "begin-with",
        )
        if not first.converged:
            raise SimulationError(
                "the cheaper model did not converge, so that there is nothing to begin with: leave "
                "it out, or start nearer"
            )
        near, starts = first.theta, 1
    spent = 0
    for number in range(MOST_PREPARED):
        folder = checkpoint and Path(checkpoint) / f"prepared-{number}"
        problem = Problem.prepare(experiment, model, seed, near, folder)
        problem, result = _fitted(
            problem, starts=starts, seed=seed, robust=robust, progress=progress, checkpoint=folder
        )
        spent += result.model_runs
        holds = problem.holds_at(result.theta)
        if holds:
            break
        near, starts = result.theta, 1
    return problem, replace(result, converged=result.converged and holds, model_runs=spent)


def _fitted(
    problem: Problem, *, starts: int, checkpoint: str | Path | None, **options: Any
) -> tuple[Problem, Fit]:
    """The fit of a prepared problem, with the scatter of its velocities where it is to be fitted.

    Args:
      problem: where its models are prepared, the search begins.
      starts, checkpoint, options: as for `fit`.
    """
    common = dict(priors=problem.priors, bounds=problem.bounds, **options)
    if not any(sample.scatter_to_fit for sample in problem.experiment.samples):
        found = fit(problem.residuals, problem.near, starts=starts, checkpoint=checkpoint, **common)
        return problem, found
    residuals, begin, many = problem.residuals_with, problem.near, starts

    def fit_errors(with_errors: Problem, number: int) -> Fit:
        nonlocal begin, many
        folder = checkpoint and Path(checkpoint) / f"scatter-{number}"
        errors = with_errors.errors  # as data: one compiled program for all rounds
        found = fit(residuals, begin, data=errors, starts=many, checkpoint=folder, **common)
        begin, many = found.theta, 1
        return found

    return fit_with_scatter(problem, fit_errors)


calibrated = fit_experiment
"""Its name of before."""
