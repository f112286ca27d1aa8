"""Forward models and their predictions."""

from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
from jax import Array

from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from mrjax import terminal_velocity

Prediction = dict[str, Array]
"""By observable, in SI units; of a curve, for all of its times. `initial_velocities` are those of a
table, for all of its concentrations."""

ForwardModel = Callable[..., Prediction]
"""From a suspension to what should have been measured on it. One that takes `times`, (T,) in s, as
well predicts a curve between its readings."""

ForwardModelMaker = Callable[[Sample, Suspension, int, tuple[str, ...], Path | None], ForwardModel]
"""Prepares a forward model: from a sample, the suspension near which it will be asked, a seed, the
names of what will vary, and a folder that keeps a bed as it is simulated."""


def terminal_velocities(sample: Sample, suspension: Suspension) -> Array:
    """Eq. 27 at each concentration of a sample's velocities, (K,) in m/s."""
    if not sample.fractions:
        return jnp.zeros(0)

    def velocity(fraction: Array) -> Array:
        return jnp.mean(terminal_velocity(suspension.at(fraction).parameters))

    return jax.vmap(velocity)(jnp.asarray(sample.fractions, float))


def prediction(
    sample: Sample,
    suspension: Suspension,
    velocity: Array,
    final: Array,
    ratio: Array,
    velocities: Array,
) -> Prediction:
    """The prediction of everything that can be measured on a sample.

    Args:
      sample: what was measured.
      suspension: as it is predicted.
      velocity: initial velocity, () in m/s.
      final: final height over that of the suspension, ().
      ratio: height over that of the suspension at the sample's times, (T,).
      velocities: initial velocity at each of the sample's fractions, (K,) in m/s.
    """
    return {
        "initial_velocity": velocity,
        "initial_velocities": velocities,
        "final_ratio": final,
        "sedimentation_ratio": ratio,
        "mudline": sample.height * ratio,
        "viscosity_ratio": suspension.parameters.f_v,
    }


def as_measured(sample: Sample, prediction: Prediction) -> list[Array]:
    """The predicted value of each measurement of a sample, in the measurement's unit; ()."""
    values = []
    for measurement in sample.measurements:
        if measurement.concentration is not None:
            at_place = prediction["initial_velocities"][measurement.concentration.place]
        elif measurement.place is not None:
            at_place = prediction[measurement.observable][measurement.place]
        else:
            at_place = prediction[measurement.observable]
        values.append(jnp.asarray(at_place, float) / measurement.si)
    return values
