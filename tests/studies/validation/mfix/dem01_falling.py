"""DEM01: a sphere falls onto the floor."""

from functools import cache

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from .. import impacts, reference
from ..impacts import Moments
from ..reference import Material
from ..row import Row
from .columns import DOP853, GRAVITY, INTEGRATED_BAR, columns, push

CASE = "MFiX DEM01"
RADIUS, DROP = 0.1, 0.5
SOFT = Material(modulus=1e7, poisson=0.3, density=2600.0)
LANDING = np.sqrt(2.0 * (DROP - RADIUS) / GRAVITY)
"""When free fall ends, s."""
LANDING_SPEED = GRAVITY * LANDING
RESTITUTIONS = np.array([0.6, 0.8, 1.0])


@cache
def falls() -> Moments:
    """A sphere for each restitution, from rest until it flies up again."""
    lasting = reference.hertz_duration(reference.contact(SOFT, RADIUS), LANDING_SPEED)
    return impacts.film(
        columns(
            [[DROP] * len(RESTITUTIONS)],
            RADIUS,
            [SOFT],
            8.0 * RADIUS,
            duration=1.5 * LANDING,
            time_step=lasting / 2000,
            restitution=RESTITUTIONS,
        ),
        frames=150,
    )


@cache
def landed(
    material: Material, restitution: float, speed: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A contact with the floor, until the centre is at its radius again.

    Args:
      material: of the sphere.
      restitution: of the contact.
      speed: of the impact, m/s.

    Returns:
      Times since the first touch, s, heights, m, and velocities, m/s.
    """
    contact = reference.contact(material, RADIUS)
    force = push(contact, restitution)

    def motion(_, state: np.ndarray) -> list[float]:
        height, velocity = state
        return [velocity, force(RADIUS - height, -velocity) / contact.mass - GRAVITY]

    def risen(_, state: np.ndarray) -> float:
        return state[0] - RADIUS

    risen.terminal, risen.direction = True, 1.0
    lasting = reference.hertz_duration(contact, speed)
    path = solve_ivp(
        motion,
        (0.0, 3.0 * lasting),
        [RADIUS, -speed],
        "DOP853",
        events=risen,
        rtol=1e-11,
        atol=1e-13,
        max_step=lasting / 100,
    )
    return path.t, *path.y


def rows() -> list[Row]:
    """Free fall, and the rebound with its speed and time."""
    taken = falls()
    last = np.flatnonzero(taken.time < LANDING)[-1]
    found = [
        Row(
            CASE,
            f"height after {taken.time[last]:.3f} s of free fall",
            float(DROP - 0.5 * GRAVITY * taken.time[last] ** 2),
            float(taken.position[last, 0, 2]),
            "m",
            1e-9,
            "h_0 - g t^2 / 2",
        )
    ]
    up = taken.velocity[-1, :, 2]
    # Back along the parabola, to where the centre is at its radius.
    speed = np.sqrt(up**2 + 2.0 * GRAVITY * (taken.position[-1, :, 2] - RADIUS))
    leaving = taken.time[-1] - (speed - up) / GRAVITY
    for column, restitution in enumerate(RESTITUTIONS):
        times, _, velocities = landed(SOFT, float(restitution), LANDING_SPEED)
        elastic = restitution == 1.0
        found += [
            Row(
                CASE,
                f"speed of rebound, e = {restitution:.1f}",
                float(LANDING_SPEED if elastic else velocities[-1]),
                float(speed[column]),
                "m/s",
                INTEGRATED_BAR,
                "energy is conserved" if elastic else DOP853,
            ),
            Row(
                CASE,
                f"duration of the contact, e = {restitution:.1f}",
                float(times[-1]),
                float(leaving[column] - LANDING),
                "s",
                INTEGRATED_BAR,
                DOP853,
            ),
        ]
    return found


def figure() -> Figure:
    """Height along time, and the contact enlarged."""
    figure = Figure(figsize=(7.0, 2.8), layout="constrained")
    whole, contact = figure.subplots(1, 2)
    taken = falls()
    time = np.linspace(0.0, LANDING, 100)
    for axes in (whole, contact):
        axes.plot(time, DROP - 0.5 * GRAVITY * time**2, color="0.6", label="closed form, DOP853")
        for restitution in RESTITUTIONS:
            times, heights, velocities = landed(SOFT, float(restitution), LANDING_SPEED)
            times = LANDING + times
            flight = np.linspace(0.0, taken.time[-1] - times[-1], 50)
            rising = heights[-1] + velocities[-1] * flight - 0.5 * GRAVITY * flight**2
            axes.plot(times, heights, color="0.6")
            axes.plot(times[-1] + flight, rising, color="0.6")
        for column, (restitution, marker) in enumerate(zip(RESTITUTIONS, "os^", strict=True)):
            axes.plot(
                taken.time,
                taken.position[:, column, 2],
                f"k{marker}",
                markersize=3,
                markerfacecolor="w",
                markevery=3 if axes is whole else 1,
                linestyle="",
                label=f"e = {restitution:.1f}",
            )
        axes.axhline(RADIUS, color="k", linewidth=0.5, linestyle=":", label="radius")
        axes.set_xlabel("time, s")
    whole.set_ylabel("height of the centre, m")
    whole.legend(frameon=False, fontsize="small")
    contact.set_xlim(LANDING - 0.005, LANDING + 0.035)
    contact.set_ylim(0.085, 0.125)
    return figure
