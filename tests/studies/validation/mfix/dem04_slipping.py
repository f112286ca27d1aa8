"""DEM04: a sphere slips on a rough floor until it rolls."""

from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import impacts, reference
from ..impacts import Moments
from ..reference import Material
from ..row import Row, worst
from .columns import GRAVITY, INTEGRATED_BAR, columns

CASE, RADIUS = "MFiX DEM04", 0.5e-3
MARBLE = Material(modulus=1e9, poisson=0.3, density=10e3)
START = 0.1  # m/s
FRICTIONS = np.linspace(0.2, 1.0, 5)
SLIPPING = 20e-3  # s


@cache
def slips() -> Moments:
    """A sphere for each friction, at rest on the floor but for its velocity along it.

    Damped, so that the spring which holds the sphere when it rolls comes to rest.
    """
    contact = reference.contact(MARBLE, RADIUS)
    pressed = (contact.mass * GRAVITY / contact.stiffness) ** (2 / 3)
    swing = 2.0 * np.pi * np.sqrt(contact.mass * pressed / (1.5 * contact.mass * GRAVITY))
    return impacts.film(
        columns(
            [[RADIUS - pressed] * len(FRICTIONS)],
            RADIUS,
            [MARBLE],
            8.0 * RADIUS,
            velocity=(START, 0.0, 0.0),
            duration=SLIPPING,
            time_step=swing / 100,
            skin=1.0,
            friction=FRICTIONS,
            restitution=0.5,
        ),
        frames=200,
    )


def slip_speeds() -> np.ndarray:
    """Of the lowest point along time, m/s, (T, N)."""
    taken = slips()
    arm = RADIUS - 0.5 * (RADIUS - taken.position[:, :, 2])
    return taken.velocity[:, :, 0] - arm * taken.spin[:, :, 1]


def rows() -> list[Row]:
    """When rolling begins, and with what velocity and spin."""
    taken, times = slips(), []
    for speeds in slip_speeds().T:
        # The line through the last two frames in which it slips.
        last = np.flatnonzero(speeds > 0.05 * START)[-1]
        slope = (speeds[last] - speeds[last - 1]) / (taken.time[last] - taken.time[last - 1])
        times.append(taken.time[last] - speeds[last] / slope)
    common = dict(name="mu = {:.1f}", bar=INTEGRATED_BAR)
    rolling = np.full_like(FRICTIONS, 5 / 7 * START)
    return [
        worst(
            CASE,
            "time when rolling begins",
            FRICTIONS,
            2.0 * START / (7.0 * FRICTIONS * GRAVITY),
            np.array(times),
            unit="s",
            source="2 u_0 / (7 mu g)",
            **common,
        ),
        worst(
            CASE,
            "velocity when it rolls",
            FRICTIONS,
            rolling,
            taken.velocity[-1, :, 0],
            unit="m/s",
            source="5 u_0 / 7",
            **common,
        ),
        worst(
            CASE,
            "spin when it rolls",
            FRICTIONS,
            rolling / RADIUS,
            taken.spin[-1, :, 1],
            unit="rad/s",
            source="5 u_0 / (7 R)",
            **common,
        ),
    ]


def figure() -> Figure:
    """Velocities of the centre and of the surface about it."""
    figure = Figure(figsize=(3.4, 2.8), layout="constrained")
    axes = figure.subplots()
    taken, time = slips(), np.linspace(0.0, SLIPPING, 400)
    for column, (friction, marker) in enumerate(zip(FRICTIONS, "os^vD", strict=True)):
        slowed = np.minimum(friction * GRAVITY * time, 2 / 7 * START)
        axes.plot(1e3 * time, START - slowed, color="0.6")
        axes.plot(1e3 * time, 2.5 * slowed, color="0.6")
        style = dict(linestyle="", markersize=3, markevery=(2 * column, 10))
        axes.plot(
            1e3 * taken.time,
            taken.velocity[:, column, 0],
            f"k{marker}",
            label=rf"$\mu$ = {friction:.1f}",
            **style,
        )
        axes.plot(
            1e3 * taken.time, RADIUS * taken.spin[:, column, 1], f"k{marker}", mfc="w", **style
        )
    axes.plot([], [], color="0.6", label="closed form")
    axes.set_xlabel("time, ms")
    axes.set_ylabel(r"$u$ (full), $R\omega$ (open), m/s")
    axes.set_ylim(0, 1.05 * START)
    axes.set_xlim(left=0)
    axes.legend(frameon=False, fontsize="x-small", loc="lower right")
    return figure
