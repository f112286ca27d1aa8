"""Forward models and their predictions."""

from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
from jax import Array

from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension

Prediction = dict[str, Array]
"""By observable, in SI units; of a curve, for all of its times."""

ForwardModel = Callable[[Suspension], Prediction]
"""From a suspension to what should have been measured on it."""

ForwardModelMaker = Callable[[Sample, Suspension, int, tuple[str, ...], Path | None], ForwardModel]
"""Prepares a forward model: from a sample, the suspension near which it will be asked, a seed, the
names of what will vary, and a folder that keeps a bed as it is simulated."""


def prediction(
    sample: Sample, suspension: Suspension, velocity: Array, final: Array, ratio: Array
) -> Prediction:
    """The prediction of everything that can be measured on a sample.

    Args:
      sample: what was measured.
      suspension: as it is predicted.
      velocity: initial velocity, () in m/s.
      final: final height over that of the suspension, ().
      ratio: height over that of the suspension at the sample's times, (T,).
    """
    return {
        "initial_velocity": velocity,
        "final_ratio": final,
        "sedimentation_ratio": ratio,
        "mudline": sample.height * ratio,
        "viscosity_ratio": suspension.parameters.f_v,
    }


def as_measured(sample: Sample, prediction: Prediction) -> list[Array]:
    """The predicted value of each measurement of a sample, in the measurement's unit; ()."""
    values = []
    for measurement in sample.measurements:
        value = prediction[measurement.observable]
        at_place = value if measurement.place is None else value[measurement.place]
        values.append(jnp.asarray(at_place, float) / measurement.si)
    return values
