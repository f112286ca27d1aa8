"""Forward models: from a suspension to what was measured on it.

Each takes a sample, the suspension near which it will be asked, a seed, the names of what will
vary, and a folder that keeps a bed as it is simulated; it gives a function of a `Suspension` to
predictions in SI units. What does not depend on what varies is done once.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, CLOSURE, Suspension
from calibrate.experiment.units import CURVES
from mrjax import InputError
from mrjax.core import checks
from mrjax.core.tracing import value_or_none
from mrjax.laws import particle, time_scales
from mrjax.observables import interface
from mrjax.simulation.overlap import OVERLAP

RELAXATIONS = 40
"""Length of a run, and its number of steps: the start is forgotten to e^-40, and to 1e-5 where
the fit ends at a drag 3 times smaller. The fall is exact at any step."""

MARGIN = 10.0
"""How much faster than expected the particles may fall before they could meet within a run."""

CELLS = 200
"""Of a column: its mudline is then within 0.4 % of the height where layers spread or the bed is
met, and exact before and after."""

STEPS_TO_SPARE = 4
"""How many times faster than where it is prepared a fit may make the particles fall; beyond,
predictions are not a number while a fit traces them, and its search turns back."""
FEWEST_RELAXATIONS = 10.0
"""Of a run that is asked for a velocity: the start is forgotten to 5e-5."""

WITHOUT_CONTACTS = {
    "friction": 0.0,
    "rolling_friction": 0.0,
    "restitution": 1.0,
    "dissipation": 0.0,
    "tangential_dissipation": 0.0,
}
"""Of particles that meet nothing."""

TIME_SCALES = ("f_w", "f_s", "f_v", "viscosity", "gravity", "particle_density", "fluid_density")
"""What changes the speed of an overdamped settling suspension and not its path."""

Prediction = dict[str, Array]
ForwardModel = Callable[[Suspension], Prediction]
ForwardModelMaker = Callable[[Sample, Suspension, int, tuple[str, ...], Path | None], ForwardModel]


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
    bed = _bed(sample, near, seed, varied, checkpoint)
    times = jnp.asarray(sample.times, float)

    def predict(suspension: Suspension) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = _final_ratio(suspension, bed)
        ratio = jnp.maximum(1.0 - velocity * times / sample.height, final)
        return _of(sample, suspension, velocity, final, ratio)

    return predict


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
    bed = _bed(sample, near, seed, varied, checkpoint)
    steps = 0
    if sample.times:
        if jnp.ndim(mrjax.terminal_velocity(near.parameters)):
            raise InputError(
                f"sample {sample.name!r}: the particles of its recipe are of several sizes, and a "
                "column settles as equal ones; give one diameter, or fit with another model"
            )
        known = replace(near, bed_fraction=_either(near, bed))
        steps = STEPS_TO_SPARE * mrjax.column_steps(**_tube(sample, known, cells))

    def predict(suspension: Suspension) -> Prediction:
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        final = _final_ratio(suspension, bed)
        ratio = jnp.zeros(0)
        if sample.times:
            whole = replace(suspension, bed_fraction=_either(suspension, bed))
            tube = _tube(sample, whole, cells)
            ratio = mrjax.column(**tube, steps=_enough(steps, tube)).mudline / sample.height
        return _of(sample, suspension, velocity, final, ratio)

    return predict


def particles(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """What a simulation of all particles of the recipe's box shows.

    A curve, and a final ratio where no bed fraction is given, come from one run to rest: without
    inertia, what changes the falling velocity v changes a curve's times by 1 / v and nothing else,
    and a tube H high takes H / h times as long as a box h high.

    Raises:
      InputError: the particles cannot be dispersed in the box, or something varies that would
        change the path of a curve.
    """
    recipe, parameters = sample.recipe, near.parameters
    state = mrjax.disperse(recipe, seed)
    relaxation = float(time_scales.relaxation_time(parameters).max())
    duration = RELAXATIONS * relaxation
    falling = mrjax.terminal_velocity(parameters)
    travel = MARGIN * float(falling.max()) * duration
    radius = np.asarray(particle.outer_radius(parameters))
    reach = state.contact_diameter or 2.0 * float(radius.max())
    apart = not checks.may_touch(np.asarray(state.position), radius, recipe.box, 2 * travel, reach)
    times = jnp.asarray(sample.times, float)
    if sample.times and near.bed_fraction is not None:
        raise InputError(
            f"sample {sample.name!r}: the particles of a curve pack as they will; take {BED} away, "
            "or fit with another model"
        )
    simulated = _needs_a_bed(sample) and near.bed_fraction is None
    if simulated:
        _refuse_other_paths(sample, varied)
        whole = _to_rest(recipe, near, state, checkpoint)
        ratios = interface.sedimentation_ratio(whole)

    def predict(suspension: Suspension) -> Prediction:
        parameters = suspension.parameters
        slowest = value_or_none(jnp.max(time_scales.relaxation_time(parameters)))
        if slowest is not None and FEWEST_RELAXATIONS * slowest > duration:
            raise InputError(
                f"sample {sample.name!r}: particles relax {slowest / relaxation:.3g} times more "
                "slowly than where this model was prepared; prepare it near these values"
            )
        if apart:  # what acts in contacts alone would change nothing, and take long to compile
            parameters = parameters.replace(**WITHOUT_CONTACTS)
        run = mrjax.simulate(
            state,
            parameters,
            recipe.box,
            duration=duration,
            time_step=relaxation,
            hindrance=suspension.hindrance,
        )
        velocity = mrjax.settling_velocity(run)
        if not simulated:
            return _of(sample, suspension, velocity, _final_ratio(suspension, None), times)
        faster = jnp.mean(mrjax.terminal_velocity(suspension.parameters)) / jnp.mean(falling)
        scaled = times * faster * (recipe.box.height / sample.height)
        ratio = jnp.interp(scaled, whole.times, ratios)
        return _of(sample, suspension, velocity, ratios[-1], ratio)

    return predict


def as_measured(sample: Sample, prediction: Prediction) -> list[Array]:
    """What a prediction says of each measurement of its sample, in the measurement's unit; ()."""
    found = []
    for one in sample.measurements:
        value = prediction[one.observable]
        found.append(jnp.asarray(value if one.place is None else value[one.place], float) / one.si)
    return found


FORWARD_MODELS: dict[str, ForwardModelMaker] = {
    "closed-form": closed_form,
    "column": column,
    "particles": particles,
}
"""The forward models by the names of the command line."""


def forward_model(model: str | ForwardModelMaker) -> ForwardModelMaker:
    """A forward model by its name, or as it is given.

    Raises:
      InputError: no such model.
    """
    if not isinstance(model, str):
        return model
    if model not in FORWARD_MODELS:
        raise InputError(f"model = {model!r}: must be one of {', '.join(FORWARD_MODELS)}")
    return FORWARD_MODELS[model]


def _of(
    sample: Sample, suspension: Suspension, velocity: Array, final: Array, ratio: Array
) -> Prediction:
    return {
        "initial_velocity": velocity,
        "final_ratio": final,
        "sedimentation_ratio": ratio,
        "mudline": sample.height * ratio,
        "viscosity_ratio": suspension.parameters.f_v,
    }


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
    """As many steps as a fit has, or more where it is known that they do not do."""
    if any(value_or_none(leaf) is None for leaf in jax.tree.leaves(tube)):
        return steps
    return max(steps, mrjax.column_steps(**tube))


def _needs_a_bed(sample: Sample) -> bool:
    of_bed = {"final_ratio", *CURVES}
    return any(one.observable in of_bed for one in sample.measurements)


def _either(suspension: Suspension, bed: float | None) -> Array | None:
    """What varies, or else what was simulated."""
    return suspension.bed_fraction if bed is None else jnp.asarray(bed, float)


def _final_ratio(suspension: Suspension, bed: float | None) -> ArrayLike:
    """phi_0 / phi_bed: all that was dispersed lies in the bed; 1."""
    fraction = _either(suspension, bed)
    return jnp.nan if fraction is None else suspension.volume_fraction / fraction


def _bed(
    sample: Sample,
    near: Suspension,
    seed: int,
    varied: tuple[str, ...],
    checkpoint: Path | None,
) -> float | None:
    """The volume fraction of the bed where a simulation gives it, once; else None."""
    if not _needs_a_bed(sample):
        return None
    if sample.bed_fraction == "particles":
        _refuse_other_paths(sample, varied)
        # Of a uniform bed; the top of a box of few particles is that of one of them.
        settled = _to_rest(sample.recipe, near, mrjax.disperse(sample.recipe, seed), checkpoint)
        ratio = interface.sedimentation_ratio(settled, "twice-centre-of-mass")
        return float(near.volume_fraction / ratio[-1])
    if near.bed_fraction is None:
        raise InputError(
            f"sample {sample.name!r}: how densely its bed lies is not known; give bed_fraction, "
            f'bed_fraction = "particles", or a [[parameter]] named {BED}'
        )
    if not float(near.volume_fraction) < float(near.bed_fraction) < 1.0:
        raise InputError(
            f"sample {sample.name!r}: {BED} = {float(near.bed_fraction):g} must be above that of "
            f"its suspension, {float(near.volume_fraction):.4g}, and below 1"
        )
    return None


def _to_rest(
    recipe: mrjax.Recipe, near: Suspension, state: mrjax.State, checkpoint: Path | None
) -> mrjax.Run:
    soft = mrjax.softened(near.parameters, recipe.box, recipe.particle_count, OVERLAP)
    return mrjax.settle(state, soft, recipe.box, hindrance=near.hindrance, checkpoint=checkpoint)


def _refuse_other_paths(sample: Sample, varied: tuple[str, ...]) -> None:
    """Passes where what varies changes only how fast the simulated bed forms."""
    local = sample.recipe.drag.local
    for name in varied:
        if name in TIME_SCALES or (name.startswith(CLOSURE) and not local):
            continue
        raise InputError(
            f"sample {sample.name!r}: {name} changes the path of particles into their bed, which a "
            f"fit simulates once; hold it, or fit with another model: only "
            f"{', '.join(TIME_SCALES)} may vary here"
        )
