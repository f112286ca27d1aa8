"""A tube with a yielding bed as a forward model: `mrjax.column` with a compression."""

import jax
import jax.numpy as jnp
from jax import Array

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models.prediction import (
    ForwardModel,
    Layers,
    Prediction,
    flux_of,
    layers,
    prediction,
    terminal_velocities,
    tilt_of,
    without_delay,
)
from mrjax import InputError
from mrjax.continuum import column_checks, consolidation
from mrjax.continuum import yielding as yielding_bed
from mrjax.continuum.case import Case

CELLS = 60
"""Material cells of the tube."""
STEPS = 120
"""Steps up to the last reading."""


def yielding(
    sample: Sample, near: Suspension, cells: int = CELLS, steps: int = STEPS
) -> ForwardModel:
    """The tube of a suspension whose bed yields under its own weight.

    The final ratio is that of the bed at rest, which may be long after the last reading.

    Args:
      sample: the sample with its measurements.
      near: a suspension that the model must predict.
      cells: material cells of the tube.
      steps: steps up to the last reading.

    Raises:
      InputError: the gel point is not below the greatest volume fraction of the bed, particles do
        not settle at every volume fraction of the bed, or some fall faster in a denser suspension.
    """
    reading_times = jnp.asarray(sample.times, float)
    height = jnp.asarray(sample.height, float)

    _refuse_impossible(sample, near)
    flux_near = flux_of(near)
    column_checks.refuse_not_settling(flux_near)
    column_checks.refuse_faster_if_denser(flux_near)

    @jax.jit  # one program for calls with plain numbers, too
    def predict(suspension: Suspension, times: Array = reading_times) -> Prediction:
        compression = suspension.compression
        assert compression is not None
        measured = layers(sample) if sample.points else Layers(*jnp.zeros((3, 0)))
        tilt = tilt_of(sample, suspension)
        both = without_delay(suspension, jnp.concatenate([times, measured.times]))
        case = Case(
            suspension.parameters,
            height,
            suspension.volume_fraction,
            jnp.asarray(suspension.bed_fraction, float),
            jnp.max(both, initial=0.0)[None],
            suspension.hindrance,
            None,
            tilt,
        ).as_arrays()
        velocity = mrjax.terminal_velocity(suspension.parameters)
        rest = consolidation.rest_height(case, compression, cells=cells)
        final = jnp.where(velocity > 0.0, jnp.minimum(rest / height, 1.0), 1.0)
        flux = flux_of(suspension)
        # A factor, not a `where`: so derivatives are NaN, too.
        possible = column_checks.settles(flux) & column_checks.slower_if_denser(flux)
        possible = possible & (compression.gel_fraction < suspension.bed_fraction)
        ratio, local = jnp.zeros(0), jnp.zeros(0)
        if both.size:
            settled = consolidation.consolidate(
                yielding_bed.until_last(case), compression, cells=cells, steps=steps
            )
            if tilt is not None:
                both = yielding_bed.tilted_times(case, compression, flux, settled, both)
            possible = possible & settled.solved
            mudline = consolidation.mudline_at(settled, both[: times.size])
            ratio = jnp.minimum(mudline / height, 1.0)
            volume = consolidation.volume_at(settled, both[times.size :])
            coated = consolidation.mean_fraction(
                case, settled.cells, volume, measured.levels, measured.thickness
            )
            local = coated / suspension.parameters.f_r**3
        valid = jnp.where(possible, 1.0, jnp.nan)
        velocities = terminal_velocities(sample, suspension)
        return prediction(
            sample, suspension, velocity, valid * final, valid * ratio, velocities, valid * local
        )

    return predict


def _refuse_impossible(sample: Sample, near: Suspension) -> None:
    """Refuses a gel point that is not below the greatest volume fraction of the bed.

    Raises:
      InputError: there is one.
    """
    assert near.compression is not None and near.bed_fraction is not None
    gel, densest = float(near.compression.gel_fraction), float(near.bed_fraction)
    if not gel < densest:
        raise InputError(
            f"sample {sample.name!r}: compression.gel_fraction = {gel:.4g} must be below "
            f"{densest:.4g}, the greatest volume fraction of its bed; give a smaller value, or a "
            "larger bed_fraction"
        )
