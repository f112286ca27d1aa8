"""The whole workflow: the fit of an experiment, the analysis of the fit, and the report."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from calibrate import report
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.simulator import SimulatedExperiment, Simulator
from calibrate.inference import forecast
from calibrate.inference.at_a_distance import unchanged_at_a_distance
from calibrate.inference.curves import PredictedCurve, predicted_curves
from calibrate.inference.forecast import Forecast
from calibrate.inference.identify import Identification, identify
from calibrate.inference.posterior import Posterior, refuse_without_sampler
from calibrate.inference.posterior import posterior as sample_posterior
from calibrate.inference.profile import Profile, profiles
from calibrate.least_squares.fit import Fit
from calibrate.models.column import column
from calibrate.models.forward_models import forward_model
from calibrate.models.prediction import ForwardModelMaker
from calibrate.models.tube import Tube, tube
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import places_of_scatter
from calibrate.problem.simulated import fit_simulator
from calibrate.problem.solve import calibrated as calibrated
from calibrate.problem.solve import fit_experiment
from calibrate.report import figures
from mrjax import InputError, Recipe, SimulationError
from mrjax.core.errors import shown
from mrjax.io.files import result_folder
from mrjax.io.versions import versions

CHECKPOINTS = "fit", "posterior", "left-out", "forecast"
"""Folders of a checkpoint, one for each long stage."""


@dataclass(frozen=True)
class Options:
    """Options of a calibration: the fit, and what is computed from it."""

    model: str | ForwardModelMaker = "particles"
    """As for `Problem.prepare`."""
    begin_with: str | ForwardModelMaker | None = None
    """A cheaper model that is fitted first."""
    starts: int = 1
    """Number of searches, each from another point; the best is kept."""
    seed: int = 0
    """Seed of further starts, of simulated suspensions and of the posterior."""
    robust: float | None = None
    """Standard deviations beyond which residuals count linearly."""
    posterior: bool = False
    """True to sample the posterior."""
    leave_one_out: bool = False
    """True to predict each sample from the others."""
    predict: Recipe | None = None
    """A recipe without measurements, to be predicted."""
    like: str | None = None
    """The sample whose parameters that recipe shares."""

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of `run`, by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def fit_options(self) -> dict[str, Any]:
        """Options of `fit_experiment`, without the model."""
        names = ("begin_with", "starts", "seed", "robust")
        return {name: getattr(self, name) for name in names}

    def refuse(self, experiment: Experiment) -> None:
        """Refuses options that do not suit the experiment.

        Raises:
          InputError: nothing would remain to fit without one of the samples, a package for samples
            of the posterior is missing, or `like` names no sample.
        """
        if isinstance(experiment, SimulatedExperiment):
            self._refuse_for_simulator()
        if self.leave_one_out:
            forecast.refuse_leaving_out(experiment)
        if self.posterior:
            refuse_without_sampler()
        if self.predict is not None:
            forecast.sample_like(experiment, self.predict, self.like or "")

    def _refuse_for_simulator(self) -> None:
        """Refuses options that are only for experiments with samples.

        Raises:
          InputError: such an option is given.
        """
        for name in ("model", "begin_with", "leave_one_out", "predict", "like"):
            if getattr(self, name) != getattr(Options, name):
                raise InputError(
                    f"{name} = {shown(getattr(self, name))}: is for experiments with samples; a "
                    "simulator is its own model, so leave it out"
                )


@dataclass(frozen=True)
class Calibration:
    """A fitted experiment, and the analysis of its fit."""

    experiment: Experiment
    options: Options
    problem: Problem
    """The residuals that were fitted."""
    fit: Fit
    identification: Identification
    """Values and combinations that the data determine."""
    predictions: np.ndarray
    """Predicted values at the fit, each in the unit of its measurement, (M,)."""
    profiles: tuple[Profile, ...] = ()
    """Profiles of the values; empty if the fit did not converge."""
    unchanged: tuple[str, ...] = ()
    """Null directions along which predictions do not change far from the fit, either."""
    curves: tuple[PredictedCurve, ...] = ()
    """Predicted curves, at the readings and between them."""
    posterior: Posterior | None = None
    left_out: tuple[Forecast, ...] | None = None
    """Forecasts of each sample from the others."""
    new: tuple[Forecast, ...] | None = None
    """Forecasts of the recipe without measurements."""
    faults: tuple[Exception, ...] = ()
    """Errors after the fit, in the order of the work."""
    wall_seconds: float = 0.0
    """Time of the whole calibration, s."""

    def tables(self) -> dict[str, Any]:
        """The calibration as plain tables: the contents of `fit.json`."""
        result = report.summary(
            self.problem,
            self.fit,
            self.identification,
            self.predictions,
            self.profiles,
            self.posterior,
            self.unchanged,
            self.curves,
        )
        for name, forecasts in (("left_out", self.left_out), ("new", self.new)):
            if forecasts is not None:
                result[name] = report.forecasts(list(forecasts))
        return result | {
            "notes": result["notes"] + self._contact_notes(),
            "experiment": self.experiment.name,
            "lab_sheets": {
                sample.name: sample.recipe.model_dump(mode="json", exclude_none=True)
                for sample in self.experiment.samples
            },
            "model": self._model,
            "begun_with": _name(self.options.begin_with),
            "seed": self.options.seed,
            "dtype": str(self.predictions.dtype),
            "versions": versions(),
            "wall_seconds": self.wall_seconds,
        }

    @property
    def _model(self) -> str | None:
        """Name of the model in the report."""
        if isinstance(self.experiment, SimulatedExperiment):
            return self.experiment.simulator.model
        return _name(self.options.model)

    def _contact_notes(self) -> list[str]:
        """Notes on contacts, for the samples whose particles were simulated."""
        return [
            f"sample {sample.name}: {note}"
            for sample in self.experiment.samples
            if "particles" in (_name(self.options.model), sample.bed_fraction)
            for note in sample.recipe.contact_notes
        ]

    @cached_property
    def tubes(self) -> dict[str, Tube]:
        """The tube of each sample as fitted, by its name, as fields over time and height.

        There are those of the model `column`, for samples with readings at some times and a bed of
        known volume fraction.
        """
        if forward_model(self.options.model) is not column:
            return {}
        tubes = {}
        for sample, model in zip(self.problem.experiment.samples, self.problem.models, strict=True):
            suspension = self.problem.experiment.suspension_of(sample, self.fit.theta)
            bed = suspension.bed_fraction
            if sample.bed_fraction == "particles":
                bed = suspension.volume_fraction / model(suspension)["final_ratio"]
            if bed is None or not (sample.times or sample.points):
                continue
            settled = tube(sample, suspension, bed)
            if np.isfinite(settled.mudline).all():
                tubes[sample.name] = settled
        return tubes

    def write(
        self, folder: str | Path, *, pdf: bool = False, progress: bool = False
    ) -> dict[str, Any]:
        """Writes `fit.json`, the report and its figures, and the fields of `tubes`.

        Args:
          folder: target folder; it is created if it is missing.
          pdf: whether to write figures as PDF, too.
          progress: whether to show a progress bar, on standard error.

        Returns:
          the contents of `tables`, as they were written.

        Raises:
          SystemRefusal: the system refuses a file.
        """
        folder, result = result_folder(Path(folder)), self.tables()
        drawn_figures = figures.figures(
            self.problem, self.fit, result, self.profiles, self.posterior, self.tubes
        )
        text = report.markdown(self.experiment.name, result["model"], result, drawn_figures)
        report.write(folder, text, result, drawn_figures, pdf, progress=progress)
        report.write_tubes(folder, self.tubes, result)
        return result


def run(
    experiment: Experiment | Simulator | str | Path,
    *,
    model: str | ForwardModelMaker = "particles",
    begin_with: str | ForwardModelMaker | None = None,
    starts: int = 1,
    seed: int = 0,
    robust: float | None = None,
    posterior: bool = False,
    leave_one_out: bool = False,
    predict: Recipe | None = None,
    like: str | None = None,
    checkpoint: str | Path | None = None,
    progress: bool = False,
) -> Calibration:
    """Fits an experiment, analyses the fit and makes forecasts: the workflow of `mrjax-calibrate`.

    Args:
      experiment: samples and parameters, the name or file to load them from, or a simulator of
        your own, which is its own model.
      model: forward model, as for `Problem.prepare`.
      begin_with: a cheaper model that is fitted first.
      starts: number of searches, each from another point; the best is kept.
      seed: seed of further starts, of simulated suspensions and of the posterior.
      robust: standard deviations beyond which residuals count linearly.
      posterior: whether to sample the posterior.
      leave_one_out: whether to predict each sample from the others, too.
      predict: a recipe without measurements, to be predicted.
      like: the sample whose parameters that recipe shares.
      checkpoint: folder that stores the finished work, as for `fit_experiment`.
      progress: whether to show a progress bar for every stage, on standard error.

    Returns:
      a Calibration; look at `fit.converged` and `faults` before using it.

    Raises:
      InputError: options, a suspension or a model that cannot be used for this experiment.
      SimulationError: the fit ended where the model gives no prediction.

    Example:
      >>> calibration = calibrate.run("fang2005", model="closed-form")
      >>> calibration.fit.converged, calibration.identification.combinations[0].expression
      (True, 'f_w * f_s')
    """
    began = time.perf_counter()
    options = Options(
        model, begin_with, starts, seed, robust, posterior, leave_one_out, predict, like
    )
    if isinstance(experiment, Simulator):
        experiment = SimulatedExperiment.of_simulator(experiment)
    elif not isinstance(experiment, Experiment):
        experiment = Experiment.load(experiment)
    options.refuse(experiment)
    folders = dict.fromkeys(CHECKPOINTS)
    if checkpoint is not None:
        folders = {name: Path(checkpoint) / name for name in CHECKPOINTS}
    try:
        problem, fit = _fit(experiment, options, progress, folders["fit"])
    except ValueError as error:
        raise InputError(str(error)) from None
    if not np.isfinite(fit.jacobian).all() or not np.isfinite(fit.values).all():
        raise SimulationError(
            f"after {fit.model_runs} model runs the fit ended where nothing can be predicted; give "
            "other medians, or more --starts"
        )
    # Outside the compiled fit a simulation checks itself and raises if not to be trusted.
    predictions = np.asarray(problem.predict(fit.theta))
    free = problem.experiment.scatter_freedom
    profiles_of_values = profiles(fit, progress, free) if fit.converged else ()
    identified = identify(fit)
    unchanged = unchanged_at_a_distance(fit, identified) if fit.converged else ()
    calibration = Calibration(
        experiment,
        options,
        problem,
        fit,
        identified,
        predictions,
        profiles_of_values,
        unchanged,
        predicted_curves(problem, fit),
    )
    calibration = _with_samples_and_forecasts(calibration, folders, progress)
    return replace(calibration, wall_seconds=time.perf_counter() - began)


def _fit(
    experiment: Experiment, options: Options, progress: bool, folder: Path | None
) -> tuple[Problem, Fit]:
    """Fits an experiment or a simulator; gives the fitted problem, and the fit."""
    common: dict[str, Any] = options.fit_options | {"progress": progress, "checkpoint": folder}
    if isinstance(experiment, SimulatedExperiment):
        del common["begin_with"]
        return fit_simulator(experiment.simulator, **common)
    return fit_experiment(experiment, options.model, **common)


def _with_samples_and_forecasts(
    calibration: Calibration, folders: dict[str, Path | None], progress: bool
) -> Calibration:
    """The calibration with the requested samples and forecasts; their errors are its faults."""
    options, experiment, fit = calibration.options, calibration.experiment, calibration.fit
    faults: list[Exception] = []
    results: dict[str, Any] = {}
    if options.posterior and fit.converged:
        with _collect_errors(faults):
            results["posterior"] = sample_posterior(
                fit,
                options.seed,
                checkpoint=folders["posterior"],
                progress=progress,
                scatter=places_of_scatter(calibration.problem, fit),
                uniform=[
                    parameter.variable
                    for parameter in experiment.parameters
                    if parameter.bounds and parameter.prior is None
                ],
            )
    if options.leave_one_out:
        with _collect_errors(faults):
            results["left_out"] = tuple(
                forecast.leave_one_out(
                    calibration.problem.experiment,  # with estimated errors
                    options.model,
                    **options.fit_options,
                    checkpoint=folders["left-out"],
                    progress=progress,
                )
            )
    if options.predict is not None and fit.converged:
        wider, sample = forecast.sample_like(experiment, options.predict, options.like or "")
        with _collect_errors(faults):
            results["new"] = tuple(
                forecast.forecast(
                    wider, fit, sample, options.model, options.seed, folders["forecast"]
                )
            )
    return replace(calibration, **results, faults=tuple(faults))


@contextmanager
def _collect_errors(faults: list[Exception]) -> Iterator[None]:
    """A context that collects the errors of the enclosed work as faults."""
    try:
        yield
    except (InputError, SimulationError) as error:
        faults.append(error)


def _name(model: str | ForwardModelMaker | None) -> str | None:
    """The name of a model in a report."""
    if model is None or isinstance(model, str):
        return model
    return getattr(model, "__name__", repr(model))
