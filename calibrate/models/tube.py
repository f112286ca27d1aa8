"""The tube of a sample with fitted values, as fields over time and height."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

import mrjax
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import Suspension
from calibrate.models import polydisperse
from calibrate.models.prediction import tilt_of
from mrjax import InputError
from mrjax.continuum.case import Case
from mrjax.continuum.clock import delayed_times
from mrjax.continuum.exact import exact_column

Tube = mrjax.Column | mrjax.PolydisperseColumn

CELLS, YIELDING_CELLS = 100, 60
"""Cells of the fields of rigid beds, and of yielding ones."""
TIMES = 81
"""Times of the fields."""
COMPILED_QUICKLY = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
"""Options of a program that runs once: it takes a third of the time to compile."""


def tube(sample: Sample, suspension: Suspension, bed_fraction: ArrayLike) -> Tube:
    """The tube of a sample from the start to its last reading.

    Its times are as dense as the readings.

    Args:
      sample: sample with readings at some times.
      suspension: its suspension with fitted values.
      bed_fraction: volume fraction of the coated particles in its bed, or the largest one of a
        yielding bed; 1.
    """
    parameters, fraction = suspension.parameters, suspension.volume_fraction
    if polydisperse.has_several_sizes(suspension):
        classes = polydisperse.classes_of(sample, suspension)
        parameters = polydisperse.parameters_of(classes, suspension)
        fraction = polydisperse.fractions_of(classes, suspension)
    case = Case(
        parameters,
        sample.height,
        fraction,
        bed_fraction,
        field_times(sample),
        suspension.hindrance,
        suspension.compression,
        tilt_of(sample, suspension),
        sample.rotor,
    )
    delay = None if suspension.delay is None else jnp.asarray(suspension.delay, float)
    case = case.as_arrays().astype(float)
    settle = _settled if case.rotor is None else _at_times
    return settle(case, delay, jnp.asarray(sample.mudline_threshold))


def field_times(sample: Sample) -> np.ndarray:
    """Times of the fields of a sample, s, (TIMES,), from 0 to the last reading."""
    read = np.unique([0.0, *sample.times, *(point.time for point in sample.points)])
    return np.interp(np.linspace(0.0, read.size - 1.0, TIMES), np.arange(read.size), read)


def _at_times(case: Case, delay: Array | None, threshold: Array) -> Tube:
    """The tube at the times of a case; with a delay its clock runs slowly at first."""
    times = jnp.asarray(case.times)
    if delay is None:
        return _upon_start(case, threshold)
    clock = partial(delayed_times, delay=delay)
    effective, rate = jax.jvp(clock, (times,), (jnp.ones_like(times),))
    settled = _upon_start(case._replace(times=effective), threshold)
    velocity = settled.settling_velocity * rate[:, None]
    if isinstance(settled, mrjax.PolydisperseColumn):
        classes = settled.class_velocities * rate[:, None, None]
        return replace(settled, times=times, settling_velocity=velocity, class_velocities=classes)
    return replace(settled, times=times, settling_velocity=velocity)


_settled = jax.jit(_at_times, compiler_options=COMPILED_QUICKLY)


def _upon_start(case: Case, threshold: Array) -> Tube:
    """The tube of a case without a delay."""
    if case.rotor is None and case.compression is None and not jnp.ndim(case.volume_fraction):
        return exact_column(case, cells=CELLS)
    common = {name: value for name, value in case._asdict().items() if name != "parameters"}
    if jnp.ndim(case.volume_fraction):
        if case.compression is not None or case.rotor is not None:
            raise InputError(
                "particles of several sizes have no yielding bed and no rotor; leave one out"
            )
        del common["compression"], common["rotor"]
        cells = polydisperse.CELLS
        return mrjax.polydisperse_column(
            case.parameters, threshold=threshold, cells=cells, **common
        )
    cells = YIELDING_CELLS if case.rotor is None else CELLS
    return mrjax.column(case.parameters, cells=cells, **common)
