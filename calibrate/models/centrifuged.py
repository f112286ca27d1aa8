"""A tube in the rotor of a centrifuge as a forward model: Kynch's theory there, without a grid."""

import jax
import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.bed import simulated_fraction
from calibrate.models.prediction import (
    ForwardModel,
    Prediction,
    flux_of,
    prediction,
    refuse_spread,
    refuse_yielding,
    terminal_velocities,
    without_delay,
)
from mrjax import Rotor
from mrjax.continuum import centrifuge, column_checks, rotor_checks
from mrjax.continuum.case import Case


def centrifuged(sample: Sample, near: Suspension, rotor: Rotor) -> ForwardModel:
    """The tube of a sample in a rotor, whose floor has the acceleration of `Parameters.gravity`.

    Times are those of the rotor at speed, and heights are above its floor. The bed is rigid.

    Raises:
      InputError: the bed yields, a spread of sizes is fitted, the volume fraction of the bed is not
        known, particles do not settle at every volume fraction up to that of the bed, or some fall
        faster in a denser suspension.
    """
    refuse_yielding(sample, near, "column in a rotor")
    refuse_spread(sample, near, "column in a rotor")
    simulated_fraction(sample, near, 0, (), None)  # refuses a bed that is not known
    reading_times = jnp.asarray(sample.times, float)

    if sample.times:
        column_checks.refuse_not_settling(flux_of(near))
        column_checks.refuse_faster_if_denser(flux_of(near), "in a rotor")
        rotor_checks.refuse(
            Case(
                near.parameters,
                rotor.height,
                near.volume_fraction,
                near.bed_fraction,
                reading_times,
                near.hindrance,
                None,
                rotor=rotor,
            )
        )

    @jax.jit  # one program for calls with plain numbers, too
    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        velocity = mrjax.terminal_velocity(suspension.parameters)
        final, ratio = jnp.asarray(jnp.nan), jnp.zeros(0)
        if suspension.bed_fraction is not None:
            final = rotor.final_ratio(suspension.volume_fraction / suspension.bed_fraction)
        if sample.times:
            flux = flux_of(suspension)
            # A factor, not a `where`: so derivatives are NaN, too.
            possible = column_checks.settles(flux) & column_checks.slower_if_denser(flux)
            mudline = centrifuge.mudline(
                suspension.parameters,
                suspension.hindrance,
                suspension.volume_fraction,
                jnp.asarray(suspension.bed_fraction, float),
                rotor,
                without_delay(suspension, times),
            )
            ratio = jnp.where(possible, 1.0, jnp.nan) * mudline / sample.height
        velocities = terminal_velocities(sample, suspension)
        return prediction(sample, suspension, velocity, final, ratio, velocities)

    return predict
