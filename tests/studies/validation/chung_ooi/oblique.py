"""Test 4: oblique impacts at one speed, with measurements."""

from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import kharaz
from ..kharaz import IMPULSE, RESTITUTION, UNITS, Oblique, slid, slides
from ..row import Row, worst
from .common import ALLOY, ALUMINA, SLIDING, SLIDING_BAR

CASE = "Chung & Ooi 4"
ANGLES = np.arange(5.0, 80.1, 2.5)
SOLIDS = {"aluminium oxide": ALUMINA, "aluminium alloy": ALLOY}


def measured() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Angles and values, of aluminium oxide."""
    return kharaz.measured("chung_ooi_2011.toml")


@cache
def simulated() -> dict[str, Oblique]:
    """Each solid over the whole range, and each measured quantity where it was measured."""
    impacts = {name: (solid, ANGLES) for name, solid in SOLIDS.items()}
    impacts |= {quantity: (ALUMINA, angle) for quantity, (angle, _) in measured().items()}
    solids = [solid for solid, angle in impacts.values() for _ in angle]
    angles = [angle for _, angle in impacts.values()]
    found = kharaz.simulated(solids, np.concatenate(angles), restitution=RESTITUTION)
    cuts = np.cumsum([len(angle) for angle in angles])[:-1]
    parts = zip(*(np.split(values, cuts) for values in vars(found).values()), strict=True)
    return {name: Oblique(*part) for name, part in zip(impacts, parts, strict=True)}


def rows() -> list[Row]:
    """Where the surfaces slide, against theory; and against what was measured."""
    return [*_sliding_rows(), *_measured_rows()]


def _sliding_rows() -> list[Row]:
    at = slides(ANGLES, RESTITUTION)
    return [
        worst(
            CASE,
            f"{kharaz.words(quantity)}, {name}, sliding",
            ANGLES[at],
            getattr(slid(ANGLES, RESTITUTION), quantity)[at],
            getattr(simulated()[name], quantity)[at],
            name="{:.1f} deg",
            unit=UNITS[quantity],
            bar=SLIDING_BAR,
            source=SLIDING,
        )
        for name in SOLIDS
        for quantity in IMPULSE
    ]


def _measured_rows() -> list[Row]:
    """Errors in parts of the impulse; the bar is two standard deviations of the measurements.

    Where the surfaces stick during the impact, near 20 degrees, the computed impulse is 6 to 8 %
    less than the measured one: a spring has no microslip. Other codes with this law find the same
    (see DEM05).
    """
    return [
        Row(
            CASE,
            f"{kharaz.words(quantity)} at {angle:.1f} deg, measured",
            float(value),
            float(found),
            UNITS[quantity],
            2.0 * kharaz.scatter(),
            "Kharaz et al. (2001)",
            scale=float(IMPULSE[quantity](value)),
        )
        for quantity, known in measured().items()
        for angle, value, found in zip(
            *known, getattr(simulated()[quantity], quantity), strict=True
        )
    ]


def figure() -> Figure:
    """Tangential restitution, spin and rebound angle of the contact point against impact angle."""
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    panels = kharaz.panels(figure, "tangential_restitution", "spin", "contact_angle", widest=85)
    steep = np.linspace(30.0, 80.0, 100)
    for quantity, axes in panels.items():
        sliding = getattr(slid(steep, RESTITUTION), quantity)
        axes.plot(steep, sliding, color="0.7", linewidth=4, label="sliding, closed form")
        for name, line in zip(SOLIDS, ("k-", "k--"), strict=True):
            axes.plot(ANGLES, getattr(simulated()[name], quantity), line, linewidth=1, label=name)
        if quantity in measured():
            axes.plot(*measured()[quantity], "ko", ms=5, mfc="w", label="measured")
    entries = panels["spin"].get_legend_handles_labels()
    figure.legend(*entries, frameon=False, loc="outside upper center", ncols=4)
    return figure
