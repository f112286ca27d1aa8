"""Readings that cannot be true of their tube, found before anything is fitted to them.

A mudline begins at the height of the suspension, is never above it nor below what the particles
alone would fill, and only falls. What is off by more than its error allows is refused; what may
be right all the same, such as a reading a little off, is told as a warning.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import Suspension
from calibrate.experiment.units import CURVES, TIME_UNITS
from mrjax import InputError, Recipe, terminal_velocity

ERRORS = 3.0
"""Standard deviations by which a reading may be off."""
SHARE = 0.02
"""Of the height: as much is not refused at the start, or as a rise."""
ABSURD = 1e3
"""Factor on the speed that the recipe gives beyond which it is rather another unit."""


def refuse_senseless(sample: Sample, time_unit: str) -> list[str]:
    """Refuses readings of a curve that cannot be true; returns warnings about odd ones.

    Args:
      sample: with its measurements.
      time_unit: that of its file, in which a reading is named.

    Raises:
      InputError: a reading that cannot be: which, why, and what to mend.
    """
    curve = [one for one in sample.measurements if one.observable in CURVES]
    if not curve:
        return []
    of_height = curve[0].observable == "sedimentation_ratio"
    top = 1.0 if of_height else sample.height
    ratio = np.array([one.value * one.si / top for one in curve])
    error = np.array([one.standard_deviation * one.si / top for one in curve])
    times = np.array([sample.times[one.place or 0] for one in curve])

    def said(place: int) -> str:
        one, time = curve[place], times[place] / TIME_UNITS[time_unit]
        unit = "" if one.unit == "1" else f" {one.unit}"
        return f"{one.observable} = {one.value:g}{unit} at {time:g} {time_unit}"

    for place in np.flatnonzero(ratio - 1.0 > ERRORS * error)[:1]:
        most = "1" if of_height else f"height = {sample.height:g} m"
        raise InputError(
            f"{said(place)} is above {most}, by more than its error; mend the reading, its unit"
            f"{'' if of_height else ' or height'}"
        )
    if not sinks(sample.recipe):
        return []  # what rises leaves its mudline below
    odd = [*_start(said, ratio, error, times), *_rise(said, ratio, error)]
    solids = sample.recipe.volume_fraction
    for place in np.flatnonzero(solids - ratio > ERRORS * error)[:1]:
        raise InputError(
            f"{said(place)} is {ratio[place]:.3g} of the height, less than the particles alone "
            f"would fill, {solids:.3g}; mend the unit, height or composition, or give the mudline "
            "where the clear layer was read"
        )
    return odd


def sinks(recipe: Recipe) -> bool:
    """True if a coated particle is heavier than the fluid that it displaces."""
    return recipe.apparent_density > recipe.fluid.density


def _start(
    said: Callable[[int], str], ratio: np.ndarray, error: np.ndarray, times: np.ndarray
) -> list[str]:
    """Warns of a first reading, at time 0, that is below the height; refuses a large one."""
    if times[0] > 0.0 or 1.0 - ratio[0] <= ERRORS * error[0]:
        return []
    text = (
        f"{said(0)} is {ratio[0]:.4g} of the height, where nothing has settled yet; mend height or "
        "unit, or give the mudline where the clear layer was read"
    )
    if 1.0 - ratio[0] > SHARE:
        raise InputError(text)
    return [text]


def _rise(said: Callable[[int], str], ratio: np.ndarray, error: np.ndarray) -> list[str]:
    """Warns of a mudline that rises, at its largest rise; refuses a large one."""
    lowest = np.minimum.accumulate(ratio)
    before = np.maximum.accumulate(np.where(ratio == lowest, np.arange(ratio.size), 0))
    rise = ratio - lowest
    beyond = rise / (error + error[before])
    place = int(np.argmax(beyond))
    if beyond[place] <= ERRORS:
        return []
    text = (
        f"{said(place)} is above {said(before[place])}, by more than their errors: a mudline only "
        "falls; mend the reading, or give a larger standard_deviation"
    )
    if rise[place] > SHARE:
        raise InputError(text)
    return [text]


def oddities(samples: Sequence[Sample], suspensions: Iterable[Suspension]) -> Iterator[str]:
    """Warnings about an experiment as a whole: speeds out of proportion, repeated readings.

    Args:
      samples: all of the experiment.
      suspensions: each sample with the medians in their places.
    """
    for sample, suspension in zip(samples, suspensions, strict=True):
        yield from _absurd_speed(sample, suspension)
    for number, sample in enumerate(samples):
        for other in samples[:number]:
            if _readings(sample) == _readings(other):
                yield (
                    f"samples {other.name!r} and {sample.name!r}: have the same readings, which "
                    "count as independent; keep one if they were read once"
                )


def _readings(sample: Sample) -> tuple:
    return sample.measurements, sample.times, sample.recipe if not sample.times else None


def _absurd_speed(sample: Sample, suspension: Suspension) -> Iterator[str]:
    """A speed far from that of the recipe with the medians."""
    expected = float(np.abs(np.mean(np.asarray(terminal_velocity(suspension.parameters)))))
    for one in sample.measurements:
        if one.observable == "initial_velocity":
            ratio = one.value * one.si / expected
            if not 1.0 / ABSURD < ratio < ABSURD:
                yield (
                    f"sample {sample.name!r}: initial_velocity = {one.value:g} {one.unit} is "
                    f"{ratio:.2g} times what its recipe gives with the medians, "
                    f"{expected / one.si:.2g} {one.unit}: check unit, viscosity and diameter"
                )
    fastest = max((_speed(sample, one) for one in sample.measurements), default=0.0)
    if fastest > ABSURD * expected:
        yield (
            f"sample {sample.name!r}: its curve falls {fastest / expected:.2g} times faster than "
            "its recipe does with the medians: check time_unit, unit, viscosity and diameter"
        )


def _speed(sample: Sample, one: Measurement) -> float:
    """Mean speed of a mudline from time 0 to a reading, m/s; 0 of another measurement."""
    if one.observable not in CURVES or not sample.times[one.place or 0]:
        return 0.0
    scale = sample.height if one.observable == "sedimentation_ratio" else 1.0
    fallen = sample.height - (one.value + ERRORS * one.standard_deviation) * one.si * scale
    return fallen / sample.times[one.place or 0]
