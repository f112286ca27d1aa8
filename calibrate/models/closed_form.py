"""The closed form as a forward model: Eq. 27 and the asymptotes of Fig. 4."""

from pathlib import Path

import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import final_ratio, simulated_fraction
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    prediction,
    terminal_velocities,
)


def closed_form(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """Eq. 27 for the velocity, and the two asymptotes of Fig. 4 for the curve.

    h / h_0 = max(1 - v t / h_0, phi_0 / phi_bed): the mudline falls at its initial velocity until
    all lies in the bed. Exact where drag is not local and the bed does not yield.

    Raises:
      InputError: a bed is asked for, and its volume fraction is not known.
    """
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    read = jnp.asarray(sample.times, float)

    def predict(suspension: Suspension, times: Array = read) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        ratio = jnp.maximum(1.0 - velocity * times / sample.height, final)
        velocities = terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities)

    return predict
