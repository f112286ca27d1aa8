"""Sharp fronts that pass a table of concentrations between two readings.

While a front is in none of the layers of the readings, no prediction changes with its place: slopes
at the fit, and errors that follow from them, say nothing of that.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from calibrate.experiment.sample import Point, Sample
from calibrate.report.formatting import place_of_point, when

SHARP = 0.5
"""Predicted difference of neighbours, over the concentration of the suspension, that is a front."""


def unresolved_fronts(sample: Sample, predicted: Sequence[float]) -> Iterator[str]:
    """Warnings about fronts that no reading resolves; the first of each table.

    Args:
      sample: of M measurements.
      predicted: each in its unit, (M,).
    """
    size = SHARP * sample.recipe.volume_fraction
    pairs = zip(sample.measurements, predicted, strict=True)
    readings = [
        (measurement, measurement.point, value * measurement.si)
        for measurement, value in pairs
        if measurement.point
    ]
    tables: set[str] = set()
    for (_, before, low), (_, after, high) in pairwise(readings):
        if before.table != after.table or before.table in tables or abs(high - low) < size:
            continue
        if _distance(sample, before, after) > max(before.thickness, after.thickness):
            tables.add(before.table)
            yield (
                f"sample {sample.name}, {before.table}: a sharp front passes between the readings"
                f"{_when(before)} and{_when(after)}, and wherever it is between them "
                "most predictions are the same: errors of predictions, and intervals, do not allow "
                "for that and may be far too small; give more readings there, or the thickness of "
                "the beam"
            )


def _distance(sample: Sample, before: Point, after: Point) -> float:
    """How far a front goes between two readings, m: of a mudline or a bed, the farther."""
    distance = abs(after.height - before.height)
    if after.time > before.time:
        farthest = max(sample.height - after.height, after.height)
        distance = max(distance, farthest * (1.0 - before.time / after.time))
    return distance


def _when(point: Point) -> str:
    return when({"observable": "volume_fraction"} | place_of_point(point))
