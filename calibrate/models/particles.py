"""A simulation of all particles as a forward model."""

from pathlib import Path

import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, Suspension
from calibrate.models.bed import final_ratio, needs_a_bed, refuse_other_paths, to_rest
from calibrate.models.falling import fall, falls
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    prediction,
    refuse_rotor,
    refuse_spread,
    refuse_yielding,
)
from mrjax import InputError
from mrjax.observables import interface


def particles(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """A simulation of all particles of the recipe's box.

    A curve, and a final ratio without a bed fraction, come from one run to rest. Without inertia a
    change of the falling velocity v scales the times of the curve by 1 / v, and changes nothing
    else. A tube of height H takes H / h times as long as a box of height h. Each concentration of a
    table of velocities has a box of its own, as large as the recipe's. Concentrations at a height
    are not predicted.

    Raises:
      InputError: the particles cannot be dispersed in the box, something varies that would
        change the path of a curve, or concentrations were measured at a height.
    """
    recipe = sample.recipe
    falling = mrjax.terminal_velocity(near.parameters)
    reading_times = jnp.asarray(sample.times, float)
    refuse_rotor(sample, "particles")
    refuse_yielding(sample, near, "particles")
    refuse_spread(sample, near, "particles")
    for word, value in (("delay", near.delay), ("tilt", near.tilt)):
        if value is not None:
            raise InputError(
                f"sample {sample.name!r}: the model particles has no {word}; fit with column or "
                "closed-form"
            )
    if sample.times and near.bed_fraction is not None:
        raise InputError(
            f"sample {sample.name!r}: particles of a curve pack to a volume fraction of their own; "
            f"take {BED} away, or fit with another model"
        )
    if sample.points:
        raise InputError(
            f"sample {sample.name!r}: a box of few particles has no concentration at a height; fit "
            "with column or closed-form"
        )
    diluted = falls(sample.name, recipe, near, seed, sample.fractions)
    state = undiluted = None
    if not diluted or any(measurement.concentration is None for measurement in sample.measurements):
        state = mrjax.disperse(recipe, seed)
        undiluted = fall(sample.name, recipe, near, state)
    simulated = needs_a_bed(sample) and near.bed_fraction is None
    if simulated and state is not None:
        refuse_other_paths(sample, varied)
        run = to_rest(recipe, near, state, checkpoint)
        ratios = interface.sedimentation_ratio(run)

    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        velocity = jnp.asarray(jnp.nan) if undiluted is None else undiluted(suspension)
        velocities = (
            jnp.stack([velocity_of(suspension) for velocity_of in diluted])
            if diluted
            else jnp.zeros(0)
        )
        if not simulated:
            final = final_ratio(suspension, None)
            return prediction(sample, suspension, velocity, final, times, velocities)
        faster = jnp.mean(mrjax.terminal_velocity(suspension.parameters)) / jnp.mean(falling)
        scaled = times * faster * (recipe.box.height / sample.height)
        ratio = jnp.interp(scaled, run.times, ratios)
        return prediction(sample, suspension, velocity, ratios[-1], ratio, velocities)

    return predict
