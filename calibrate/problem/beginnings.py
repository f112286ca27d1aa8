"""Starts of the fit of an experiment: the optima of a cheap model."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jax import Array

from calibrate.experiment.experiment import Experiment
from calibrate.least_squares.optima import Optimum
from calibrate.least_squares.scout import DRAWN, scout
from calibrate.least_squares.unknowns import unknowns
from calibrate.models.bed import needs_a_bed
from calibrate.models.forward_models import cheap_model, forward_model
from calibrate.models.polydisperse import has_several_sizes
from calibrate.models.prediction import ForwardModelMaker
from calibrate.problem.initial_slope import with_initial_slopes
from calibrate.problem.problem import Problem

Theta = OrderedDict[str, float]

MOST = 3
"""Most optima from which a fit starts."""
TIMES_WORSE, WORSE = 1.05, 2.0
"""Factor and summand on the least loss. An optimum of the cheap model with a loss below this limit
may be the best optimum of the full model."""


class Beginnings(NamedTuple):
    """Starts of a fit, and further optima of the cheap model."""

    promising: list[Theta]
    """Start values by variable, best first; at least one set."""
    others: list[Optimum]
    """Much worse optima of the cheap model; finished if the cheap model is the model of the fit."""
    places: int
    """Number of points from which optima were searched; 0 without a cheap model."""


def beginnings(
    experiment: Experiment, model: str | ForwardModelMaker, seed: int, robust: float | None
) -> Beginnings:
    """Finds the starts of a fit: the optima of a cheap model, or the start of the experiment.

    The start of the experiment is used if the model has no cheap counterpart, or if beds are
    simulated. In both cases the parameters are first moved to match the initial slopes of the
    curves.

    Args:
      experiment: samples and parameters.
      model: as for `Problem.prepare`.
      seed: seed of the points from which optima are searched.
      robust: as for `fit`.

    Raises:
      InputError: as for `Problem.prepare`.
    """
    make = forward_model(model)
    cheap = cheap_model(make, _has_costly_columns(experiment))
    if _simulates_a_bed(experiment):
        cheap = None
    models = Problem.prepare(experiment, cheap, seed).models if cheap else ()
    problem = Problem(experiment, models, experiment.start, everywhere=True)
    return begin(problem, problem.residuals, seed, robust, finished=cheap is make)


def begin(
    problem: Problem,
    residuals: Callable[..., Array],
    seed: int,
    robust: float | None = None,
    data: Any = None,
    finished: bool = False,
) -> Beginnings:
    """Finds the optima of a problem with cheap models, or its start if it has no models.

    Args:
      problem: the experiment, with cheap models.
      residuals, data, robust: as for `fit`.
      seed: seed of the points from which optima are searched.
      finished: whether the models of the problem are those of the fit.
    """
    unknown = unknowns(problem.start, problem.priors, problem.bounds)
    places = unknown.starts(1 + DRAWN if problem.models else 1, seed)
    places = with_initial_slopes(problem.experiment, unknown, places)
    optima = scout(residuals, unknown, places, robust, data) if problem.models else []

    def theta(values: np.ndarray) -> Theta:
        return OrderedDict(zip(unknown.names, map(float, values), strict=True))

    if not optima:
        return Beginnings([theta(np.exp(places[0]))], [], 0)
    limit = TIMES_WORSE * optima[0].loss + WORSE
    promising = [optimum for optimum in optima[:MOST] if optimum.loss <= limit]
    others = [optimum._replace(finished=finished) for optimum in optima[len(promising) :]]
    return Beginnings([theta(optimum.values) for optimum in promising], others, len(places))


def _has_costly_columns(experiment: Experiment) -> bool:
    """True if the layers of a tube must be solved for: several sizes, or a yielding bed."""
    suspensions = (
        experiment.suspension_of(sample, experiment.start) for sample in experiment.samples
    )
    return any(
        has_several_sizes(suspension) or suspension.compression is not None
        for suspension in suspensions
    )


def _simulates_a_bed(experiment: Experiment) -> bool:
    return any(
        needs_a_bed(sample)
        and experiment.suspension_of(sample, experiment.start).bed_fraction is None
        for sample in experiment.samples
    )
