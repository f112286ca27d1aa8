"""An experiment as residuals, the only input of the fit, which knows no physics."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.physical_bounds import bounds
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import Suspension
from calibrate.least_squares.priors import LogNormal
from calibrate.models.bed import can_be
from calibrate.models.forward_models import HOLD_EVERYWHERE, forward_model
from calibrate.models.prediction import (
    ForwardModel,
    ForwardModelMaker,
    as_measured,
    terminal_velocities,
)
from calibrate.problem.fine_times import takes_times, times_between
from mrjax import terminal_velocity
from mrjax.io.checkpoint import refuse_foreign

HOLDS_WITHIN = 3.0
"""Largest ratio of a velocity to the one that a forward model is prepared for. Up to this ratio a
run of particles forgets its start to 1e-5."""


@dataclass(frozen=True)
class Problem:
    """An experiment with a forward model for each of its samples."""

    experiment: Experiment
    """Samples and parameters."""
    models: tuple[ForwardModel, ...]
    """One for each sample: a function from a `Suspension` to its predictions, in SI units."""
    near: OrderedDict[str, float]
    """Values, by variable, for which the models are prepared."""
    everywhere: bool
    """True if the models hold at all values, not only near those."""

    @classmethod
    def prepare(
        cls,
        experiment: Experiment,
        model: str | ForwardModelMaker,
        seed: int = 0,
        near: Mapping[str, float] | None = None,
        checkpoint: str | Path | None = None,
    ) -> "Problem":
        """Prepares the forward models: does all work that is independent of the parameters.

        Args:
          experiment: samples and parameters.
          model: the name of a forward model, or a function like
            `calibrate.models.column.column`.
          seed: seed of the random positions of particles.
          near: values, by variable, for which the models are prepared; by default the start.
          checkpoint: folder that stores simulated beds, as for `mrjax.settle`.

        Raises:
          InputError: no such model, or a suspension that cannot be made.

        Example:
          >>> experiment = calibrate.Experiment.load("fang2005")
          >>> problem = calibrate.Problem.prepare(experiment, "closed-form")
          >>> problem.predict(problem.start).round(2)  # mm/day and %, of both samples
          Array([ 9.12, 67.44,  4.9 , 83.28], dtype=float64)
        """
        refuse_foreign(checkpoint)
        make = forward_model(model)
        near = OrderedDict(experiment.start if near is None else near)
        return cls(
            experiment,
            tuple(
                make(
                    sample,
                    experiment.suspension_of(sample, near),
                    seed,
                    experiment.varied(sample),
                    Path(checkpoint) / f"bed-{number}" if checkpoint else None,
                )
                for number, sample in enumerate(experiment.samples)
            ),
            near,
            make in HOLD_EVERYWHERE,
        )

    def holds_at(self, theta: Mapping[str, float]) -> bool:
        """True if the models hold at these values.

        They hold if every velocity is within a factor `HOLDS_WITHIN` of the one that they are
        prepared for, or is not a number.
        """
        suspension_of = self.experiment.suspension_of
        for sample in () if self.everywhere else self.experiment.samples:
            at_values, prepared = (
                _velocities(sample, suspension_of(sample, values)) for values in (theta, self.near)
            )
            if (np.abs(np.log(at_values / prepared)) > np.log(HOLDS_WITHIN)).any():
                return False
        return True

    @property
    def start(self) -> OrderedDict[str, float]:
        """Start of the search, by variable, in the order of the experiment."""
        return self.experiment.start

    @property
    def priors(self) -> dict[str, LogNormal]:
        """Priors by variable, for variables that have one."""
        return {
            fitted.variable: fitted.prior for fitted in self.experiment.parameters if fitted.prior
        }

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Physical bounds by variable; a fit stays within them."""
        return {
            parameter.variable: bounds(self.experiment, parameter)
            for parameter in self.experiment.parameters
        }

    @property
    def measurements(self) -> Sequence[tuple[Sample | None, Measurement]]:
        """All measurements with their samples, in the order of the residuals."""
        return [
            (sample, measurement)
            for sample in self.experiment.samples
            for measurement in sample.measurements
        ]

    def predict(self, theta: dict[str, Array]) -> Array:
        """Predicted measurements, each in the unit of its measurement, (M,).

        The prediction is NaN for an impossible suspension, such as one denser than its bed; the fit
        then turns back.
        """
        predicted = []
        for sample, model in zip(self.experiment.samples, self.models, strict=True):
            suspension = self.experiment.suspension_of(sample, theta)
            # A factor, not a `where`: so derivatives are NaN, too.
            possible = jnp.where(can_be(sample, suspension), 1.0, jnp.nan)
            predicted += [possible * value for value in as_measured(sample, model(suspension))]
        return jnp.stack(predicted)

    @property
    def curves(self) -> list[tuple[Sample, Measurement]]:
        """Samples that have a curve, each with the first reading of the curve."""
        pairs = ((sample, sample.readings_of_curve) for sample in self.experiment.samples)
        return [(sample, readings[0]) for sample, readings in pairs if readings]

    def predict_curves(self, theta: dict[str, Array], times: Sequence[np.ndarray]) -> list[Array]:
        """Predicted curves, (T,) each, in the unit of their readings.

        Args:
          theta: values by variable.
          times: times of each curve, s, (T,), as from `times_of_curves`.
        """
        model_of = self._model_of
        curves = []
        for (sample, reading), times_of_curve in zip(self.curves, times, strict=True):
            model, suspension = model_of[sample.name], self.experiment.suspension_of(sample, theta)
            keywords = {"times": jnp.asarray(times_of_curve)} if takes_times(model) else {}
            curves.append(model(suspension, **keywords)[reading.observable] / reading.si)
        return curves

    def times_of_curves(self) -> list[np.ndarray]:
        """Times of each curve, s, (T,): between the readings, too, if its model takes times."""
        model_of = self._model_of
        return [
            times_between(sample.times)
            if takes_times(model_of[sample.name])
            else np.asarray(sample.times)
            for sample, _ in self.curves
        ]

    @property
    def _model_of(self) -> dict[str, ForwardModel]:
        """The models, by the names of their samples."""
        pairs = zip(self.experiment.samples, self.models, strict=True)
        return {sample.name: model for sample, model in pairs}

    @property
    def measured(self) -> np.ndarray:
        """The measured values, each in its unit, (M,)."""
        return np.array([measurement.value for _, measurement in self.measurements])

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations of the measured values, each in its unit, (M,)."""
        return np.array([measurement.standard_deviation for _, measurement in self.measurements])

    def residuals(self, theta: dict[str, Array], measured: Array | None = None) -> Array:
        """(prediction - measurement) / standard deviation, (M,).

        Args:
          theta: values by variable.
          measured: replaces the measured values of the experiment, each in its unit, (M,).
        """
        measured = jnp.asarray(self.measured) if measured is None else measured
        return (self.predict(theta) - measured) / jnp.asarray(self.errors)

    def residuals_with(self, theta: dict[str, Array], errors: Array) -> Array:
        """(prediction - measurement) / error, (M,), for errors that are estimated with the fit.

        Args:
          theta: values by variable.
          errors: standard deviations, each in the unit of its measurement, (M,).
        """
        return (self.predict(theta) - jnp.asarray(self.measured)) / errors


def _velocities(sample: Sample, suspension: Suspension) -> np.ndarray:
    """Terminal velocities of a sample: of its particles, and at each concentration of its table."""
    undiluted = np.ravel(np.asarray(terminal_velocity(suspension.parameters)))
    return np.concatenate([undiluted, np.asarray(terminal_velocities(sample, suspension))])
