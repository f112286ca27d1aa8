"""A tube of several sizes as a forward model: classes after Masliyah, Lockett and Bassoon."""

from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
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
    refuse_yielding,
    tilt_of,
    without_delay,
)
from mrjax.continuum.layers import layer_ends
from mrjax.continuum.sizes import interfaces, masliyah
from mrjax.recipe.size_classes import SizeClasses, log_normal_classes

CLASSES = 10
"""Classes of a continuous distribution."""
CELLS = 100
"""Cells of the tube."""
SHARE = 0.1
"""Part of the height that the suspension falls for its initial velocity."""


def has_several_sizes(suspension: Suspension) -> bool:
    """True if the particles of a suspension fall at several velocities."""
    return (
        suspension.spread is not None
        or jnp.ndim(mrjax.terminal_velocity(suspension.parameters)) > 0
    )


def polydisperse(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """The tube of a recipe of several sizes, by finite volumes (`mrjax.polydisperse_column`).

    A continuous distribution, that of the recipe or one of a fitted spread, is divided into ten
    classes of equal volume. The mudline is that of the sample's `mudline_threshold`. The initial
    velocity is its fall over a tenth of the height.

    Raises:
      InputError: the volume fraction of the bed is not known, or particles do not settle at every
        fraction up to that of the bed.
    """
    refuse_yielding(sample, near, "column for several sizes")
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    classes = classes_of(sample, near)
    reading_times = jnp.asarray(sample.times, float)
    velocity_is_measured = bool(sample.fractions) or any(
        measurement.observable == "initial_velocity" for measurement in sample.measurements
    )

    def tube(
        suspension: Suspension, times: Array, tilt: mrjax.Tilt | None = None, cells: int = CELLS
    ) -> mrjax.PolydisperseColumn:
        densest = fraction_of_bed(suspension, bed)
        return mrjax.polydisperse_column(
            parameters_of(classes, suspension),
            height=sample.height,
            volume_fraction=fractions_of(classes, suspension),
            bed_fraction=looser_bed(suspension) if densest is None else densest,
            times=times,
            hindrance=suspension.hindrance,
            threshold=sample.mudline_threshold,
            tilt=tilt,
            cells=cells,
        )

    def initial_velocity(suspension: Suspension) -> Array:
        mean = mean_velocity(classes, suspension)
        if not velocity_is_measured:
            return mean
        time = jax.lax.stop_gradient(SHARE * sample.height / mean)
        fallen = 1.0 - tube(suspension, time[None]).sedimentation_ratio[0]
        return sample.height * fallen / time

    if sample.times or sample.points:
        tube(near, jnp.ones(1), cells=4)  # refuses what does not settle

    @jax.jit  # one program for calls with plain numbers, too
    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        ratio, local, velocities = jnp.zeros(0), jnp.zeros(0), jnp.zeros(0)
        if sample.times:
            ratio = tube(
                suspension, without_delay(suspension, times), tilt_of(sample, suspension)
            ).sedimentation_ratio
        if sample.points:
            coated = _mean_fractions(sample, suspension, tube)
            local = coated / suspension.parameters.f_r**3
        if sample.fractions:
            velocities = jax.vmap(lambda fraction: initial_velocity(suspension.at(fraction)))(
                jnp.asarray(sample.fractions, float)
            )
        velocity, final = initial_velocity(suspension), jnp.asarray(final_ratio(suspension, bed))
        return prediction(sample, suspension, velocity, final, ratio, velocities, local)

    return predict


def classes_of(sample: Sample, near: Suspension) -> SizeClasses:
    """The classes of a sample's recipe, or classes of equal volume if a spread is fitted."""
    classes = sample.recipe.size_classes(CLASSES)
    if near.spread is None:
        return classes
    return classes._replace(volume_fraction=jnp.full(CLASSES, near.volume_fraction / CLASSES))


def parameters_of(classes: SizeClasses, suspension: Suspension) -> mrjax.Parameters:
    """The parameters of a suspension with one radius for each class, (K,)."""
    radius = classes.parameters.radius
    if suspension.spread is not None:
        relative = log_normal_classes(suspension.spread, classes.volume_fraction.size)
        radius = suspension.parameters.radius * relative
    return suspension.parameters.replace(radius=radius)


def fractions_of(classes: SizeClasses, suspension: Suspension) -> Array:
    """Volume fraction of the coated particles of each class; 1, (K,)."""
    total = jnp.sum(classes.volume_fraction)
    return suspension.volume_fraction * (classes.volume_fraction / total)


def looser_bed(suspension: Suspension) -> Array:
    """A volume fraction of the bed, for the velocity above one that is not known; ()."""
    fraction = suspension.volume_fraction
    return jnp.minimum(1.25 * fraction, 0.5 * (1.0 + fraction))


def mean_velocity(classes: SizeClasses, suspension: Suspension) -> Array:
    """Mean initial speed of the particles by volume; m/s, ()."""
    law = masliyah.classes(parameters_of(classes, suspension), suspension.hindrance)
    fractions, total = fractions_of(classes, suspension), suspension.volume_fraction
    flux = masliyah.fluxes(law, fractions[:, None], total)
    return jnp.abs(jnp.sum(flux)) / total


def _mean_fractions(
    sample: Sample, suspension: Suspension, tube: Callable[..., mrjax.PolydisperseColumn]
) -> Array:
    """Mean volume fraction of the coated particles over the layers of a sample; 1, (Q,)."""
    layer = layers(sample)
    times, place = np.unique([point.time for point in sample.points], return_inverse=True)
    effective = without_delay(suspension, jnp.asarray(times))
    settled = tube(suspension, effective, tilt_of(sample, suspension))
    profiles = settled.volume_fraction[jnp.asarray(place)]
    cell = sample.height / profiles.shape[1]
    low, high = layer_ends(layer.levels, layer.thickness, sample.height)
    below_low, below_high = (
        interfaces.volume_below(profiles[:, None], end / cell)[:, 0] for end in (low, high)
    )
    return (below_high - below_low) * cell / (high - low)
