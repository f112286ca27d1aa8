"""An experiment as residuals: what the fit, which knows nothing of the physics, is given."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.data import Experiment, Measurement, Sample
from calibrate.fit import LogNormal
from calibrate.predict import FORWARD_MODELS, ForwardModel, as_measured
from mrjax import InputError


@dataclass(frozen=True)
class Problem:
    """An experiment with a forward model for each of its samples."""

    experiment: Experiment
    models: tuple[ForwardModel, ...]

    @classmethod
    def prepare(
        cls, experiment: Experiment, model: str | Callable[..., ForwardModel], seed: int = 0
    ) -> "Problem":
        """Does what does not depend on the parameters.

        Args:
          experiment: samples and parameters.
          model: the name of a forward model, or one like those of `calibrate.predict`, such as
            `partial(predict.column, cells=100)`.
          seed: of the random starts of particles.

        Raises:
          InputError: no such model, or a suspension that cannot be made.
        """
        if isinstance(model, str):
            if model not in FORWARD_MODELS:
                raise InputError(f"model = {model!r}: must be one of {', '.join(FORWARD_MODELS)}")
            model = FORWARD_MODELS[model]
        start = {fitted.variable: fitted.start for fitted in experiment.parameters}
        return cls(
            experiment,
            tuple(
                model(
                    sample,
                    experiment.suspension_of(sample, start),
                    seed,
                    tuple(one.name for one in experiment.parameters if sample.name in one.samples),
                )
                for sample in experiment.samples
            ),
        )

    @property
    def start(self) -> OrderedDict[str, float]:
        """The medians, by variable, in the order of the experiment."""
        return OrderedDict((fitted.variable, fitted.start) for fitted in self.experiment.parameters)

    @property
    def priors(self) -> dict[str, LogNormal]:
        """The priors, by variable, of those that have one."""
        return {
            fitted.variable: fitted.prior for fitted in self.experiment.parameters if fitted.prior
        }

    @property
    def measurements(self) -> list[tuple[Sample, Measurement]]:
        """All measurements, in the order of the residuals."""
        return [(sample, one) for sample in self.experiment.samples for one in sample.measurements]

    def predict(self, theta: dict[str, Array]) -> Array:
        """What should have been measured, each in the unit of its measurement, (M,)."""
        predicted = []
        for sample, model in zip(self.experiment.samples, self.models, strict=True):
            predicted += as_measured(sample, model(self.experiment.suspension_of(sample, theta)))
        return jnp.stack(predicted)

    @property
    def measured(self) -> np.ndarray:
        """The measured values, each in its unit, (M,)."""
        return np.array([one.value for _, one in self.measurements])

    def residuals(self, theta: dict[str, Array], measured: Array | None = None) -> Array:
        """(prediction - measurement) / standard deviation, (M,).

        Args:
          theta: by variable.
          measured: in place of the experiment's values, each in its unit, (M,).
        """
        measured = jnp.asarray(self.measured) if measured is None else measured
        spread = jnp.array([one.standard_deviation for _, one in self.measurements])
        return (self.predict(theta) - measured) / spread
