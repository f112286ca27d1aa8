"""Predictions with the uncertainty of a fit, for new samples and for samples that were left out.

The derivative of a prediction carries the covariance of the logarithms, from data and priors
together, to the prediction. A prediction has an infinite error if it depends on a value that
neither fit nor prior bounds.
"""

from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import BED, CLOSURE, COMPRESSION, refuse_unknown
from calibrate.experiment.units import VELOCITY_UNITS
from calibrate.inference.curvature import RANK_TOLERANCE, covariance, information
from calibrate.least_squares.fit import Fit
from calibrate.models.forward_models import forward_model
from calibrate.models.prediction import ForwardModelMaker, as_measured
from calibrate.problem.solve import fit_experiment
from mrjax import InputError, Recipe, SimulationError
from mrjax.core.promotion import relaxed_promotion
from mrjax.core.text import in_terminal
from mrjax.io.checkpoint import refuse_foreign


@dataclass(frozen=True)
class Forecast:
    """One prediction, and the measurement if there is one."""

    sample: str
    measurement: Measurement
    """The measurement; its value and standard deviation are NaN if nothing was measured."""
    predicted: float
    standard_error: float
    """Standard error of the prediction, from fit and priors; infinite if neither bounds it.

    Prediction and error are in the unit of the measurement.
    """
    time: float | None = None
    """Time of a reading of a curve, or of a concentration at a height, s."""
    time_unit: str = "s"
    """Unit of time of its file."""

    @property
    def off(self) -> float:
        """Predicted minus measured, in standard deviations of both together."""
        spread = np.hypot(self.standard_error, self.measurement.standard_deviation)
        return (self.predicted - self.measurement.value) / spread


def forecast(
    experiment: Experiment,
    fit: Fit,
    sample: Sample,
    model: str | ForwardModelMaker,
    seed: int = 0,
    checkpoint: str | Path | None = None,
) -> list[Forecast]:
    """Predicts the measurements of a sample, of the experiment or new, from a fit.

    Args:
      experiment: the fitted experiment. Its parameters that name this sample apply to it; those
        that were not fitted have their priors.
      fit: the fit.
      sample: the sample; its measurements name what to predict.
      model: as for `Problem.prepare`.
      seed: seed of a simulated suspension.
      checkpoint: folder that stores a simulated bed, as for `mrjax.settle`.
    """
    logs, spread, unbounded_directions = _variables_of_experiment(experiment, fit)
    names = list(experiment.start)
    start = OrderedDict(zip(names, np.exp(logs), strict=True))
    near = experiment.suspension_of(sample, start)
    folder = Path(checkpoint) if checkpoint else None
    predict = forward_model(model)(sample, near, seed, experiment.varied(sample), folder)

    def predicted(logs: Array) -> Array:
        theta = OrderedDict(zip(names, jnp.exp(logs), strict=True))
        return jnp.stack(as_measured(sample, predict(experiment.suspension_of(sample, theta))))

    with relaxed_promotion():
        values = np.asarray(jax.jit(predicted)(jnp.asarray(logs)))
        slopes = np.asarray(jax.jit(jax.jacfwd(predicted))(jnp.asarray(logs)))
    errors = np.sqrt(np.einsum("mp,pq,mq->m", slopes, spread, slopes))
    size = np.linalg.norm(slopes, axis=1, keepdims=True)
    unbounded = (np.abs(slopes @ unbounded_directions) > RANK_TOLERANCE**0.5 * size).any(axis=1)
    errors[unbounded] = np.inf
    return [
        Forecast(sample.name, measurement, value, error, *_time(sample, measurement))
        for measurement, value, error in zip(sample.measurements, values, errors, strict=True)
    ]


def _time(sample: Sample, measurement: Measurement) -> tuple[float | None, str]:
    """Time of a reading, s, or None, and the unit in which it is printed."""
    if measurement.point is not None:
        return measurement.point.time, measurement.point.time_unit
    time = None if measurement.place is None else sample.times[measurement.place]
    return time, sample.time_unit


def leave_one_out(
    experiment: Experiment,
    model: str | ForwardModelMaker,
    seed: int = 0,
    checkpoint: str | Path | None = None,
    progress: bool = False,
    **options: Any,
) -> list[Forecast]:
    """Predicts every sample from a fit to all others.

    Args:
      experiment: an experiment with at least two samples.
      model: as for `Problem.prepare`.
      seed: seed of simulated suspensions, and of further starts.
      checkpoint: folder that stores the work of each fit, as for `fit_experiment`.
      progress: whether to show progress bars, on standard error.
      options: further options of `fit_experiment`.

    Raises:
      InputError: there is only one sample, or nothing is fitted without one of them.
      SimulationError: a fit without one of the samples did not converge.
    """
    refuse_foreign(checkpoint)
    refuse_leaving_out(experiment)
    forecasts = []
    bar = tqdm(experiment.samples, desc="each from the others", disable=not progress, leave=False)
    for number, sample in enumerate(bar):
        bar.set_postfix_str(f"without {in_terminal(sample.name)}")
        rest = leave_out(experiment, sample.name)
        folder = checkpoint and Path(checkpoint) / f"without-{number}"
        common = dict(seed=seed, progress=progress, checkpoint=folder, **options)
        _, fitted = fit_experiment(rest, model, **common)
        if not fitted.converged:
            raise SimulationError(
                f"the fit without sample {sample.name} did not converge in {fitted.model_runs} "
                "model runs: nothing is predicted from it; give narrower priors"
            )
        bed = folder and folder / "forecast"
        forecasts += forecast(experiment, fitted, sample, model, seed, bed)
    return forecasts


def refuse_leaving_out(experiment: Experiment) -> None:
    """Refuses to leave samples out if nothing would remain to be fitted.

    Raises:
      InputError: nothing would remain.
    """
    if len(experiment.samples) < 2:
        raise InputError(f"{experiment.name}: has one sample; leaving it out leaves nothing to fit")
    for sample in experiment.samples:
        if not leave_out(experiment, sample.name).parameters:
            raise InputError(
                f"{experiment.name}: all that is fitted belongs to sample {sample.name} alone; "
                "leaving it out leaves nothing to fit"
            )


def leave_out(experiment: Experiment, name: str) -> Experiment:
    """The experiment without a sample, and without parameters of that sample alone."""
    parameters = tuple(
        replace(parameter, samples=tuple(other for other in parameter.samples if other != name))
        for parameter in experiment.parameters
        if set(parameter.samples) != {name}
    )
    samples = tuple(sample for sample in experiment.samples if sample.name != name)
    return replace(experiment, samples=samples, parameters=parameters)


def sample_like(experiment: Experiment, recipe: Recipe, name: str) -> tuple[Experiment, Sample]:
    """A new recipe as a sample that shares the parameters of a sample of the experiment.

    Raises:
      InputError: the experiment has no such sample, or a parameter of that sample has no meaning,
        or another one, for the recipe.
    """
    samples = {sample.name: sample for sample in experiment.samples}
    if name not in samples:
        raise InputError(f"{name!r}: no such sample; {experiment.name} has {', '.join(samples)}")
    new_name = recipe.name
    while new_name in samples:
        new_name += " (new)"
    values = experiment.varied(samples[name]) + tuple(
        quantity for other, quantity, _ in experiment.held if other == name
    )
    for quantity in values:
        _refuse_another_meaning(quantity, recipe, samples[name].recipe)
    bed = samples[name].bed_fraction
    nothing = (float("nan"), float("nan"))
    velocity = Measurement("initial_velocity", *nothing, "mm/day", VELOCITY_UNITS["mm/day"])
    tube = samples[name].tube
    fits_bed = BED in experiment.varied(samples[name])
    has_bed = bed is not None or fits_bed or {*tube, *values}.issuperset(COMPRESSION)
    ratio = Measurement("final_ratio", *nothing, "1", 1.0)
    measurements = (velocity, ratio) if has_bed else (velocity,)
    sample = Sample(new_name, recipe, recipe.box.height, bed, measurements, tube=tube)
    applies = tuple(
        replace(parameter, samples=(*parameter.samples, sample.name))
        if name in parameter.samples
        else parameter
        for parameter in experiment.parameters
    )
    held = experiment.held + tuple(
        (sample.name, quantity, value)
        for other, quantity, value in experiment.held
        if other == name
    )
    return replace(experiment, parameters=applies, held=held), sample


def _refuse_another_meaning(name: str, recipe: Recipe, fitted: Recipe) -> None:
    try:
        refuse_unknown(name, recipe, recipe.parameters())
    except InputError as error:
        raise InputError(f"{name} was fitted, but for {recipe.name}: {error}") from None
    closures = [None if sheet.closure is None else sheet.closure.func for sheet in (recipe, fitted)]
    if name.startswith(CLOSURE) and closures[0] is not closures[1]:
        raise InputError(
            f"{name} was fitted in the closure of {fitted.name}; {recipe.name} has another, in "
            "which it means something else: give it the same [drag] f_w"
        )


def _variables_of_experiment(
    experiment: Experiment, fit: Fit
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Logarithms of all variables, (P,), covariance, (P, P), and unbounded directions, (P, K).

    Variables that were not fitted have their priors.
    """
    parameters = experiment.parameters
    strength = np.zeros((len(parameters), len(parameters)))
    logs = np.log([parameter.middle for parameter in parameters])
    place = {parameter.variable: index for index, parameter in enumerate(parameters)}
    fitted_places = np.array([place[name] for name in fit.names], int)
    strength[np.ix_(fitted_places, fitted_places)] = information(fit)
    logs[fitted_places] = np.log(fit.values)
    for index, parameter in enumerate(parameters):
        if index not in fitted_places and parameter.prior is not None:
            strength[index, index] = parameter.prior.log_standard_deviation**-2.0
    return logs, *covariance(strength)
