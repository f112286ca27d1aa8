"""Test 3: the restitution that comes out, against the one asked for."""

from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import impacts
from ..impacts import Spheres
from ..kharaz import RADIUS, SPEED
from ..row import Row, worst
from .common import ALUMINA, CAST_IRON

RESTITUTIONS = np.linspace(0.2, 1.0, 9)


@cache
def rebounds() -> dict[str, np.ndarray]:
    """Rebound over impact speed at normal incidence, for every restitution."""
    solids = {"aluminium oxide": ALUMINA, "cast iron": CAST_IRON}
    spheres = Spheres(
        [solid for solid in solids.values() for _ in RESTITUTIONS], RADIUS, [0.0, -SPEED]
    )
    scene = impacts.scene(spheres, restitution=np.tile(RESTITUTIONS, 2), steps=2000, durations=3.0)
    velocity, _ = impacts.after(scene)
    return dict(zip(solids, np.split(velocity[:, 1] / SPEED, 2), strict=True))


def rows() -> list[Row]:
    """Restitution out against in."""
    return [
        worst(
            "Chung & Ooi 3",
            f"restitution, {name}",
            RESTITUTIONS,
            RESTITUTIONS,
            found,
            name="e = {:.1f}",
            unit="1",
            bar=5e-3,
            source="the restitution asked for",
        )
        for name, found in rebounds().items()
    ]


def figure() -> Figure:
    """Restitution out against in."""
    figure = Figure(figsize=(3.4, 2.8), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.6", label="equal")
    styles = (dict(marker="o", ms=7, mfc="w"), dict(marker="s", ms=3))
    for (name, found), style in zip(rebounds().items(), styles, strict=True):
        axes.plot(RESTITUTIONS, found, color="k", linestyle="", label=name, **style)
    axes.set_xlabel("restitution asked for")
    axes.set_ylabel("restitution found")
    axes.set_xlim(0, 1.05)
    axes.set_ylim(0, 1.05)
    axes.legend(frameon=False)
    return figure
