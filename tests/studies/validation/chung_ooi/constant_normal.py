"""Test 5: oblique impacts at one normal velocity.

psi is the tangential velocity of the contact point before the impact, over mu v_n; psi' after it.
"""

from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import impacts, reference
from ..impacts import Spheres
from ..row import Row, worst
from .common import INTEGRATED, POLYETHYLENE, SLIDING, SLIDING_BAR, STEEL, STICKING_BAR

CASE = "Chung & Ooi 5"
RADIUS, NORMAL_SPEED, FRICTION = 10e-6, 5.0, 0.3
INCIDENT = np.concatenate([np.arange(0.25, 7.1, 0.25), np.arange(7.5, 10.6, 0.5)])
"""psi."""
LOST = 7.0
"""7/2 (1 + e): what sliding takes from psi; above it, the contact point never turns back."""


@cache
def rebounds() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """psi' of each solid, simulated and integrated: at `INCIDENT`, then at the published points."""
    solids = {"steel": STEEL, "polyethylene": POLYETHYLENE}
    incident = np.concatenate([INCIDENT, published()["incident"]])
    materials = [solid for solid in solids.values() for _ in incident]
    along = FRICTION * NORMAL_SPEED * np.tile(incident, len(solids))
    normal = np.full_like(along, NORMAL_SPEED)
    spheres = Spheres(materials, RADIUS, np.stack([along, -normal], axis=1))
    velocity, spin = impacts.after(impacts.scene(spheres, friction=FRICTION))
    _, along, turning = reference.rebound(
        spheres.contacts_with(None),
        spheres.radii,
        normal=normal,
        tangential=along,
        spin=np.zeros_like(along),
        friction=FRICTION,
        restitution=1.0,
    )
    surface = np.stack([velocity[:, 0] - RADIUS * spin, along - RADIUS * turning])
    both = surface / (FRICTION * NORMAL_SPEED)
    return dict(zip(solids, np.split(both, len(solids), axis=1), strict=True))


@cache
def published() -> dict[str, np.ndarray]:
    """Points of the authors' figure: psi and psi' of their simulation and of finite elements."""
    test = reference.load("chung_ooi_2011.toml")["test_5"]
    return {key: np.array(of) for key, of in test.items()}


def rows() -> list[Row]:
    """The sliding branch, the published points, and the whole range against an integration."""
    common = dict(name="psi = {:.2f}", unit="mu v_n")
    points, count, slide = published(), len(INCIDENT), INCIDENT > LOST
    (low, high), (low_after, high_after) = points["incident"], points["rebound"]
    found = []
    for name, (simulated, integrated) in rebounds().items():
        found += [
            worst(
                CASE,
                f"velocity lost at the contact point, {name}, sliding",
                INCIDENT[slide],
                np.full(slide.sum(), LOST),
                (INCIDENT - simulated[:count])[slide],
                bar=SLIDING_BAR,
                source=SLIDING,
                **common,
            ),
            Row(
                CASE,
                f"velocity lost at the contact point, {name}, published point: psi = {high:.2f}",
                float(high - high_after),
                float(high - simulated[-1]),
                "mu v_n",
                SLIDING_BAR,
                "the authors' simulation of steel",
            ),
            worst(
                CASE,
                f"velocity of the contact point after, {name}",
                INCIDENT,
                integrated[:count],
                simulated[:count],
                bar=STICKING_BAR,
                source=f"{INTEGRATED}; over mu v_n",
                scale=1.0,
                **common,
            ),
        ]
    # On the sliding branch, where Mindlin's stiffness keeps no contact sliding: it sticks at the
    # end below 7 - (2 - nu) / (2 (1 - nu)), 5.8 for steel (Maw, Barber & Fawcett 1976). The finite
    # elements in the same figure agree with that.
    stuck = Row(
        CASE,
        f"velocity of the contact point after, steel, published point: psi = {low:.2f}",
        float(low_after),
        float(rebounds()["steel"][0][count]),
        "mu v_n",
        None,
        "the authors, sliding; the law and finite elements stick",
    )
    return [*found, stuck]


def figure() -> Figure:
    """Velocity of the contact point after against before."""
    figure = Figure(figsize=(3.8, 3.2), layout="constrained")
    axes = figure.subplots()
    sliding = np.array([5.0, 10.5])
    axes.plot(sliding, sliding - LOST, color="0.75", linewidth=4, label="sliding, closed form")
    for (name, (simulated, _)), line in zip(rebounds().items(), ("k-", "k--"), strict=True):
        after = simulated[: len(INCIDENT)]
        axes.plot(INCIDENT, after, line, linewidth=1, label=f"{name}, computed")
    points = published()
    for prefix, marker, label in (("", "s", "steel"), ("finite_elements_", "+", "finite elements")):
        axes.plot(
            points[f"{prefix}incident"],
            points[f"{prefix}rebound"],
            f"k{marker}",
            markersize=5,
            markerfacecolor="w",
            label=f"published, {label}",
        )
    axes.set_xlim(0, 10.5)
    axes.set_xlabel(r"$\psi$: contact point before, $\mu v_n$")
    axes.set_ylabel(r"$\psi'$: after, $\mu v_n$")
    axes.legend(frameon=False, fontsize="x-small")
    return figure
