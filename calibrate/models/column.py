"""The tube in one dimension as a forward model: Kynch's theory, without a grid."""

from pathlib import Path

import jax
import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import final_ratio, fraction_of_bed, simulated_fraction
from calibrate.models.centrifuged import centrifuged
from calibrate.models.polydisperse import has_several_sizes, polydisperse
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    effective_times,
    flux_of,
    forever,
    layers,
    prediction,
    terminal_velocities,
    tilt_of,
)
from calibrate.models.yielding import yielding
from mrjax.continuum import characteristics, column_checks, kynch


def column(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """The tube as a column of layers, each with the drag of its own volume fraction (Kynch 1952).

    The mudline is exact, by the characteristics that meet it: `mrjax.column` converges to it with
    more cells. The cost does not grow with the time of a reading. Without local drag in the recipe
    it is the closed form. Particles of several sizes settle in classes (`polydisperse`),
    and a bed with a compression yields (`yielding`). A sample with a rotor settles in a centrifuge
    (`centrifuged`).

    Raises:
      InputError: the volume fraction of the bed is not known, or particles do not settle at every
        fraction up to that of the bed.
    """
    if sample.rotor is not None:
        return centrifuged(sample, near, sample.rotor)
    if has_several_sizes(near):
        return polydisperse(sample, near, seed, varied, checkpoint)
    if near.compression is not None:
        return yielding(sample, near)
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    reading_times, height = jnp.asarray(sample.times, float), jnp.asarray(sample.height, float)

    def upright_times(suspension: Suspension, flux: kynch.Table, times: Array) -> Array:
        """The times at which an upright tube without delay or ageing has the same state; s."""
        tilt, times = tilt_of(sample, suspension), effective_times(suspension, times)
        if tilt is None:
            return times
        return characteristics.tilted_times(flux, height, times, tilt)

    if sample.times or sample.points:
        column_checks.refuse_not_settling(flux_of(near, fraction_of_bed(near, bed)))

    @jax.jit  # one program for calls with plain numbers, too
    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        ratio, local = jnp.zeros(0), jnp.zeros(0)
        if sample.times or sample.points:
            flux = flux_of(suspension, fraction_of_bed(suspension, bed))
            # A factor, not a `where`: so derivatives are NaN, too.
            possible = jnp.where(column_checks.settles(flux), 1.0, jnp.nan)
            if suspension.parameters.yield_growth is not None:
                last = upright_times(suspension, flux, forever())
                final = possible * characteristics.mudline(flux, height, last)[0] / height
        if sample.times:
            effective = upright_times(suspension, flux, times)
            ratio = possible * characteristics.mudline(flux, height, effective) / height
        if sample.points:
            measured = layers(sample)
            measured = measured._replace(times=upright_times(suspension, flux, measured.times))
            coated = characteristics.mean_fraction(flux, height, *measured)
            local = possible * coated / suspension.parameters.f_r**3
        velocities = terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities, local)

    return predict
