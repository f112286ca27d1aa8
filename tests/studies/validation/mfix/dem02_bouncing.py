"""DEM02: a sphere bounces, the one of DEM01 but stiff."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import jax
import numpy as np
from matplotlib.figure import Figure

import mrjax

from .. import impacts, reference
from ..row import Row, worst
from .columns import DOP853, GRAVITY, INTEGRATED_BAR, columns
from .dem01_falling import DROP, LANDING, LANDING_SPEED, RADIUS, SOFT, landed

CASE = "MFiX DEM02"
STIFF = replace(SOFT, modulus=1e11)
RESTITUTIONS = np.linspace(0.5, 1.0, 6)
BOUNCES = 3
SLICE = 2e-3  # s


@cache
def bounces() -> list[tuple[np.ndarray, np.ndarray]]:
    """Times and heights, (T,) in s and m, of a sphere for each restitution.

    Free flight is exact at any step: only where the sphere may touch are the steps short.
    """
    lasting = reference.hertz_duration(reference.contact(STIFF, RADIUS), LANDING_SPEED)
    scene = columns(
        [[DROP]], RADIUS, [STIFF], 8.0 * RADIUS, duration=SLICE, time_step=lasting / 2000
    )

    def onward(time_step: float) -> Callable[[mrjax.State, float], mrjax.State]:
        @jax.jit
        def advance(state: mrjax.State, restitution: float) -> mrjax.State:
            return mrjax.simulate(
                state,
                scene.parameters.replace(restitution=restitution),
                scene.box,
                duration=SLICE,
                time_step=time_step,
                rebuild_every=10_000,
            ).state

        return advance

    fly, touch = onward(SLICE), onward(scene.time_step)

    def path(restitution: float) -> tuple[np.ndarray, np.ndarray]:
        # Half-way from the last apex down to the floor.
        falls = LANDING * restitution ** np.arange(BOUNCES + 1)
        duration = falls[0] + 2.0 * np.sum(falls[1:-1]) + 1.5 * falls[-1]
        state, heights = scene.state, [DROP]
        for _ in range(int(duration / SLICE)):
            height, velocity = float(state.position[0, 2]), float(state.velocity[0, 2])
            lowest = height + min(velocity, 0.0) * SLICE - 0.5 * GRAVITY * SLICE**2
            state = (touch if lowest <= RADIUS else fly)(state, restitution)
            heights.append(float(state.position[0, 2]))
        if not np.all(np.isfinite(heights)):
            raise RuntimeError("the package does not trust this run")
        return SLICE * np.arange(len(heights)), np.array(heights)

    return [path(float(restitution)) for restitution in RESTITUTIONS]


def apexes() -> np.ndarray:
    """Top of the parabola through the three points around each maximum, m, (bounces, 6)."""
    found = []
    for _, height in bounces():
        before, at, behind = height[:-2], height[1:-1], height[2:]
        top = np.flatnonzero((at >= before) & (at > behind))[:BOUNCES]
        found.append(impacts.vertex(before[top], at[top], behind[top]))
    return np.stack(found, axis=1)


def hard_sphere() -> tuple[np.ndarray, np.ndarray]:
    """R + (h_0 - R) e^(2k) of bounce k, m, and the bar, a fraction of its height above R.

    A contact of duration T is not instantaneous: gravity changes the speed v meanwhile by g T, and
    the height by the fraction 2 g T / v, in every bounce. T is that of an elastic impact.
    """
    bounce = np.arange(1, BOUNCES + 1)[:, None]
    rise = (DROP - RADIUS) * RESTITUTIONS ** (2 * bounce)
    impact = LANDING_SPEED * RESTITUTIONS ** (bounce - 1)
    lasting = reference.hertz_duration(reference.contact(STIFF, RADIUS), impact)
    return RADIUS + rise, np.cumsum(2.0 * GRAVITY * lasting / impact, axis=0)


def soft_sphere() -> np.ndarray:
    """Rise of every bounce with contacts that last, by DOP853; m, (bounces, 6)."""
    rises = []
    for restitution in RESTITUTIONS:
        speeds = [LANDING_SPEED]
        for _ in range(BOUNCES):
            *_, velocities = landed(STIFF, float(restitution), float(speeds[-1]))
            speeds.append(velocities[-1])
        rises.append(np.array(speeds[1:]) ** 2 / (2.0 * GRAVITY))
    return np.stack(rises, axis=1)


def rows() -> list[Row]:
    """The last bounce against instantaneous contacts, and every bounce against those that last."""
    heights, bars = hard_sphere()
    rises = apexes() - RADIUS
    found = [
        Row(
            CASE,
            f"rise of bounce {BOUNCES}, e = {restitution:.1f}",
            float(heights[-1, column] - RADIUS),
            float(rises[-1, column]),
            "m",
            float(bars[-1, column]),
            "hard spheres; bar: what gravity does during contacts",
        )
        for column, restitution in enumerate(RESTITUTIONS)
    ]
    return [
        *found,
        worst(
            CASE,
            "rise of all bounces",
            np.broadcast_to(RESTITUTIONS, rises.shape).ravel(),
            soft_sphere().ravel(),
            rises.ravel(),
            name="e = {:.1f}",
            unit="m",
            bar=INTEGRATED_BAR,
            source=DOP853,
        ),
    ]


def figure() -> Figure:
    """Height of each bounce."""
    figure = Figure(figsize=(7.0, 2.8), layout="constrained")
    along, against = figure.subplots(1, 2)
    heights, _ = hard_sphere()
    counted = np.arange(1, BOUNCES + 1)
    styles = zip(bounces(), heights.T, apexes().T, RESTITUTIONS, "os^vD*", strict=True)
    for (time, height), known, found, restitution, marker in styles:
        along.plot(time, height, "k-", linewidth=0.5)
        against.plot(counted, known, color="0.6")
        against.plot(
            counted,
            found,
            f"k{marker}",
            markerfacecolor="w",
            linestyle="",
            label=f"e = {restitution:.1f}",
        )
    against.plot([], [], color="0.6", label="hard spheres")
    along.set_xlabel("time, s")
    along.set_ylabel("height of the centre, m")
    against.set_xlabel("bounce")
    against.set_ylabel("greatest height, m")
    against.set_xticks(counted)
    against.legend(frameon=False, fontsize="x-small", loc="center left", bbox_to_anchor=(1, 0.5))
    return figure
