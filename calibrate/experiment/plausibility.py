"""Checks of readings against their tube, before any fit.

A mudline begins at the height of the suspension and only falls. It is never above that height, nor
below the height that the particles alone would fill. Readings that differ from this by more than
their error are refused. Readings that may still be right, such as a first reading a little below
the height, cause a warning.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import Suspension
from calibrate.experiment.units import CURVES, TIME_UNITS, VOLUME_UNITS
from mrjax import InputError, Recipe, terminal_velocity
from mrjax.continuum import tilt
from mrjax.laws import yield_stress
from mrjax.recipe.plausibility import RANDOM_CLOSE_PACKING

ERRORS = 3.0
"""Largest deviation of a reading that is accepted, in standard deviations."""
SHARE = 0.02
"""Deviation, as a share of the height, that is accepted at the start and for readings without a
stated error."""
ABSURD = 1e3
"""Ratio of a measured speed to that of the recipe above which the unit is doubted."""
DENSER_THAN_BED = 1.2
"""Factor on the volume fraction of the bed at rest beyond which a concentration is odd."""
STEADY = ("final_ratio", "viscosity_ratio")
"""Measurements that the tilt of a tube does not change."""
FASTER_AT_FIRST = 100.0
"""Factor on the speed of a single particle up to which a suspension may fall before its first
reading."""

WAITED = 5.0
"""Fall extrapolated to before the first reading, over `SHARE`, above which the times are odd."""


class Readings(NamedTuple):
    """A curve in relation to its tube: T readings in the order of their times."""

    sample: Sample
    curve: list[Measurement]
    ratio: np.ndarray
    """Mudline over the height of the suspension, (T,)."""
    error: np.ndarray
    """Standard deviations of that ratio, (T,)."""
    times: np.ndarray
    """Times, s, (T,)."""

    def said(self, place: int) -> str:
        """A reading in words: its row, its value and its time."""
        measurement = self.curve[place]
        return f"{self._row(measurement)}{self.value(place)}"

    def value(self, place: int) -> str:
        """Value and time of a reading, as its file has them."""
        measurement, file = self.curve[place], self.sample.curve
        name = file.time_unit if file else "s"
        unit = "" if measurement.unit == "1" else f" {measurement.unit}"
        time = self.times[place] / TIME_UNITS[name]
        return f"{measurement.observable} = {measurement.value:g}{unit} at {time:g} {name}"

    @property
    def tube(self) -> str:
        """Keys that set the height of comparison: `height`, and for volumes also the diameter."""
        of_volume = self.curve[0].unit in VOLUME_UNITS
        return "tube_diameter or height" if of_volume else "height"

    def _row(self, measurement: Measurement) -> str:
        file = self.sample.curve
        return "" if file is None else f"{file.file}, {file.row_word} {measurement.row}: "


def refuse_senseless(sample: Sample) -> list[str]:
    """Refuses impossible readings of a curve; returns warnings about odd ones.

    Raises:
      InputError: a reading is impossible; the message has its row, its value and the remedy.
    """
    curve = [measurement for measurement in sample.measurements if measurement.observable in CURVES]
    if not curve:
        return []
    readings = _beside_the_tube(sample, curve)
    _refuse_above(readings)
    if not sinks(sample.recipe):
        return []  # particles that rise leave clear fluid below
    odd = [*_start(readings), *_late_start(readings)]
    _refuse_rise(readings)
    _refuse_below_particles(readings)
    return odd


def _beside_the_tube(sample: Sample, curve: list[Measurement]) -> Readings:
    of_height = curve[0].observable == "sedimentation_ratio"
    top = 1.0 if of_height else sample.height
    error = np.array(
        [measurement.standard_deviation * measurement.si / top for measurement in curve]
    )
    if sample.curve is not None and sample.curve.errors != "stated":
        error = np.full_like(error, SHARE / ERRORS)
    return Readings(
        sample,
        curve,
        np.array([measurement.value * measurement.si / top for measurement in curve]),
        error,
        np.array([sample.times[measurement.place or 0] for measurement in curve]),
    )


def _refuse_above(readings: Readings) -> None:
    """Refuses a mudline above the suspension."""
    ratio, error, first = readings.ratio, readings.error, readings.curve[0]
    for place in np.flatnonzero(ratio - 1.0 > ERRORS * error)[:1]:
        of_height = first.observable == "sedimentation_ratio"
        most = "1" if of_height else f"height = {readings.sample.height:g} m"
        unit = "its unit" if of_height else f"its unit or {readings.tube}"
        raise InputError(
            f"{readings.said(place)} is above {most}, by more than its error; mend the reading, "
            f"{unit}"
        )


def _refuse_below_particles(readings: Readings) -> None:
    """Refuses a mudline below the height of the particles without any liquid between them."""
    ratio, solids = readings.ratio, readings.sample.recipe.volume_fraction
    if readings.sample.rotor is not None:
        solids = float(readings.sample.rotor.final_ratio(solids))
    for place in np.flatnonzero(solids - ratio > ERRORS * readings.error)[:1]:
        raise InputError(
            f"{readings.said(place)} is {ratio[place]:.3g} of the height, less than the particles "
            f"alone would fill, {solids:.3g}; mend unit, {readings.tube} or composition, or give "
            "the mudline in place of the clear layer"
        )


def sinks(recipe: Recipe) -> bool:
    """True if a coated particle is heavier than the fluid that it displaces."""
    return recipe.apparent_density > recipe.fluid.density


def _start(readings: Readings) -> list[str]:
    """Warns of a first reading, near time 0, below the height; refuses one that is far below."""
    ratio, error, times = readings.ratio, readings.error, readings.times
    low = 1.0 - ratio[0]
    if low <= ERRORS * error[0] or low <= _fallen_at_most(readings.sample, float(times[0])):
        return []
    text = (
        f"{readings.said(0)} is {ratio[0]:.4g} of the height, where nothing has settled yet; mend "
        f"{readings.tube} or unit, or give the mudline in place of the clear layer"
    )
    if low > SHARE:
        raise InputError(text)
    return [text]


def _late_start(readings: Readings) -> Iterator[str]:
    """Warns of elapsed times that look like times of day: nothing falls before the first one."""
    file, times, ratio = readings.sample.curve, readings.times, readings.ratio
    if file is None or not file.time_form.startswith("hh:mm"):
        return
    later = int(np.argmax(times > times[0]))
    before = (ratio[0] - ratio[later]) / (times[later] - times[0]) * times[0]
    if 1.0 - ratio[0] <= SHARE and before > WAITED * SHARE:
        yield (
            f"{readings.said(0)} is at the height still, and falls from then on; if these are "
            'times of the day, state start, as start = "09:30"'
        )


def _fallen_at_most(sample: Sample, time: float) -> float:
    """Share of the height that a mudline may have fallen by a time."""
    if time <= 0.0:
        return 0.0
    alone = sample.recipe.parameters().replace(f_w=1.0, f_s=1.0, f_v=1.0)
    if sample.rotor is not None:
        alone = alone.replace(gravity=sample.rotor.floor_acceleration)
    speed = float(np.max(np.abs(np.asarray(terminal_velocity(alone)))))
    return FASTER_AT_FIRST * speed * time / sample.height


def _refuse_rise(readings: Readings) -> None:
    """Refuses a mudline that rises by more than its errors, at its largest rise.

    Readings of one time count as their mean: two tubes may differ by more than the error of one.
    """
    times, first, group, count = np.unique(
        readings.times, return_index=True, return_inverse=True, return_counts=True
    )
    ratio = np.bincount(group, readings.ratio) / count
    error = np.bincount(group, readings.error) / count
    lowest = np.minimum.accumulate(ratio)
    before = np.maximum.accumulate(np.where(ratio == lowest, np.arange(times.size), 0))
    rise = ratio - lowest
    stated = readings.sample.curve is None or readings.sample.curve.errors == "stated"
    beyond = rise / (ERRORS * (error + error[before]) if stated else SHARE)
    place = int(np.argmax(beyond))
    if beyond[place] > 1.0:
        raise InputError(
            f"{readings.said(first[place])} is above {readings.value(first[before[place]])}, by "
            "more than their errors: a mudline only falls; mend the reading, or give a larger "
            "standard_deviation"
        )


def oddities(samples: Sequence[Sample], suspensions: Iterable[Suspension]) -> Iterator[str]:
    """Warnings about an experiment as a whole: speeds out of proportion, repeated readings.

    Args:
      samples: all samples of the experiment.
      suspensions: suspension of each sample, with the medians of the priors.
    """
    for sample, suspension in zip(samples, suspensions, strict=True):
        yield from _absurd_speed(sample, suspension)
        yield from _denser_than_bed(sample, suspension)
        yield from _narrow(sample, suspension)
    for number, sample in enumerate(samples):
        for other in samples[:number]:
            if _readings(sample) == _readings(other):
                yield (
                    f"samples {other.name!r} and {sample.name!r}: have the same readings, which "
                    "count as independent; keep one if they were read once"
                )


def _readings(sample: Sample) -> tuple:
    measurements = [measurement._replace(row=None) for measurement in sample.measurements]
    return measurements, sample.times, sample.recipe if not sample.times else None


def _absurd_speed(sample: Sample, suspension: Suspension) -> Iterator[str]:
    """Warnings about speeds far from that of the recipe with the medians; one for each table."""
    expected = _expected(suspension)
    if expected == 0.0:
        stress = np.asarray(suspension.parameters.yield_stress)
        threshold = np.max(yield_stress.critical_yield_stress(suspension.parameters))
        yield (
            f"sample {sample.name!r}: with the medians, a yield stress of "
            f"{float(stress):.3g} Pa holds all particles, which move "
            f"below {float(threshold):.3g} Pa: a fit has no slope there; give yield_stress a "
            "smaller median, or start"
        )
        return
    for measurement in sample.measurements:
        if measurement.observable == "initial_velocity":
            expected_here, where = expected, ""
            if measurement.concentration is not None:
                expected_here = _expected(suspension.at(measurement.concentration.volume_fraction))
                where = f" at {measurement.concentration.said}"
            ratio = measurement.value * measurement.si / expected_here
            if not 1.0 / ABSURD < ratio < ABSURD:
                yield (
                    f"sample {sample.name!r}: initial_velocity = {measurement.value:g} "
                    f"{measurement.unit}{where} is {ratio:.2g} times what its recipe gives with "
                    f"the medians, {expected_here / measurement.si:.2g} {measurement.unit}: check "
                    "unit, viscosity and diameter"
                )
                break
    fastest = max((_speed(sample, measurement) for measurement in sample.measurements), default=0.0)
    if fastest > ABSURD * expected:
        yield (
            f"sample {sample.name!r}: its curve falls {fastest / expected:.2g} times faster than "
            "its recipe does with the medians: check time_unit, unit, viscosity and diameter"
        )


def _denser_than_bed(sample: Sample, suspension: Suspension) -> Iterator[str]:
    """Warnings about concentrations far above that of the bed at rest; the largest of a table."""
    coated = suspension.bed_fraction
    bed = RANDOM_CLOSE_PACKING if coated is None else float(np.asarray(coated))
    bed /= sample.recipe.radius_factor**3
    for table in sample.concentrations:
        readings = [
            measurement
            for measurement in sample.measurements
            if measurement.point and measurement.point.table == table.name
        ]
        largest = max(readings, key=lambda measurement: measurement.value)
        if largest.value * largest.si > DENSER_THAN_BED * bed:
            file = table.understood
            yield (
                f"sample {sample.name!r}: {file.file}, {file.row_word} {largest.row}: the volume "
                f"fraction {largest.value * largest.si:.3g} is far above that of the bed at rest, "
                f"{bed:.3g}: check concentration, densities and bed_fraction"
            )


def _narrow(sample: Sample, suspension: Suspension) -> Iterator[str]:
    """A warning about a tall, narrow tube that is taken as upright, and has a curve or a speed."""
    timed = any(measurement.observable not in STEADY for measurement in sample.measurements)
    if sample.rotor is not None or sample.gap is None or suspension.tilt is not None or not timed:
        return
    if warning := tilt.warning(sample.height, sample.gap):
        yield f"sample {sample.name!r}: {warning}"


def _expected(suspension: Suspension) -> float:
    """Speed of a suspension, m/s."""
    return float(np.abs(np.mean(np.asarray(terminal_velocity(suspension.parameters)))))


def _speed(sample: Sample, measurement: Measurement) -> float:
    """Mean speed of a mudline from time 0 to a reading, m/s; 0 for another measurement."""
    if measurement.observable not in CURVES or not sample.times[measurement.place or 0]:
        return 0.0
    scale = sample.height if measurement.observable == "sedimentation_ratio" else 1.0
    fallen = (
        sample.height
        - (measurement.value + ERRORS * measurement.standard_deviation) * measurement.si * scale
    )
    return fallen / sample.times[measurement.place or 0]
