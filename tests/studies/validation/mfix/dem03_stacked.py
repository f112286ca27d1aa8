"""DEM03: two spheres between floor and ceiling, compressed."""

from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from .. import impacts, reference
from ..impacts import Moments
from ..reference import Material
from ..row import Row, worst
from .columns import GRAVITY, INTEGRATED_BAR, columns, push

CASE = "MFiX DEM03"
RADIUS = 0.5e-3
LOWER = Material(modulus=1e7, poisson=0.3, density=20e3)
UPPER = replace(LOWER, density=10e3)
PRESS = 3.6 * RADIUS  # from the floor to the ceiling; of the beads' material
PRESSED = np.array([0.25, 0.75]) * PRESS
RESTITUTIONS = np.array([1.0, 0.8, 0.5])
PRESSING = 1e-3  # s


@cache
def stacks() -> Moments:
    """A stack for each restitution: the lower spheres, then the upper ones."""
    return impacts.film(
        columns(
            np.tile(PRESSED[:, None], len(RESTITUTIONS)),
            RADIUS,
            [LOWER, UPPER],
            PRESS,
            wall=LOWER,
            duration=PRESSING,
            time_step=PRESSING / 10_000,
            restitution=RESTITUTIONS,
        ),
        frames=100,
    )


@cache
def integrated(restitution: float) -> np.ndarray:
    """Heights at the times of the film, (2, T) in m."""
    masses = [reference.mass(solid, RADIUS) for solid in (LOWER, UPPER)]
    at_floor = push(reference.contact(LOWER, RADIUS, LOWER), restitution)
    between = push(reference.contact(LOWER, RADIUS, UPPER, RADIUS), restitution)
    at_ceiling = push(reference.contact(UPPER, RADIUS, LOWER), restitution)

    def motion(_, state: np.ndarray) -> list[float]:
        low, high, v_low, v_high = state
        below = at_floor(RADIUS - low, -v_low)
        middle = between(2.0 * RADIUS - (high - low), v_low - v_high)
        above = at_ceiling(RADIUS - (PRESS - high), v_high)
        return [
            v_low,
            v_high,
            (below - middle) / masses[0] - GRAVITY,
            (middle - above) / masses[1] - GRAVITY,
        ]

    path = solve_ivp(
        motion,
        (0.0, PRESSING),
        [*PRESSED, 0.0, 0.0],
        "DOP853",
        t_eval=stacks().time,
        rtol=1e-11,
        atol=1e-14,
    )
    return path.y[:2]


def energy() -> tuple[np.ndarray, np.ndarray]:
    """Of the elastic stack along time: kinetic, and with it that of springs and weight; J, (T,)."""
    taken = stacks()
    place, speed = (of[:, :: len(RESTITUTIONS), 2] for of in (taken.position, taken.velocity))
    masses = np.array([reference.mass(solid, RADIUS) for solid in (LOWER, UPPER)])
    at_wall = reference.contact(LOWER, RADIUS, LOWER).stiffness
    between = reference.contact(LOWER, RADIUS, UPPER, RADIUS).stiffness
    overlaps = np.stack(
        [RADIUS - place[:, 0], 2 * RADIUS - place[:, 1] + place[:, 0], RADIUS - PRESS + place[:, 1]]
    )
    springs = np.array([at_wall, between, at_wall]) @ (0.4 * np.maximum(overlaps, 0.0) ** 2.5)
    kinetic = 0.5 * speed**2 @ masses
    return kinetic, kinetic + springs + GRAVITY * place @ masses


def rows() -> list[Row]:
    """Heights along time, and the energy of the elastic stack."""
    taken, count = stacks(), len(RESTITUTIONS)
    found = []
    for column, restitution in enumerate(RESTITUTIONS):
        for known, of, where in zip(
            integrated(float(restitution)), (0, count), ("lower", "upper"), strict=True
        ):
            found.append(
                worst(
                    CASE,
                    f"height of the {where} sphere, e = {restitution:.1f}",
                    1e3 * taken.time,
                    known,
                    taken.position[:, of + column, 2],
                    name="{:.2f} ms",
                    unit="m",
                    bar=INTEGRATED_BAR,
                    source="integrated by DOP853; over the greatest displacement",
                    scale=float(np.ptp(known)),
                )
            )
    kinetic, total = energy()
    return [
        *found,
        worst(
            CASE,
            "energy, e = 1.0",
            1e3 * taken.time,
            np.full_like(total, total[0]),
            total,
            name="{:.2f} ms",
            unit="J",
            bar=INTEGRATED_BAR,
            source="conserved; over the greatest kinetic energy",
            scale=float(kinetic.max()),
        ),
    ]


def figure() -> Figure:
    """Heights along time."""
    figure = Figure(figsize=(7.0, 3.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    taken, count = stacks(), len(RESTITUTIONS)
    for column, (restitution, marker) in enumerate(zip(RESTITUTIONS, "os^", strict=True)):
        low, high = integrated(float(restitution))
        for axes, known, row in ((lower, low, 0), (upper, high, count)):
            axes.plot(1e3 * taken.time, known / RADIUS, color="0.6")
            axes.plot(
                1e3 * taken.time,
                taken.position[:, row + column, 2] / RADIUS,
                f"k{marker}",
                markersize=3,
                markerfacecolor="w",
                markevery=2,
                linestyle="",
                label=f"e = {restitution:.1f}",
            )
    lower.plot([], [], color="0.6", label="DOP853")
    lower.set_xlabel("time, ms")
    lower.set_ylabel("lower height / R")
    upper.set_ylabel("upper height / R")
    handles, names = lower.get_legend_handles_labels()
    figure.legend(handles, names, frameon=False, loc="outside upper center", ncols=4)
    return figure
