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
    effective_times,
    forever,
    layers,
    prediction,
    refuse_rotor,
    refuse_spread,
    refuse_yielding,
    terminal_velocities,
    tilt_of,
)
from mrjax.continuum.layers import layer_ends
from mrjax.continuum.tilt import Tilt, clock_times


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
    refuse_rotor(sample, "closed-form")
    refuse_yielding(sample, near, "closed-form")
    refuse_spread(sample, near, "closed-form")
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    reading_times = jnp.asarray(sample.times, float)

    def upright_times(suspension: Suspension, velocity: Array, times: Array) -> Array:
        """The times at which an upright tube without delay or ageing has the same state."""
        tilt, times = tilt_of(sample, suspension), effective_times(suspension, times)
        densest = fraction_of_bed(suspension, bed)
        if tilt is None or densest is None:  # no reading depends on a bed that is not known
            return times
        share = suspension.volume_fraction / jnp.asarray(densest)
        return straight_clock(times, tilt, sample.height, velocity, share)

    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        if suspension.parameters.yield_growth is not None:
            end = upright_times(suspension, velocity, forever())[0]
            final = jnp.maximum(final, 1.0 - velocity * end / sample.height)
        times = upright_times(suspension, velocity, times)
        ratio = jnp.maximum(1.0 - velocity * times / sample.height, final)
        velocities = terminal_velocities(sample, suspension)
        local = jnp.zeros(0)
        if sample.points:
            fractions = suspension.volume_fraction, jnp.asarray(fraction_of_bed(suspension, bed))
            measured = layers(sample)
            measured = measured._replace(times=upright_times(suspension, velocity, measured.times))
            coated = mean_fraction(*fractions, velocity, sample.height, measured)
            local = coated / suspension.parameters.f_r**3
        return prediction(sample, suspension, velocity, final, ratio, velocities, local)

    return predict


def straight_clock(times: Array, tilt: Tilt, height: float, velocity: Array, share: Array) -> Array:
    """Times at which an upright tube has the state of a tilted one; s, (T,).

    Args:
      times: times of the tilted tube, s, (T,).
      tilt: tilt and gap of the tube.
      height: H, m.
      velocity: v, m/s, ().
      share: phi_0 / phi_bed, ().
    """
    last = jnp.max(times, initial=0.0) * tilt.rate(height)
    moves = velocity > 0.0
    meeting = height * (1.0 - share) / jnp.where(moves, velocity, 1.0)
    nodes = jnp.stack(
        [jnp.zeros_like(last), jnp.minimum(jnp.where(moves, meeting, last), last), last]
    )
    length = height * jnp.maximum(1.0 - nodes / meeting, 0.0)
    return clock_times(times, tilt, nodes, jnp.where(moves, length, height))


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
