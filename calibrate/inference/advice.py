"""Possible causes of a misfit, as suggested by the residuals.

For a curve there are three. A bed that yields goes on falling when the model is at rest. After a
delay the first readings lag behind and later ones catch up. A closure of another shape leaves
residuals that change smoothly from one reading to the next. For any measurement there is one more:
another unit, or a power of ten, brings its speed much nearer to that of the recipe.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.sample import Sample
from calibrate.experiment.units import CURVES, TIME_UNITS, VELOCITY_UNITS
from calibrate.inference.misfit import LARGEST_CHI_SQUARED
from calibrate.least_squares.draws import SPREAD
from calibrate.least_squares.fit import Fit
from calibrate.problem.initial_slope import initial_slope
from calibrate.problem.problem import Problem
from mrjax import terminal_velocity

STANDS_OUT, MOST = 3.0, 3
"""Residual from which a reading stands out, and the most readings that are named."""
SIGNIFICANT = 3.0
"""Difference, in standard deviations, above which it is no noise."""
AT_REST = 0.01
"""Share of the predicted fall that is left when the model counts as at rest."""
SHARE_OF_FALL = 1.0 / 3.0
"""Ratio of predicted to measured fall below which the predicted one is negligible."""
SLOWER = 0.7
"""Ratio of the first to the highest speed below which a curve begins slowly."""
FAR, NEARER = np.log(5.0), 0.5
"""Logarithm of measured over expected speed above which they are far apart, and the share of it
that a correction may leave."""
UNLIKELY = 2.0
"""Deviation of a speed, in standard deviations of the priors, up to which no unit is doubted."""
FEWEST = 6
"""Fewest readings of a curve whose shape is judged."""
SMOOTH = 0.7
"""Durbin-Watson statistic below which residuals are no noise, for which it is 2. For ten residuals
of noise it is below in 1 % of cases."""
POWERS = (-6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6)


def stand_out(residuals: np.ndarray) -> list[int]:
    """Indices of the largest residuals that stand out, the largest first, of residuals (M,)."""
    order = np.argsort(-np.abs(residuals), kind="stable")[:MOST]
    return [int(place) for place in order if abs(residuals[place]) >= STANDS_OUT]


def advice(problem: Problem, fit: Fit, predicted: np.ndarray) -> list[str]:
    """Sentences on possible causes of a misfit, sample by sample; empty if nothing is suggested.

    Args:
      problem: the fitted problem.
      fit: its fit.
      predicted: predictions, each in its unit, (M,).
    """
    sentences: list[str] = []
    for sample, place in problem.experiment.by_sample():
        sentences += _unit_causes(problem.experiment, sample)
        curve = _curve(sample, predicted[place])
        if curve is not None:
            sentences += [f"sample {sample.name}: {sentence}" for sentence in _shape_causes(curve)]
    return sentences


class _Curve(NamedTuple):
    """A curve in the order of its times, with the mean reading at each time."""

    times: np.ndarray
    """Times, s, (T,)."""
    measured: np.ndarray
    predicted: np.ndarray
    """Measured and predicted values, (T,) each, in the unit of the readings."""
    errors: np.ndarray
    """Standard deviations of the measured values, (T,)."""
    top: float
    """Height of the suspension in that unit."""


def _curve(sample: Sample, predicted: np.ndarray) -> _Curve | None:
    """The curve of a sample; None without one."""
    rows = [
        (sample.times[measurement.place], measurement.value, value, measurement.standard_deviation)
        for measurement, value in zip(sample.measurements, predicted, strict=True)
        if measurement.place is not None and measurement.observable in CURVES
    ]
    if len(rows) < FEWEST:
        return None
    measurement = next(
        measurement for measurement in sample.measurements if measurement.observable in CURVES
    )
    full_height = 1.0 if measurement.observable == "sedimentation_ratio" else sample.height
    times_of_rows, *columns = np.array(rows, float).T
    times, group, count = np.unique(times_of_rows, return_inverse=True, return_counts=True)
    measured, means, errors = (np.bincount(group, column) / count for column in columns)
    return _Curve(times, measured, means, errors / np.sqrt(count), full_height / measurement.si)


def _shape_causes(curve: _Curve) -> Iterator[str]:
    """Sentences on the shape of the residuals of a curve."""
    if _falls_on(curve):
        yield (
            "its last readings go on falling when the model is at rest: a bed that yields under "
            "its weight, or fines that still settle"
        )
    elif _begins_slowly(curve):
        yield "it falls slower at first than later: a delay, such as of flocs that still grow"
    elif _bends(curve):
        yield "between its ends it has another shape than the model: another closure or exponent"


def _falls_on(curve: _Curve) -> bool:
    """True if the measured curve goes on falling when the predicted one is at rest."""
    end = curve.predicted[-1]
    rests = curve.predicted <= end + AT_REST * (curve.top - end)
    late = np.flatnonzero(rests)
    if late.size < 2:
        return False
    first, last = late[0], late[-1]
    fall = curve.measured[first] - curve.measured[last]
    error = np.hypot(curve.errors[first], curve.errors[last])
    return bool(
        fall > SIGNIFICANT * error
        and curve.predicted[first] - end < SHARE_OF_FALL * fall
        and curve.measured[last] < end - curve.errors[last]
    )


def _begins_slowly(curve: _Curve) -> bool:
    """True if the first reading is above the model, and the curve falls slower there than later."""
    times, heights, errors = curve.times, curve.measured, curve.errors
    if times[0] > 0.0:
        times = np.append(0.0, times)
        heights, errors = np.append(curve.top, heights), np.append(0.0, errors)
    speeds = -np.diff(heights) / np.diff(times)
    uncertain = np.hypot(errors[1:], errors[:-1]) / np.diff(times)
    later = 1 + int(np.argmax(speeds[1:]))
    behind = np.flatnonzero(curve.times > 0.0)[0]
    above = curve.measured[behind] - curve.predicted[behind]
    return bool(
        above > SIGNIFICANT * curve.errors[behind]
        and speeds[0] < SLOWER * speeds[later]
        and speeds[later] - speeds[0] > SIGNIFICANT * np.hypot(uncertain[0], uncertain[later])
    )


def _bends(curve: _Curve) -> bool:
    """True if residuals are large and change smoothly from one to the next, unlike noise."""
    residuals = (curve.predicted - curve.measured) / curve.errors
    large = np.mean(residuals**2) > LARGEST_CHI_SQUARED
    return bool(large and np.sum(np.diff(residuals) ** 2) < SMOOTH * np.sum(residuals**2))


def _unit_causes(experiment: Experiment, sample: Sample) -> Iterator[str]:
    """Sentences on units and factors that bring the speed of a sample much nearer to the priors."""
    expected, spread = _believed_speed(experiment, sample)
    if expected == 0.0:  # a yield stress holds the particles
        return
    slope = initial_slope(sample)
    if slope is not None and sample.curve is not None:
        stated_unit = sample.curve.time_unit
        units = {name: second / TIME_UNITS[stated_unit] for name, second in TIME_UNITS.items()}
        yield from _unit_sentences(
            sample.name, slope / expected, spread, "times", stated_unit, units
        )
    for measurement in sample.measurements:
        if measurement.observable == "initial_velocity" and measurement.concentration is None:
            stated_unit = measurement.unit
            units = {
                name: measurement.si / si
                for name, si in VELOCITY_UNITS.items()
                if _shares_a_unit(name, stated_unit)
            }
            ratio = measurement.value * measurement.si / expected
            yield from _unit_sentences(
                sample.name, ratio, spread, "its velocity", stated_unit, units
            )


def _believed_speed(experiment: Experiment, sample: Sample) -> tuple[float, float]:
    """Speed with the medians of the priors, m/s, and the standard deviation of its logarithm."""

    def speed(theta: Mapping[str, float]) -> float:
        parameters = experiment.suspension_of(sample, theta).parameters
        return float(np.abs(np.mean(np.asarray(terminal_velocity(parameters)))))

    medians = experiment.medians
    expected, variance = speed(medians), 0.0
    for parameter in experiment.parameters:
        spread = (
            SPREAD if parameter.log_standard_deviation is None else parameter.log_standard_deviation
        )
        speed_with_change = speed(
            {**medians, parameter.variable: medians[parameter.variable] * float(np.exp(spread))}
        )
        if expected > 0.0 and speed_with_change > 0.0:
            variance += float(np.log(speed_with_change / expected)) ** 2
    return expected, variance**0.5


def _shares_a_unit(unit: str, other: str) -> bool:
    """True for units of velocity with the same length or the same time."""
    return any(
        first == second for first, second in zip(unit.split("/"), other.split("/"), strict=True)
    )


def _unit_sentences(
    name: str, ratio: float, spread: float, quantity: str, stated_unit: str, units: dict[str, float]
) -> Iterator[str]:
    """Sentences on a speed far from that of the recipe, if a unit or power of ten explains it.

    Args:
      name: name of the sample.
      ratio: speed of the readings over that of the recipe with the medians.
      spread: standard deviation of its logarithm, from the priors.
      quantity: the times or velocity whose unit may be wrong, in words.
      stated_unit: unit of that quantity in the file.
      units: factor on the speed by which it is too large if the quantity is in another unit, by
        name of that unit.
    """
    if not 0.0 < ratio < np.inf or abs(np.log(ratio)) < max(FAR, UNLIKELY * spread):
        return
    tolerance = NEARER * abs(np.log(ratio))
    ideas = []
    unit, factor = min(units.items(), key=lambda item: abs(np.log(ratio / item[1])))
    if abs(np.log(ratio / factor)) < tolerance and unit != stated_unit:
        ideas.append(
            f"{quantity} in {unit}, not {stated_unit}, would make that {ratio / factor:.2g}"
        )
    power = min(POWERS, key=lambda exponent: abs(np.log(ratio) - exponent * np.log(10.0)))
    if abs(np.log(ratio) - power * np.log(10.0)) < tolerance:
        ideas.append(
            f"a height, viscosity or other quantity wrong by a factor of {10.0 ** abs(power):g}, "
            f"{ratio / 10.0**power:.2g}"
        )
    if ideas:
        yield (
            f"sample {name}: it falls {ratio:.2g} times as fast as its recipe with the medians; "
            f"{'; '.join(ideas)}"
        )
