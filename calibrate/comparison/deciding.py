"""Readings that would decide between two models: those on which they differ most.

Both predict at their fitted values: the same tube for longer, tubes of half and of twice the
height, and the initial velocity at half the volume fraction.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from calibrate.comparison.compare import Candidate, Verdict
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
    readings = [
        reading
        for one, other in zip(
            having.problem.experiment.samples, lacking.problem.experiment.samples, strict=True
        )
        if one.readings_of_curve
        for reading in _of_sample(one, other, having, lacking)
        if reading.deviations >= FEWEST_DEVIATIONS
    ]
    return sorted(readings, key=lambda reading: -reading.deviations)[:MOST]


def _of_sample(
    one: Sample, other: Sample, having: Candidate, lacking: Candidate
) -> Iterator[Reading]:
    """The reading of greatest difference in each tube of a sample, and of its dilution."""
    first = one.readings_of_curve[0]
    error = float(np.median([reading.standard_deviation for reading in one.readings_of_curve]))
    error *= first.si * (one.height if first.observable == "sedimentation_ratio" else 1.0)
    positive = [time for time in one.times if time > 0.0]
    for factor, tube in (
        (1.0, "its tube"),
        (SHORTER, "a tube of half the height"),
        (TALLER, "a tube of twice the height"),
    ):
        times = np.geomspace(min(positive), LONGER * max(positive), TIMES)
        tubes = (_variant(sample, factor * sample.height, times) for sample in (one, other))
        with_it, without_it = (
            np.asarray(_predicted(sample, model)["mudline"])
            for sample, model in zip(tubes, (having, lacking), strict=True)
        )
        apart = np.abs(with_it - without_it)
        if not np.isfinite(apart).all():
            continue
        place = int(np.argmax(apart))
        time = times[place] / TIME_UNITS[one.time_unit]
        yield Reading(
            f"the mudline of sample {one.name} in {tube} at {time:.3g} {one.time_unit}",
            1e3 * float(with_it[place]),
            1e3 * float(without_it[place]),
            "mm",
            float(apart[place] / error),
        )
    fraction = 0.5 * float(one.recipe.volume_fraction)
    diluted = (replace(sample, fractions=(fraction,)) for sample in (one, other))
    velocities = [
        1e6 * float(_predicted(sample, model)["initial_velocities"][0])
        for sample, model in zip(diluted, (having, lacking), strict=True)
    ]
    mean = 0.5 * abs(sum(velocities))
    if np.isfinite(mean) and mean > 0.0:
        yield Reading(
            f"the initial velocity of sample {one.name} at half its volume fraction",
            velocities[0],
            velocities[1],
            "µm/s",
            abs(velocities[0] - velocities[1]) / (VELOCITY_ERROR * mean),
        )


def _variant(sample: Sample, height: float, times: np.ndarray) -> Sample:
    return replace(sample, height=height, times=tuple(map(float, times)), points=())


def _predicted(sample: Sample, model: Candidate) -> Prediction:
    suspension = model.problem.experiment.suspension_of(sample, model.fit.theta)
    return column(sample, suspension)(suspension)
