"""Final ratios with what Son (2018) leaves out: attraction and rolling resistance.

Beds settle in the oil, between walls that do not attract. An experimenter can only estimate both.
The attraction of bare iron, with a gap of 0.4 nm between surfaces, is 50,000 net weights. A bed
hardly changes above a Bond number of ten (`tests/studies/cohesion`), which a gap of 28 nm gives.
Two layers of guar keep surfaces 400 nm apart, and the Bond number is 0.05.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import mrjax
from mrjax.paper.case import MEASURED_RATIO
from mrjax.paper.row import Row
from mrjax.simulation.sedimentation import Sedimentation, standard_error

HAMAKER = 1e-19
"""Hamaker constant of iron in oil, J: an estimate."""
LAYERS = {"case2": 14e-9, "case3": 200e-9}
"""Thickness of the layer of one surface by case, m."""
ROLLING_FRICTION = 0.1
"""Coefficient of rolling resistance of rough grains: an estimate."""
ESTIMATES = {"attraction": 0.0, "attraction and rolling resistance": ROLLING_FRICTION}
"""Coefficient of rolling resistance by what is taken into account."""
BEYOND = "beyond the paper"
EYE = "half-concentration"
"""The height that an eye reads, of `mrjax.HEIGHTS`."""

Beds = Mapping[tuple[str, str], Sedimentation]
"""Beds of M random starts by case and estimate."""


def estimated(case: str, rolling_friction: float) -> mrjax.Recipe:
    """The lab sheet of a case with attraction, and with rolling resistance."""
    return mrjax.Recipe.load(case).replace(
        attraction={"hamaker": HAMAKER, "layer_thickness": LAYERS[case]},
        wall={"hamaker": 0.0},
        contact={"rolling_friction": rolling_friction},
    )


def settled(
    seed: int = 0,
    starts: int = 3,
    report: Callable[[str], None] = lambda text: None,
    checkpoint: Path | None = None,
    progress: bool = False,
) -> dict[tuple[str, str], Sedimentation]:
    """Lets the cases settle with each estimate.

    Args:
      seed, starts, report, checkpoint, progress: as for `mrjax.paper.simulated`.
    """
    beds = {}
    for case in LAYERS:
        for estimate, rolling_friction in ESTIMATES.items():
            report(f"settling {starts} suspension{'s' * (starts > 1)} of {case} with {estimate}")
            folder = checkpoint and checkpoint / f"{case} {estimate}".replace(" ", "-")
            beds[case, estimate] = mrjax.sedimentation(
                estimated(case, rolling_friction),
                range(seed, seed + starts),
                progress=progress,
                checkpoint=folder,
            )
    return beds


def rows(beds: Beds) -> list[Row]:
    """Returns a row for each estimate, beside the measured final ratio."""
    return [_row(case, estimate, bed) for (case, estimate), bed in beds.items()]


def _row(case: str, estimate: str, bed: Sedimentation) -> Row:
    ratios = 100.0 * bed.ratio(EYE)[:, -1]
    top = 100.0 * float(np.mean(bed.ratio()[:, -1]))
    friction = float(np.max(bed.parameters.friction))
    bond = float(np.max(mrjax.bond_number(estimated(case, 0.0).parameters())))
    rolling = f", rolling resistance {ESTIMATES[estimate]:g}" if ESTIMATES[estimate] else ""
    return Row(
        case,
        f"final sedimentation ratio with {estimate}",
        MEASURED_RATIO[case],
        float(np.mean(ratios)),
        "%",
        BEYOND,
        "beside the ratio measured by Fang et al. (2005); by half the initial concentration, as an "
        f"eye sees it (top of the highest particle {top:.1f}); estimated: Bond number {bond:.2g}, "
        f"friction {friction:g}{rolling}",
        float(standard_error(ratios)) if len(ratios) > 1 else None,
    )
