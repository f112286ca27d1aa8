"""Sharp fronts that pass between two readings of a table of concentrations.

While a front is in none of the layers of the readings, no prediction depends on its position. The
slopes at the fit, and the errors that follow from them, do not see such a front.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from calibrate.experiment.sample import Point, Sample
from calibrate.report.formatting import place_of_point, when

SHARP = 0.5
"""Predicted difference of neighbouring readings, over the concentration of the suspension, above
which there is a front between them."""


def unresolved_fronts(sample: Sample, predicted: Sequence[float]) -> Iterator[str]:
    """Warnings about fronts that no reading resolves, at most one for each table.

    Args:
      sample: sample with M measurements.
      predicted: predictions, each in its unit, (M,).
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
    """Largest distance that a mudline or the front of a bed moves between two readings, m."""
    distance = abs(after.height - before.height)
    if after.time > before.time:
        farthest = max(sample.height - after.height, after.height)
        distance = max(distance, farthest * (1.0 - before.time / after.time))
    return distance


def _when(point: Point) -> str:
    return when({"observable": "volume_fraction"} | place_of_point(point))
