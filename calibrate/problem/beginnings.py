"""Where the fit of an experiment begins: the optima of a model that costs next to nothing."""

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
from calibrate.models.prediction import ForwardModelMaker
from calibrate.problem.initial_slope import with_initial_slopes
from calibrate.problem.problem import Problem

Theta = OrderedDict[str, float]

MOST = 3
"""Optima from which a fit begins."""
TIMES_WORSE, WORSE = 1.05, 2.0
"""Loss up to which an optimum of the cheap model could be the best of the model itself."""


class Beginnings(NamedTuple):
    """Where a fit begins, and what else was found."""

    promising: list[Theta]
    """Values, by variable, best first; one at least."""
    others: list[Optimum]
    """Optima of the cheap model that are much worse; finished where that is the model itself."""
    places: int
    """Places from which optima were looked for; 0 without a cheap model."""


def beginnings(
    experiment: Experiment, model: str | ForwardModelMaker, seed: int, robust: float | None
) -> Beginnings:
    """The optima of a cheap model, or the start where there is none or beds are simulated.

    Both with the drag of the initial slopes.

    Args:
      experiment: samples and parameters.
      model: as for `Problem.prepare`.
      seed: of the places from which optima are looked for.
      robust: as for `fit`.

    Raises:
      InputError: as `Problem.prepare`.
    """
    make = forward_model(model)
    cheap = cheap_model(make)
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
    """The optima of a problem that costs next to nothing, or its start where it has no models.

    Args:
      problem: the experiment, with cheap models.
      residuals, data, robust: as for `fit`.
      seed: of the places from which optima are looked for.
      finished: whether those are the models of the fit.
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


def _simulates_a_bed(experiment: Experiment) -> bool:
    return any(
        needs_a_bed(sample)
        and experiment.suspension_of(sample, experiment.start).bed_fraction is None
        for sample in experiment.samples
    )
