"""The volume fraction of the bed at rest: stated, fitted, or simulated once."""

from pathlib import Path

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, CLOSURE, Suspension
from calibrate.experiment.units import CURVES
from mrjax import InputError
from mrjax.laws import yield_stress
from mrjax.observables import interface
from mrjax.simulation.overlap import OVERLAP

TIME_SCALES = ("f_w", "f_s", "f_v", "viscosity", "gravity", "particle_density", "fluid_density")
"""Parameters that change the speed of overdamped settling, and not the paths of the particles."""


def needs_a_bed(sample: Sample) -> bool:
    """True if a measurement of the sample depends on the bed at rest."""
    of_bed = {"final_ratio", "volume_fraction", *CURVES}
    return any(measurement.observable in of_bed for measurement in sample.measurements)


def can_be(sample: Sample, suspension: Suspension) -> Array:
    """True for a possible suspension: thinner than solid, and thinner than its bed; ()."""
    fraction = suspension.volume_fraction
    if suspension.bed_fraction is None or not needs_a_bed(sample):
        return fraction < 1.0
    return fraction < suspension.bed_fraction


def fraction_of_bed(suspension: Suspension, bed: float | None) -> Array | None:
    """Volume fraction of the bed: the simulated one, or that of the suspension if `bed` is None."""
    return suspension.bed_fraction if bed is None else jnp.asarray(bed, float)


def final_ratio(suspension: Suspension, bed: float | None) -> ArrayLike:
    """Final over initial height, phi_0 / phi_bed, with all particles in the bed.

    It is 1 if a yield stress holds all particles.
    """
    fraction = fraction_of_bed(suspension, bed)
    if fraction is None:
        return jnp.nan
    ratio = suspension.volume_fraction / fraction
    if yield_stress.is_newtonian(suspension.parameters):
        return ratio
    still = jnp.all(mrjax.terminal_velocity(suspension.parameters) == 0.0)
    return jnp.where(still, 1.0, ratio)


def simulated_fraction(
    sample: Sample,
    near: Suspension,
    seed: int,
    varied: tuple[str, ...],
    checkpoint: Path | None,
) -> float | None:
    """Volume fraction of the bed from one simulation; None if it is not simulated.

    Raises:
      InputError: the fraction is needed and unknown, or out of range, or something varies that
        would change the simulated bed.
    """
    if not needs_a_bed(sample):
        return None
    if sample.bed_fraction == "particles":
        refuse_other_paths(sample, varied)
        # As for a uniform bed: in a box of few particles the top is that of a single one.
        settled = to_rest(sample.recipe, near, mrjax.disperse(sample.recipe, seed), checkpoint)
        ratio = interface.sedimentation_ratio(settled, "twice-centre-of-mass")
        return float(near.volume_fraction / ratio[-1])
    if near.bed_fraction is None:
        raise InputError(
            f"sample {sample.name!r}: the volume fraction of its bed is not known; give "
            f'bed_fraction, bed_fraction = "particles", or a [[parameter]] named {BED}'
        )
    if not float(near.volume_fraction) < float(near.bed_fraction) < 1.0:
        raise InputError(
            f"sample {sample.name!r}: {BED} = {float(near.bed_fraction):g} must be above that of "
            f"its suspension, {float(near.volume_fraction):.4g}, and below 1"
        )
    return None


def to_rest(
    recipe: mrjax.Recipe, near: Suspension, state: mrjax.State, checkpoint: Path | None
) -> mrjax.Run:
    """Simulates a suspension until its bed is at rest, with softened contacts."""
    soft = mrjax.softened(near.parameters, recipe.box, recipe.particle_count, OVERLAP)
    return mrjax.settle(state, soft, recipe.box, hindrance=near.hindrance, checkpoint=checkpoint)


def refuse_other_paths(sample: Sample, varied: tuple[str, ...]) -> None:
    """Refuses to vary a parameter that changes more of a simulated bed than its speed of forming.

    Raises:
      InputError: such a parameter varies.
    """
    local = sample.recipe.drag.local
    for name in varied:
        if name in TIME_SCALES or (name.startswith(CLOSURE) and not local):
            continue
        raise InputError(
            f"sample {sample.name!r}: {name} changes the path of particles into their bed, which a "
            f"fit simulates once; hold it, or fit with another model: only "
            f"{', '.join(TIME_SCALES)} may vary here"
        )
