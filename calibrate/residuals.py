"""An experiment as residuals: what the fit, which knows nothing of the physics, is given."""

from collections import OrderedDict
from dataclasses import dataclass

import jax.numpy as jnp
from jax import Array

from calibrate.data import Experiment, Measurement, Sample
from calibrate.fit import LogNormal
from calibrate.predict import FORWARD_MODELS, ForwardModel
from mrjax import InputError


@dataclass(frozen=True)
class Problem:
    """An experiment with a forward model for each of its samples."""

    experiment: Experiment
    models: tuple[ForwardModel, ...]

    @classmethod
    def prepare(cls, experiment: Experiment, model: str, seed: int = 0) -> "Problem":
        """Chooses the forward model by name and does what does not depend on the parameters.

        Raises:
          InputError: no such model, or a suspension that cannot be made.
        """
        if model not in FORWARD_MODELS:
            raise InputError(f"model = {model!r}: must be one of {', '.join(FORWARD_MODELS)}")
        start = {fitted.label: fitted.median for fitted in experiment.parameters}
        return cls(
            experiment,
            tuple(
                FORWARD_MODELS[model](
                    sample.recipe, experiment.parameters_of(sample, start).astype(float), seed
                )
                for sample in experiment.samples
            ),
        )

    @property
    def start(self) -> OrderedDict[str, float]:
        """The medians of the priors, by label, in the order of the experiment."""
        return OrderedDict((fitted.label, fitted.median) for fitted in self.experiment.parameters)

    @property
    def priors(self) -> dict[str, LogNormal]:
        """The priors, by label."""
        return {
            fitted.label: LogNormal(fitted.median, fitted.log_standard_deviation)
            for fitted in self.experiment.parameters
        }

    @property
    def measurements(self) -> list[tuple[Sample, Measurement]]:
        """All measurements, in the order of the residuals."""
        return [(sample, one) for sample in self.experiment.samples for one in sample.measurements]

    def predict(self, theta: dict[str, Array]) -> Array:
        """What should have been measured, each in the unit of its measurement, (M,)."""
        predicted = []
        for sample, model in zip(self.experiment.samples, self.models, strict=True):
            of_sample = model(self.experiment.parameters_of(sample, theta))
            predicted += [of_sample[one.observable] / one.si for one in sample.measurements]
        return jnp.stack([jnp.asarray(value, float) for value in predicted])

    def residuals(self, theta: dict[str, Array]) -> Array:
        """(prediction - measurement) / standard deviation, (M,)."""
        measured = jnp.array([one.value for _, one in self.measurements])
        spread = jnp.array([one.standard_deviation for _, one in self.measurements])
        return (self.predict(theta) - measured) / spread
