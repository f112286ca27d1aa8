"""Forward models and their predictions."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import SPREAD, Suspension
from mrjax import InputError, terminal_velocity
from mrjax.continuum import kynch
from mrjax.continuum.clock import delayed_times
from mrjax.continuum.tilt import Tilt
from mrjax.laws import yield_stress

Prediction = dict[str, Array]
"""Predictions by observable, in SI units; those of a curve are for all of its times.

`initial_velocities` are those of a table, for all of its concentrations. `concentrations` are the
mean volume fractions of uncoated particles over the layers of `Sample.points`, (Q,)."""

ForwardModel = Callable[..., Prediction]
"""Function from a suspension to its predictions. If it takes `times`, (T,) in s, as well, it
predicts a curve between its readings."""

ForwardModelMaker = Callable[[Sample, Suspension, int, tuple[str, ...], Path | None], ForwardModel]
"""Function that prepares a forward model, from a sample, the suspension it is prepared for, a seed,
the names of the varied parameters, and a folder that stores a simulated bed."""


class Layers(NamedTuple):
    """Layers of a tube over which concentrations are averaged, (Q,) each."""

    levels: Array
    """Middle of each layer, m above the floor."""
    times: Array
    """Time of each reading, s."""
    thickness: Array
    """Thickness of each layer, m."""


def layers(sample: Sample) -> Layers:
    """The layers in which the concentrations of a sample were measured."""
    height, time, thickness = jnp.asarray([point[:3] for point in sample.points], float).T
    return Layers(height, time, thickness)


def effective_times(suspension: Suspension, times: Array) -> Array:
    """The times at which the tube has the same state without a delay and without ageing; s."""
    return yield_stress.effective_times(suspension.parameters, without_delay(suspension, times))


def without_delay(suspension: Suspension, times: Array) -> Array:
    """The times at which the tube has the same state without a delay; s."""
    return times if suspension.delay is None else delayed_times(times, suspension.delay)


def tilt_of(sample: Sample, suspension: Suspension) -> Tilt | None:
    """The tilt of the tube of a sample; None for an upright tube, and without a tube's gap.

    A recipe that is only predicted has no tube.
    """
    if suspension.tilt is None or sample.gap is None:
        return None
    return Tilt(angle=suspension.tilt, gap=sample.gap)


def refuse_rotor(sample: Sample, model: str) -> None:
    """Refuses a rotor for a model under gravity.

    Raises:
      InputError: the sample settled in a rotor.
    """
    if sample.rotor is not None:
        raise InputError(f"sample {sample.name!r}: the model {model} has no rotor; fit with column")


def refuse_yielding(sample: Sample, near: Suspension, model: str) -> None:
    """Refuses a yielding bed for a model with a rigid one.

    Raises:
      InputError: the bed yields.
    """
    if near.compression is not None:
        raise InputError(
            f"sample {sample.name!r}: its bed yields (compression), and that of the model {model} "
            "is rigid; fit with column, or leave the compression out"
        )


def forever() -> Array:
    """A time by which an ageing carrier has stopped every particle; s, (1,)."""
    return jnp.full(1, yield_stress.FOREVER)


def refuse_spread(sample: Sample, near: Suspension, model: str) -> None:
    """Refuses a fitted spread of sizes for a model that takes the sizes of the recipe.

    Raises:
      InputError: the spread is fitted.
    """
    if near.spread is not None:
        raise InputError(
            f"sample {sample.name!r}: its {SPREAD} is for several sizes in an upright or tilted "
            f"column, and the model {model} takes the sizes of the recipe; fit with column, or "
            "leave it out"
        )


def flux_of(suspension: Suspension, densest: ArrayLike | None = None) -> kynch.Table:
    """Kynch's flux of a suspension up to the volume fraction of its bed.

    Args:
      suspension: the suspension.
      densest: volume fraction of the bed; by default that of the suspension.
    """
    bed = suspension.bed_fraction if densest is None else densest
    return kynch.table(
        suspension.parameters,
        suspension.hindrance,
        suspension.volume_fraction,
        jnp.asarray(bed, float),
    )


def terminal_velocities(sample: Sample, suspension: Suspension) -> Array:
    """Eq. 27 at each concentration of a sample's velocities, (K,) in m/s."""
    if not sample.fractions:
        return jnp.zeros(0)

    def velocity(fraction: Array) -> Array:
        return jnp.mean(terminal_velocity(suspension.at(fraction).parameters))

    return jax.vmap(velocity)(jnp.asarray(sample.fractions, float))


def initial_rate(sample: Sample, suspension: Suspension) -> Array | float:
    """Initial velocity of the mudline over that of Eq. 27, in a tilted tube or a rotor; ()."""
    tilt, rotor = tilt_of(sample, suspension), sample.rotor
    if rotor is not None:
        return rotor.top_radius / rotor.floor_radius
    return 1.0 if tilt is None else tilt.rate(sample.height)


def prediction(
    sample: Sample,
    suspension: Suspension,
    velocity: Array,
    final: Array,
    ratio: Array,
    velocities: Array,
    concentrations: Array | None = None,
) -> Prediction:
    """The prediction of everything that can be measured on a sample.

    A tilt of its tube makes the initial velocities larger; in a rotor they are those at the top.

    Args:
      sample: the sample with its measurements.
      suspension: the suspension of the prediction.
      velocity: initial velocity in an upright tube, in a rotor at its floor, () in m/s.
      final: final height over that of the suspension, ().
      ratio: height over that of the suspension at the sample's times, (T,).
      velocities: the same at each of the sample's fractions, (K,) in m/s.
      concentrations: mean volume fraction of the uncoated particles at each of the sample's points,
        (Q,); None for a model without them.
    """
    local = {} if concentrations is None else {"concentrations": concentrations}
    factor = initial_rate(sample, suspension)
    return local | {
        "initial_velocity": factor * velocity,
        "initial_velocities": factor * velocities,
        "final_ratio": final,
        "sedimentation_ratio": ratio,
        "mudline": sample.height * ratio,
        "viscosity_ratio": suspension.parameters.f_v,
    }


def as_measured(sample: Sample, prediction: Prediction) -> list[Array]:
    """The predicted value of each measurement of a sample, in the measurement's unit; ().

    Raises:
      InputError: concentrations were measured and are not predicted.
    """
    if sample.points and "concentrations" not in prediction:
        raise InputError(
            f"sample {sample.name!r}: this model predicts no concentration at a height; fit with "
            "column or closed-form, or give the predictions of your own model the key "
            f"concentrations, ({len(sample.points)},)"
        )
    values = []
    for measurement in sample.measurements:
        if measurement.point is not None:
            at_place = prediction["concentrations"][measurement.point.place]
        elif measurement.concentration is not None:
            at_place = prediction["initial_velocities"][measurement.concentration.place]
        elif measurement.place is not None:
            at_place = prediction[measurement.observable][measurement.place]
        else:
            at_place = prediction[measurement.observable]
        values.append(jnp.asarray(at_place, float) / measurement.si)
    return values
