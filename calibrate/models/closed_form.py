"""The closed form as a forward model: Eq. 27 and the asymptotes of Fig. 4."""

from pathlib import Path

import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import final_ratio, fraction_of_bed, simulated_fraction
from calibrate.models.prediction import (
    ForwardModel,
    Layers,
    Prediction,
    effective_layers,
    effective_times,
    last_time,
    prediction,
    refuse_yielding,
    terminal_velocities,
)
from mrjax.continuum.layers import layer_ends


def closed_form(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """Eq. 27 for the velocity, and the two asymptotes of Fig. 4 for the curve.

    h / h_0 = max(1 - v t / h_0, phi_0 / phi_bed): the mudline falls at its initial velocity until
    all particles lie in the bed. Between the mudline and the rising front of the bed the suspension
    keeps its initial volume fraction. This is exact if drag is not local and the bed does not
    yield.

    Raises:
      InputError: the bed is needed, and its volume fraction is not known.
    """
    refuse_yielding(sample, near, "closed-form")
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    reading_times = jnp.asarray(sample.times, float)

    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        times = effective_times(suspension, times)
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        if suspension.parameters.yield_growth is not None:
            final = jnp.maximum(final, 1.0 - velocity * last_time(suspension) / sample.height)
        ratio = jnp.maximum(1.0 - velocity * times / sample.height, final)
        velocities = terminal_velocities(sample, suspension)
        local = jnp.zeros(0)
        if sample.points:
            fractions = suspension.volume_fraction, jnp.asarray(fraction_of_bed(suspension, bed))
            measured = effective_layers(sample, suspension)
            coated = mean_fraction(*fractions, velocity, sample.height, measured)
            local = coated / suspension.parameters.f_r**3
        return prediction(sample, suspension, velocity, final, ratio, velocities, local)

    return predict


def mean_fraction(
    initial: Array, densest: Array, velocity: Array, height: float, at: Layers
) -> Array:
    """Mean volume fraction over layers of a tube in which all particles fall at one velocity.

    The volume of solids below a height z, for a unit of area, is
    min(phi_0 H, phi_0 (z + v t), phi_bed z). The first holds above the mudline, the second in the
    suspension, and the third in the bed.

    Args:
      initial: phi_0, ().
      densest: phi_bed, ().
      velocity: v, m/s, ().
      height: H, m.
      at: the layers, (Q,).
    """

    def solids_below(level: Array) -> Array:
        falling = jnp.minimum(height, level + velocity * at.times)
        return jnp.minimum(initial * falling, densest * level)

    low, high = layer_ends(at.levels, at.thickness, height)
    return (solids_below(high) - solids_below(low)) / (high - low)
