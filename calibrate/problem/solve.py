"""Fits an experiment with a forward model, and prepares the model again if the fit ends far away.

A forward model does some work only once, such as choosing the length of a run. It does so for the
values that it is prepared for. If the fit ends far from these values, the model is prepared again
at the end of the fit, and the fit goes on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from calibrate.experiment.experiment import Experiment
from calibrate.least_squares.fit import Fit, fit
from calibrate.least_squares.optima import with_others
from calibrate.models.prediction import ForwardModelMaker
from calibrate.problem.beginnings import Beginnings, beginnings
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import (
    fit_with_scatter,
    with_freedom,
    with_scatter,
)
from mrjax import SimulationError
from mrjax.io.checkpoint import refuse_foreign

MOST_PREPARED = 4
"""Most preparations of the model in one fit; each allows a factor of 3 in velocity."""


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
    """Fits an experiment with a forward model.

    The fit starts at the optima of a cheap model, if there is one; these are searched over the
    whole range of the priors. The fit has not converged if it ends far from the values that the
    model was last prepared for.

    Args:
      experiment: samples and parameters.
      model: as for `Problem.prepare`.
      begin_with: a cheaper model that is fitted first, with all `starts`; the fit of `model` then
        starts at its optimum.
      starts, robust, progress: as for `fit`.
      checkpoint: folder that stores simulated beds and results of the models, as for `fit`.
      seed: seed of the starts, and of simulated suspensions.

    Returns:
      the problem whose residuals were fitted, and the fit.

    Raises:
      InputError: a suspension that cannot be made, a model that does not predict what was
        measured, or a checkpoint of another fit.
      SimulationError: the fit of the cheaper model did not converge.
    """
    refuse_foreign(checkpoint)
    common: dict[str, Any] = dict(seed=seed, robust=robust, progress=progress)
    if begin_with is not None:
        first = _fit_cheaper(
            experiment,
            begin_with,
            starts=starts,
            checkpoint=checkpoint and Path(checkpoint) / "begin-with",
            **common,
        )
        starts = 1
        start = Beginnings([first.theta], list(first.optima[1:]), first.places)
    else:
        start = beginnings(experiment, model, seed, robust)
    near, *promising = start.promising
    others, places, spent = start.others, start.places + starts, 0
    for number in range(MOST_PREPARED):
        folder = checkpoint and Path(checkpoint) / f"prepared-{number}"
        problem = Problem.prepare(experiment, model, seed, near, folder)
        problem, result = _fit_problem(
            problem,
            starts=starts,
            also=[theta for theta in promising if problem.holds_at(theta)],
            checkpoint=folder,
            **common,
        )
        spent += result.model_runs
        holds = problem.holds_at(result.theta)
        if holds:
            break
        near, starts, promising = result.theta, 1, []
        others += result.optima[1:]
    result = replace(result, converged=result.converged and holds, model_runs=spent)
    return problem, replace(result, optima=with_others(result.optima, others), places=places)


def fit_from_start(
    experiment: Experiment, model: str | ForwardModelMaker, **options: Any
) -> tuple[Problem, Fit]:
    """Fits an experiment from its start alone, without a search of the whole range of the priors.

    Args:
      experiment, model: as for `fit_experiment`.
      options: `seed`, `checkpoint`, `robust` and `progress` of `fit_experiment`.
    """
    folder = options.pop("checkpoint", None)
    problem = Problem.prepare(experiment, model, options.get("seed", 0), None, folder)
    return _fit_problem(problem, starts=1, also=[], checkpoint=folder, **options)


def _fit_cheaper(experiment: Experiment, model: str | ForwardModelMaker, **options: Any) -> Fit:
    """The fit of a cheaper model.

    Raises:
      SimulationError: it did not converge.
    """
    _, first = fit_experiment(experiment, model, **options)
    if not first.converged:
        raise SimulationError(
            "the fit of the cheaper model did not converge, so that it gives no start: leave "
            "it out, or start nearer"
        )
    return first


def _fit_problem(
    problem: Problem,
    *,
    starts: int,
    also: Sequence[Mapping[str, float]],
    checkpoint: str | Path | None,
    **options: Any,
) -> tuple[Problem, Fit]:
    """Fits a prepared problem, and the scatter of its readings if that is to be estimated.

    Args:
      problem: the search starts at the values that its models are prepared for.
      starts, also, checkpoint, options: as for `fit`.
    """
    common: dict[str, Any] = dict(priors=problem.priors, bounds=problem.bounds, **options)
    if not any(sample.scatter_to_fit for sample in problem.experiment.samples):
        begin: dict[str, Any] = dict(starts=starts, also=also, checkpoint=checkpoint)
        return problem, fit(problem.residuals, problem.near, **begin, **common)
    residuals, near = problem.residuals_with, problem.near
    places: dict[str, Any] = dict(starts=starts, also=also)

    def fit_errors(with_errors: Problem, number: int) -> Fit:
        nonlocal near, places
        folder = checkpoint and Path(checkpoint) / f"scatter-{number}"
        errors = with_errors.errors  # as data: one compiled program for all rounds
        result = fit(residuals, near, data=errors, checkpoint=folder, **places, **common)
        near, places = result.theta, {}
        return result

    return fit_with_scatter(problem, fit_errors, with_scatter, with_freedom)


calibrated = fit_experiment
"""The old name of `fit_experiment`."""
