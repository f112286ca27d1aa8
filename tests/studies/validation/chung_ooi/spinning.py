"""Tests 6 to 8: a sphere that spins, on a wall, on its like and on a large sphere."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import impacts, reference
from ..impacts import Spheres
from ..reference import Material
from ..row import Row, worst
from .common import ALLOY, INTEGRATED, NYLON, SLIDING, SLIDING_BAR, STICKING_BAR

RADIUS, SPEED, FRICTION, RESTITUTION = 0.1, 0.2, 0.4, 0.5
SPINS = SPEED / RADIUS * np.tan(np.radians(np.arange(5.0, 85.1, 5.0)))
"""0.175 to 22.9 rad/s: R spin over v_n is the tangent of 5 to 85 degrees."""
ROLLING = 3.5 * FRICTION * (1.0 + RESTITUTION) * SPEED / RADIUS
"""Below this spin, the impact has impulse enough to stop the sliding, rad/s."""
SLIDES = SPINS > ROLLING


@dataclass(frozen=True)
class Spinning:
    """What becomes of `SPINS`: tangential velocities, m/s, and spins, rad/s, each (N,)."""

    velocity: np.ndarray
    spin: np.ndarray
    sliding_velocity: np.ndarray
    """Where the surfaces slide throughout; the spin loses 5/2 of it over R."""
    integrated_velocity: np.ndarray | None = None
    integrated_spin: np.ndarray | None = None


@cache
def on_wall() -> dict[str, Spinning]:
    """Test 6: a sphere of 0.1 m radius on a rigid wall at 0.2 m/s."""
    return _spinning(lambda materials: None)


@cache
def on_sphere() -> dict[str, Spinning]:
    """Test 8: the same on a sphere five times its size, of a thousand times its density.

    The partner is at rest, and 125,000 times heavier: the integration takes it for fixed.
    """
    return _spinning(
        lambda materials: Spheres(
            [replace(solid, density=1000.0 * solid.density) for solid in materials],
            5.0 * RADIUS,
            [0.0, 0.0],
        )
    )


def _spinning(partner: Callable[[list[Material]], Spheres | None]) -> dict[str, Spinning]:
    solids = {"aluminium alloy": ALLOY, "nylon": NYLON}
    materials = [solid for solid in solids.values() for _ in SPINS]
    spins = np.tile(SPINS, len(solids))
    upper, lower = Spheres(materials, RADIUS, [0.0, -SPEED], spins), partner(materials)
    _, *integrated = reference.rebound(
        upper.contacts_with(lower),
        upper.radii,
        normal=np.full_like(spins, SPEED),
        tangential=np.zeros_like(spins),
        spin=spins,
        friction=FRICTION,
        restitution=RESTITUTION,
    )
    return _divided(solids, *_after(upper, lower), *integrated)


@cache
def equal_spheres() -> dict[str, Spinning]:
    """Test 7: the upper of two equal spheres at 0.2 m/s each, for either sense of the lower.

    At the point of contact the upper surface moves with -R w, the lower one with +R w.
    """
    upper = Spheres([ALLOY] * 2 * len(SPINS), RADIUS, [0.0, -SPEED], np.tile(SPINS, 2))
    lower = replace(upper, velocity=[0.0, SPEED], spin=np.concatenate([-SPINS, SPINS]))
    return _divided(("opposite", "equal"), *_after(upper, lower))


def _after(upper: Spheres, lower: Spheres | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the upper spheres: tangential velocities, spins and velocities of sliding."""
    scene = impacts.scene(upper, lower, friction=FRICTION, restitution=RESTITUTION, steps=2000)
    velocity, spin = (values[: len(upper.material)] for values in impacts.after(scene))
    sliding = reference.sliding_loss(
        upper.contacts_with(lower),
        np.array([reference.mass(solid, RADIUS) for solid in upper.material]),
        FRICTION,
        RESTITUTION,
        (0.0 if lower is None else lower.velocity[1]) - upper.velocity[1],
    )
    return velocity[:, 0], spin, sliding


def _divided(names: Iterable[str], *values: np.ndarray) -> dict[str, Spinning]:
    """Values of `SPINS` for each of the names in turn."""
    parts = np.split(np.stack(values), values[0].size // SPINS.size, axis=1)
    return {name: Spinning(*part) for name, part in zip(names, parts, strict=True)}


def rows() -> list[Row]:
    """Tangential velocity and spin: closed forms where the surfaces slide, integrated elsewhere."""
    return [
        *_rows("Chung & Ooi 6", on_wall()),
        *_opposite_rows("Chung & Ooi 7"),
        *_sliding_rows("Chung & Ooi 7", "equal spins", equal_spheres()["equal"]),
        *_rows("Chung & Ooi 8", on_sphere()),
    ]


def _rows(case: str, spinning: dict[str, Spinning]) -> list[Row]:
    found = []
    for name, of in spinning.items():
        found += _sliding_rows(case, name, of)
        for quantity, known, ours, unit in (
            ("tangential velocity gained", of.integrated_velocity, of.velocity, "m/s"),
            ("spin after", of.integrated_spin, of.spin, "rad/s"),
        ):
            found.append(
                worst(
                    case,
                    f"{quantity}, {name}, sticking",
                    SPINS[~SLIDES],
                    known[~SLIDES],
                    ours[~SLIDES],
                    name="{:.2f} rad/s",
                    unit=unit,
                    bar=STICKING_BAR,
                    source=INTEGRATED,
                )
            )
    return found


def _sliding_rows(case: str, name: str, of: Spinning) -> list[Row]:
    return [
        worst(
            case,
            f"{quantity}, {name}, sliding",
            SPINS[SLIDES],
            known[SLIDES],
            found[SLIDES],
            name="{:.1f} rad/s",
            unit=unit,
            bar=SLIDING_BAR,
            source=SLIDING,
        )
        for quantity, known, found, unit in (
            ("tangential velocity gained", of.sliding_velocity, of.velocity, "m/s"),
            ("change of spin", -2.5 * of.sliding_velocity / RADIUS, of.spin - SPINS, "rad/s"),
        )
    ]


def _opposite_rows(case: str) -> list[Row]:
    """Opposite spins roll on each other."""
    of = equal_spheres()["opposite"]
    return [
        worst(
            case,
            f"{quantity}, opposite spins",
            SPINS,
            0.0,
            found,
            name="{:.2f} rad/s",
            unit=unit,
            bar=1e-9,
            source="the surfaces do not slide: no change",
            scale=scale,
        )
        for quantity, found, unit, scale in (
            ("tangential velocity gained", of.velocity, "m/s", SPEED),
            ("change of spin", of.spin - SPINS, "rad/s", SPEED / RADIUS),
        )
    ]


def figure() -> Figure:
    """Tangential velocity and spin after, against the spin before."""
    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    velocity, spin = figure.subplots(1, 2)
    smooth = np.geomspace(SPINS[0], SPINS[-1], 200)
    # No more than what stops the sliding.
    gained = np.minimum(1.0, smooth / ROLLING) * on_wall()["nylon"].sliding_velocity[0]
    velocity.plot(smooth, gained, color="0.75", linewidth=4, label="rigid, closed form")
    spin.plot(smooth, smooth - 2.5 * gained / RADIUS, color="0.75", linewidth=4)
    for where, spinning, size, face in (
        ("on a wall", on_wall(), 6, "w"),
        ("on a sphere", on_sphere(), 3, "k"),
    ):
        for (name, of), marker in zip(spinning.items(), "os", strict=True):
            style = dict(linestyle="", marker=marker, markersize=size, mfc=face, color="k")
            velocity.plot(SPINS, of.velocity, **style, label=f"{name} {where}")
            spin.plot(SPINS, of.spin, **style)
            velocity.plot(SPINS, of.integrated_velocity, "k-", linewidth=0.5)
            spin.plot(SPINS, of.integrated_spin, "k-", linewidth=0.5)
    for axes in (velocity, spin):
        axes.set_xscale("log")
        axes.set_xlabel("spin before, rad/s")
    spin.set_yscale("log")
    velocity.set_ylabel("tangential velocity after, m/s")
    spin.set_ylabel("spin after, rad/s")
    velocity.plot([], [], "k-", linewidth=0.5, label="law, integrated")
    entries = velocity.get_legend_handles_labels()
    figure.legend(*entries, frameon=False, loc="outside upper center", ncols=3)
    return figure
