"""A forward model of one's own: the tube by finite volumes of few cells, right near one place."""

import jax.numpy as jnp

import mrjax
from calibrate.models.bed import final_ratio
from calibrate.models.prediction import prediction, terminal_velocities

CELLS = 20
STEPS_TO_SPARE = 4
"""How many times faster than where it is prepared a fit may make the particles fall."""


def coarse_column(sample, near, seed=0, varied=(), checkpoint=None):
    """As `calibrate.models.column.column`, with as many steps as its start needs, and some more."""

    def tube(suspension):
        return dict(
            parameters=suspension.parameters,
            height=sample.height,
            volume_fraction=suspension.volume_fraction,
            bed_fraction=suspension.bed_fraction,
            times=jnp.asarray(sample.times, float),
            hindrance=suspension.hindrance,
            cells=CELLS,
        )

    steps = STEPS_TO_SPARE * mrjax.column_steps(**tube(near))

    def predict(suspension):
        velocity = jnp.mean(mrjax.terminal_velocity(suspension.parameters))
        ratio = mrjax.column(**tube(suspension), steps=steps).mudline / sample.height
        final, velocities = final_ratio(suspension, None), terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities)

    return predict
