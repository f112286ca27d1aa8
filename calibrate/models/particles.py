"""A simulation of all particles as a forward model."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, Suspension
from calibrate.models.bed import final_ratio, needs_a_bed, refuse_other_paths, to_rest
from calibrate.models.prediction import ForwardModel, Prediction, prediction
from mrjax import InputError
from mrjax.core import checks
from mrjax.core.tracing import value_or_none
from mrjax.laws import particle, time_scales
from mrjax.observables import interface

RELAXATIONS = 40
"""Length of a run, and its number of steps: the start is forgotten to e^-40, and to 1e-5 where
the fit ends at a drag 3 times smaller. The fall is exact at any step."""

MARGIN = 10.0
"""How much faster than expected the particles may fall before they could meet within a run."""

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


def particles(
    sample: Sample,
    near: Suspension,
    seed: int = 0,
    varied: tuple[str, ...] = (),
    checkpoint: Path | None = None,
) -> ForwardModel:
    """A simulation of all particles of the recipe's box.

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
    simulated = needs_a_bed(sample) and near.bed_fraction is None
    if simulated:
        refuse_other_paths(sample, varied)
        whole = to_rest(recipe, near, state, checkpoint)
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
            return prediction(sample, suspension, velocity, final_ratio(suspension, None), times)
        faster = jnp.mean(mrjax.terminal_velocity(suspension.parameters)) / jnp.mean(falling)
        scaled = times * faster * (recipe.box.height / sample.height)
        ratio = jnp.interp(scaled, whole.times, ratios)
        return prediction(sample, suspension, velocity, ratios[-1], ratio)

    return predict
