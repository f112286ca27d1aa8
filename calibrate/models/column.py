"""The tube in one dimension as a forward model: Kynch's theory, without a grid."""

from pathlib import Path

import jax
import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import final_ratio, fraction_of_bed, simulated_fraction
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    layers,
    prediction,
    terminal_velocities,
)
from mrjax import InputError
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
    it is the closed form.

    Raises:
      InputError: the volume fraction of the bed is not known, particles are of several sizes, or do
        not settle at every fraction up to that of the bed.
    """
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    reading_times, height = jnp.asarray(sample.times, float), jnp.asarray(sample.height, float)

    def flux_of(suspension: Suspension) -> kynch.Table:
        densest = jnp.asarray(fraction_of_bed(suspension, bed), float)
        initial = suspension.volume_fraction
        return kynch.table(suspension.parameters, suspension.hindrance, initial, densest)

    if sample.times or sample.points:
        refuse_several_sizes(sample, near)
        column_checks.refuse_not_settling(flux_of(near))

    @jax.jit  # one program for calls with plain numbers, too
    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        ratio, local = jnp.zeros(0), jnp.zeros(0)
        if sample.times or sample.points:
            flux = flux_of(suspension)
            # A factor, not a `where`: so derivatives are NaN, too.
            possible = jnp.where(column_checks.settles(flux), 1.0, jnp.nan)
        if sample.times:
            ratio = possible * characteristics.mudline(flux, height, times) / height
        if sample.points:
            coated = characteristics.mean_fraction(flux, height, *layers(sample))
            local = possible * coated / suspension.parameters.f_r**3
        velocities = terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities, local)

    return predict


def refuse_several_sizes(sample: Sample, near: Suspension) -> None:
    """Refuses particles of several sizes, and names the single size that is equivalent.

    Stokes' velocity is proportional to d^2, and each particle counts by its mass, d^3. The diameter
    with the mean velocity by mass is therefore the root of the mean of d^2 by volume.

    Raises:
      InputError: the particles fall at several velocities.
    """
    if not jnp.ndim(mrjax.terminal_velocity(near.parameters)):
        return
    diameter = sample.recipe.particle.diameter
    instead = "one diameter"
    if not isinstance(diameter, float):
        instead = (
            f"particle.diameter = {diameter.settling_diameter:.4g}, whose velocity is their mean "
            "by mass (root of the mean of d^2 by volume)"
        )
    raise InputError(
        f"sample {sample.name!r}: the particles of its recipe are of several sizes, and a column "
        f"settles as equal ones; give {instead}, or fit with another model"
    )
