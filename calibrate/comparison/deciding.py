"""Readings that would decide between two models: those on which they differ most.

Both predict at their fitted values: the same tube for longer, tubes of half and of twice the
height, and the initial velocity at half the volume fraction.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from calibrate.comparison.compare import Verdict
from calibrate.comparison.nested import Candidate
from calibrate.experiment.sample import Sample
from calibrate.experiment.units import TIME_UNITS
from calibrate.models.column import column
from calibrate.models.prediction import Prediction

LONGER = 10.0
"""Longest time of a reading, over that of the last one."""
TIMES = 60
SHORTER, TALLER = 0.5, 2.0
"""Heights of other tubes, over that of the sample."""
VELOCITY_ERROR = 0.05
"""Relative error of an initial velocity."""
FEWEST_DEVIATIONS = 3.0
"""Least difference of two predictions that a reading would see, in its standard deviations."""
MOST = 3


class Reading(NamedTuple):
    """A reading that would decide, with both predictions."""

    text: str
    """The reading in words, with its sample."""
    having: float
    """Prediction of the model that has the effect, in `unit`."""
    lacking: float
    """Prediction of the model that lacks it, in `unit`."""
    unit: str
    deviations: float
    """Their difference in standard deviations of a reading."""


def deciding_readings(verdict: Verdict) -> list[Reading]:
    """The readings on which the two models of an undecided effect differ most, first the best.

    Args:
      verdict: a verdict with both models.
    """
    having, lacking = verdict.best_with, verdict.best_without
    if having is None or lacking is None:
        return []
    pairs = zip(having.problem.experiment.samples, lacking.problem.experiment.samples, strict=True)
    readings = [
        reading
        for pair in pairs
        if any(time > 0.0 for time in pair[0].times)
        for reading in _of_sample(pair, (having, lacking))
        if reading.deviations >= FEWEST_DEVIATIONS
    ]
    return sorted(readings, key=lambda reading: -reading.deviations)[:MOST]


def _of_sample(
    pair: tuple[Sample, Sample], models: tuple[Candidate, Candidate]
) -> Iterator[Reading]:
    """The reading of greatest difference in each tube of a sample, and of its dilution.

    Args:
      pair: the sample as the two models have it.
      models: the model that has the effect, and the one that lacks it.
    """
    sample = pair[0]
    first = sample.readings_of_curve[0]
    error = float(np.median([reading.standard_deviation for reading in sample.readings_of_curve]))
    error *= first.si * (sample.height if first.observable == "sedimentation_ratio" else 1.0)
    earliest = min(time for time in sample.times if time > 0.0)
    times = np.geomspace(earliest, LONGER * max(sample.times), TIMES)
    for factor, tube in _tubes(sample):
        having, lacking = (
            _mudline(replace(variant, height=factor * sample.height), times, model)
            for variant, model in zip(pair, models, strict=True)
        )
        apart = np.abs(having - lacking)
        if not np.isfinite(apart).all():
            continue
        place = int(np.argmax(apart))
        time = times[place] / TIME_UNITS[sample.time_unit]
        yield Reading(
            f"the mudline of sample {sample.name} in {tube} at {time:.3g} {sample.time_unit}",
            1e3 * float(having[place]),
            1e3 * float(lacking[place]),
            "mm",
            float(apart[place] / error),
        )
    if sample.rotor is None:
        yield from _of_dilution(pair, models)


def _tubes(sample: Sample) -> Iterator[tuple[float, str]]:
    """Heights of tubes over that of the sample, with their names; that of a rotor stays."""
    yield 1.0, "its tube"
    if sample.rotor is None:
        yield SHORTER, "a tube of half the height"
        yield TALLER, "a tube of twice the height"


def _of_dilution(
    pair: tuple[Sample, Sample], models: tuple[Candidate, Candidate]
) -> Iterator[Reading]:
    """The initial velocity at half the volume fraction; arguments as for `_of_sample`."""
    fraction = 0.5 * float(pair[0].recipe.volume_fraction)
    having, lacking = (
        1e6 * _velocity(replace(sample, fractions=(fraction,)), model)
        for sample, model in zip(pair, models, strict=True)
    )
    mean = 0.5 * abs(having + lacking)
    if np.isfinite(mean) and mean > 0.0:
        text = f"the initial velocity of sample {pair[0].name} at half its volume fraction"
        deviations = abs(having - lacking) / (VELOCITY_ERROR * mean)
        yield Reading(text, having, lacking, "µm/s", deviations)


def _mudline(sample: Sample, times: np.ndarray, model: Candidate) -> np.ndarray:
    """Predicted heights of the mudline at other times, s; m, (T,)."""
    sample = replace(sample, times=tuple(map(float, times)), points=())
    return np.asarray(_predicted(sample, model)["mudline"])


def _velocity(sample: Sample, model: Candidate) -> float:
    """Predicted initial velocity at the first of a sample's volume fractions, m/s."""
    return float(_predicted(sample, model)["initial_velocities"][0])


def _predicted(sample: Sample, model: Candidate) -> Prediction:
    suspension = model.problem.experiment.suspension_of(sample, model.fit.theta)
    return column(sample, suspension)(suspension)
