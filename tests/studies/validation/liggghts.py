"""Collisions of LIGGGHTS 3.8, an independent code whose law differs from ours where it is damped.

Where there is no damping the codes must agree. Where there is, LIGGGHTS must agree with its own law
and the package with its own, integrated in `two_laws`.
"""

import json
import math
from dataclasses import replace
from functools import cache

import jax
import numpy as np
from matplotlib.figure import Figure

import mrjax

from .reference import DATA
from .row import Row
from .two_laws import DIFFERENCES, Motion, integrated

NOTE = """\
Without damping the two codes must agree. With damping their laws differ (see below), and each code
is compared with an integration of its own law. "Largest difference of force" is the largest during
the collision, and its error is relative to the largest force.
"""

DIFFERENCES_NOTE = f"""\
The rows above show that each code computes its own law correctly. The rows below compare damped
impacts in mrjax and in LIGGGHTS. The laws differ in three points:

{DIFFERENCES}"""

COLLISIONS = DATA / "liggghts"
FINAL, HISTORY = 0.005, 0.02
"""Bars: of velocities and spins after the impact, and of forces, relative to their peak."""

FRAMES = 150
SPACING = 6.0  # diameters between one collision and the next


@cache
def collisions() -> list[dict]:
    """The cases, with materials, initial states and what LIGGGHTS ended with."""
    return json.loads((COLLISIONS / "collisions.json").read_text("utf-8"))["collisions"]


def theirs(case: dict) -> Motion:
    """What LIGGGHTS computed."""
    time, vx, vz, spin, fx, fz = np.loadtxt(
        COLLISIONS / f"{case['tag']}.csv", delimiter=",", skiprows=1, unpack=True
    )
    return Motion(time, np.stack([vx, vz], 1), spin, np.stack([fx, fz], 1))


@cache
def ours() -> dict[str, Motion]:
    """What the package computes: all collisions of one material side by side in one run."""
    return {
        **_ours([case for case in collisions() if case["diameter"] == 1e-3]),
        **_ours([case for case in collisions() if case["diameter"] == 4e-6]),
    }


def _ours(cases: list[dict]) -> dict[str, Motion]:
    first, diameter = cases[0], cases[0]["diameter"]
    rows = [row for row, case in enumerate(cases) for _ in case["positions"]]
    leading = [rows.index(row) for row in range(len(cases))]

    def stacked(key: str) -> np.ndarray:
        return np.concatenate([np.array(case[key], float) for case in cases])

    position = stacked("positions")
    position[:, 0] += 0.5 * SPACING * diameter
    position[:, 1] += SPACING * diameter * (np.array(rows) + 0.5)
    position[:, 2] += np.array([0.0 if cases[row]["wall"] else 3 * diameter for row in rows])

    def table(key: str, elsewhere: float) -> np.ndarray:
        found = np.full((len(cases) + 1,) * 2, elsewhere)
        for row, case in enumerate(cases):
            found[row, row] = found[row, -1] = found[-1, row] = case[key]
        return found

    parameters = mrjax.Parameters(
        radius=diameter / 2,
        particle_density=first["density"],
        fluid_density=0.0,
        viscosity=0.0,
        gravity=0.0,
        elastic_modulus=first["elastic_modulus"],
        poisson_ratio=first["poisson_ratio"],
        wall_elastic_modulus=first["elastic_modulus"],
        wall_poisson_ratio=first["poisson_ratio"],
        friction=table("friction", 0.0),
        restitution=table("restitution", 1.0),
    ).astype(float)
    box = mrjax.Box((SPACING * diameter, SPACING * diameter * len(cases), SPACING * diameter))
    step = first["time_step"]
    interval = step * math.ceil(max(case["steps"] for case in cases) / FRAMES)

    @jax.jit
    def onward(state):
        run = mrjax.simulate(
            state, parameters, box, duration=interval, time_step=step, rebuild_every=200
        )
        return run.state, *mrjax.contact_forces(run.state, parameters, box)

    state = mrjax.place(position, stacked("velocities"), materials=rows, contact_diameter=diameter)
    velocity, spin, force = [state.velocity], [state.spin], [0.0 * state.velocity]
    for _ in range(FRAMES):
        state, acting, _ = onward(state)
        velocity.append(state.velocity)
        spin.append(state.spin)
        force.append(acting)
    velocity, spin, force = (np.array(moments)[:, leading] for moments in (velocity, spin, force))
    time = interval * np.arange(FRAMES + 1)
    return {
        case["tag"]: Motion(time, velocity[:, row, ::2], spin[:, row, 1], force[:, row, ::2])
        for row, case in enumerate(cases)
    }


def rows() -> list[Row]:
    """Every collision against LIGGGHTS; damped oblique ones law by law."""
    found = []
    for case in collisions():
        computed, reference, tag = ours()[case["tag"]], theirs(case), case["tag"]
        if case["restitution"] == 1.0:
            found += _compared(tag, "LIGGGHTS 3.8", reference, computed)
        else:
            same_law = integrated(case, as_liggghts=False)
            found += _compared(tag, "independent integration", same_law, computed)
            explained = integrated(case, as_liggghts=True)
            found += _compared(f"{tag}, by LIGGGHTS' law", "LIGGGHTS 3.8", reference, explained)
    return found


def differences() -> list[Row]:
    """Damped collisions of the package against LIGGGHTS: what the three differences make."""
    return [
        replace(row, bar=None)
        for case in collisions()
        if case["restitution"] < 1.0
        for row in _compared(case["tag"], "LIGGGHTS 3.8", theirs(case), ours()[case["tag"]])
    ]


def figures() -> dict[str, Figure]:
    """Contact forces of both codes along time."""
    shown = {
        "glass1mm_pair_oblique45_mu03_e1": "pair, 45°, e = 1",
        "glass1mm_wall_oblique45_mu03_e1": "wall, 45°, e = 1",
        "glass1mm_pair_oblique45_mu03_e05": "pair, 45°, e = 0.5",
        "glass1mm_wall_oblique70_mu03_e05_slide": "wall, 70°, e = 0.5",
    }
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    cases = {case["tag"]: case for case in collisions()}
    for axes, (tag, title) in zip(figure.subplots(2, 2).flat, shown.items(), strict=True):
        known, computed = theirs(cases[tag]), ours()[tag]
        for column, (name, line) in enumerate((("x", "k--"), ("z", "k-"))):
            axes.plot(
                1e6 * known.time,
                1e3 * known.force[:, column],
                ".",
                color="0.7",
                markersize=4,
                label="LIGGGHTS" if name == "x" else None,
            )
            axes.plot(
                1e6 * computed.time,
                1e3 * computed.force[:, column],
                line,
                linewidth=1,
                label=f"$F_{name}$",
            )
        axes.set_title(title, fontsize=9)
        axes.set_xlim(0, 110)
        axes.set_xlabel("time, µs")
        axes.set_ylabel("force, mN")
        axes.legend(frameon=False)
    return {"liggghts": figure}


def _compared(name: str, source: str, reference: Motion, computed: Motion) -> list[Row]:
    """Velocity and spin after the impact, and the forces along it."""
    speed = float(np.linalg.norm(reference.velocity[0]))
    rows = [
        Row(
            name,
            f"v_{axis} after impact",
            float(reference.velocity[-1, column]),
            float(computed.velocity[-1, column]),
            "m/s",
            FINAL,
            source,
            scale=speed if reference.velocity[-1, column] == 0 else None,
        )
        for column, axis in enumerate("xz")
        if reference.velocity[0, column] != 0
    ]
    if reference.spin[-1]:
        rows.append(
            Row(
                name,
                "spin after impact",
                float(reference.spin[-1]),
                float(computed.spin[-1]),
                "rad/s",
                FINAL,
                source,
            )
        )
    peak = float(np.linalg.norm(reference.force, axis=1).max())
    coarse, fine = sorted((reference, computed), key=lambda motion: len(motion.time))
    apart = [
        np.abs(np.interp(coarse.time, fine.time, fine.force[:, column]) - force).max()
        for column, force in enumerate(coarse.force.T)
    ]
    rows.append(
        Row(name, "largest difference of force", 0.0, float(max(apart)), "N", HISTORY, source, peak)
    )
    return rows
