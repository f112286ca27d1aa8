"""The tube in one dimension as a forward model."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import final_ratio, fraction_of_bed, simulated_fraction
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    prediction,
    terminal_velocities,
)
from mrjax import InputError
from mrjax.core.tracing import value_or_none

CELLS = 200
"""Of a column: its mudline is then within 0.4 % of the height where layers spread or the bed is
met, and exact before and after."""

STEPS_TO_SPARE = 4
"""How many times faster than where it is prepared a fit may make the particles fall; beyond,
predictions are not a number while a fit traces them, and its search turns back."""


def column(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
    *,
    cells: int = CELLS,
) -> ForwardModel:
    """The tube as a column of layers, each with the drag of its own volume fraction (Kynch 1952).

    Without local drag in the recipe it is the closed form, by finite volumes.

    Raises:
      InputError: the volume fraction of the bed is not known, or particles are of several sizes.
    """
    bed = simulated_fraction(sample, near, seed, varied, checkpoint)
    steps = 0
    if sample.times:
        refuse_several_sizes(sample, near)
        known = replace(near, bed_fraction=fraction_of_bed(near, bed))
        steps = STEPS_TO_SPARE * mrjax.column_steps(**_tube(sample, known, cells))

    def predict(suspension: Suspension) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = final_ratio(suspension, bed)
        ratio = jnp.zeros(0)
        if sample.times:
            whole = replace(suspension, bed_fraction=fraction_of_bed(suspension, bed))
            tube = _tube(sample, whole, cells)
            ratio = mrjax.column(**tube, steps=_enough(steps, tube)).mudline / sample.height
        velocities = terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities)

    return predict


def refuse_several_sizes(sample: Sample, near: Suspension) -> None:
    """Refuses particles of several sizes; names the one size that stands for them.

    Stokes' velocity goes as d^2, and each particle counts by its mass, d^3: the diameter whose
    velocity is the mean by mass is the root of the mean of d^2 by volume.

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


def _tube(sample: Sample, suspension: Suspension, cells: int) -> dict:
    return {
        "parameters": suspension.parameters,
        "height": sample.height,
        "volume_fraction": suspension.volume_fraction,
        "bed_fraction": suspension.bed_fraction,
        "times": jnp.asarray(sample.times, float),
        "hindrance": suspension.hindrance,
        "cells": cells,
    }


def _enough(steps: int, tube: dict) -> int:
    """The steps of a fit, or more where it is known that these are too few."""
    if any(value_or_none(leaf) is None for leaf in jax.tree.leaves(tube)):
        return steps
    return max(steps, mrjax.column_steps(**tube))
