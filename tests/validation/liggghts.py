"""Collisions of LIGGGHTS 3.8, an independent code, and three differences between its law and ours.

1. Its damped normal force may pull at the end of a contact; ours ends where it would.
2. It limits friction by mu |F_n| of that force, so that friction goes on while it pulls.
3. It leaves the tangential dashpot out while the spring slides.

Where there is no damping none of the three matters and the codes must agree. Where there is, each
law is integrated here, in the plane of motion, by a few lines that share nothing with the package:
LIGGGHTS must agree with its own law, and the package with its own.
"""

import json
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

import mrjax
from mrjax import contact

from .row import Row

DATA = Path(__file__).parents[1] / "data" / "liggghts"
FINAL, HISTORY = 0.005, 0.02
"""Bars: of velocities and spins after the impact, and of forces, relative to their peak."""

FRAMES = 150
SPACING = 6.0  # diameters between one collision and the next


@dataclass(frozen=True)
class Motion:
    """The first sphere of a collision along time; SI."""

    time: np.ndarray
    velocity: np.ndarray  # x, z, (T, 2)
    spin: np.ndarray  # y, (T,)
    force: np.ndarray  # x, z, (T, 2)


@cache
def collisions() -> list[dict]:
    """The cases, with materials, initial states and what LIGGGHTS ended with."""
    return json.loads((DATA / "collisions.json").read_text())["collisions"]


def theirs(case: dict) -> Motion:
    """What LIGGGHTS computed."""
    time, vx, vz, spin, fx, fz = np.loadtxt(
        DATA / f"{case['tag']}.csv", delimiter=",", skiprows=1, unpack=True
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


def integrated(case: dict, *, as_liggghts: bool) -> Motion:
    """The same collision by either law, integrated in the plane of motion.

    Velocity Verlet of one sphere; its partner is its mirror image, or the wall.

    Forces are Hertz' and Mindlin's of overlap d and tangential displacement s,
    F_n = 4/3 E* sqrt(R* d) d + z sqrt(5 m* k) d^(1/4) d' and likewise along the surface.
    """
    radius, wall, step = case["diameter"] / 2, case["wall"], case["time_step"]
    mass = 4 / 3 * np.pi * radius**3 * case["density"]
    nu, friction = case["poisson_ratio"], case["friction"]
    modulus = case["elastic_modulus"] / (2 * (1 - nu**2))  # E*: both surfaces of one material
    shear = case["elastic_modulus"] / (4 * (2 - nu) * (1 + nu))  # G*
    pair_radius, pair_mass = (radius, mass) if wall else (radius / 2, mass / 2)
    log = np.log(case["restitution"])
    damping = (
        -log / np.hypot(np.pi, log)
        if as_liggghts
        else float(contact.damping_ratio(float(case["restitution"])))
    )
    x, z = case["positions"][0][0], case["positions"][0][2]
    vx, vz = case["velocities"][0][0], case["velocities"][0][2]
    spin = stretch = ax = az = turning = 0.0
    record = [(0.0, vx, vz, 0.0, 0.0, 0.0)]
    for number in range(1, case["steps"] + 1):
        vx, vz, spin = vx + 0.5 * step * ax, vz + 0.5 * step * az, spin + 0.5 * step * turning
        x, z = x + step * vx, z + step * vz
        distance = z if wall else 2 * np.hypot(x, z)
        overlap = (radius if wall else 2 * radius) - distance
        nx, nz = (0.0, 1.0) if wall else (2 * x / distance, 2 * z / distance)
        tx, tz = nz, -nx
        fn = ft = 0.0
        if overlap > 0:
            share = 1 if wall else 2  # the mirror image moves as much the other way
            arm = radius - overlap / 2
            closing = -share * (vx * nx + vz * nz)
            slip = share * (vx * tx + vz * tz - arm * spin)
            root = np.sqrt(pair_radius * overlap)
            normal, tangential = 2 * modulus * root, 8 * shear * root
            fn = 2 / 3 * normal * overlap + damping * np.sqrt(10 / 3 * pair_mass * normal) * closing
            dashpot = damping * np.sqrt(10 / 3 * pair_mass * tangential)
            if not as_liggghts:
                fn = max(fn, 0.0)
            limit = friction * abs(fn)
            stretch += step * slip
            if abs(tangential * stretch) > limit:
                stretch = np.sign(stretch) * limit / tangential
                ft = -tangential * stretch
                if not as_liggghts:
                    ft = -np.clip(tangential * stretch + dashpot * slip, -limit, limit)
            else:
                ft = -(tangential * stretch + dashpot * slip)
                if not as_liggghts:
                    ft = np.clip(ft, -limit, limit)
            torque = -arm * ft  # about y: (-arm n) x (ft t), with n x t = -y
        else:
            stretch = torque = 0.0
        fx, fz = fn * nx + ft * tx, fn * nz + ft * tz
        ax, az, turning = fx / mass, fz / mass, torque / (0.4 * mass * radius**2)
        vx, vz, spin = vx + 0.5 * step * ax, vz + 0.5 * step * az, spin + 0.5 * step * turning
        record.append((number * step, vx, vz, spin, fx, fz))
    time, vx, vz, spin, fx, fz = np.array(record).T
    return Motion(time, np.stack([vx, vz], 1), spin, np.stack([fx, fz], 1))


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
    """Contact forces of both codes along time; grey dots LIGGGHTS, lines the package."""
    shown = {
        "glass1mm_pair_oblique45_mu03_e1": "pair, 45°, e = 1",
        "glass1mm_wall_oblique45_mu03_e1": "wall, 45°, e = 1",
        "glass1mm_pair_oblique45_mu03_e05": "pair, 45°, e = 0.5",
        "glass1mm_wall_oblique70_mu03_e05_slide": "wall, 70°, e = 0.5",
    }
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    cases = {case["tag"]: case for case in collisions()}
    for axes, (tag, title) in zip(figure.subplots(2, 2).flat, shown.items(), strict=True):
        reference, computed = theirs(cases[tag]), ours()[tag]
        for column, (name, line) in enumerate((("x", "--"), ("z", "-"))):
            axes.plot(
                1e6 * reference.time, 1e3 * reference.force[:, column], ".", color="0.7", ms=4
            )
            axes.plot(
                1e6 * computed.time,
                1e3 * computed.force[:, column],
                f"k{line}",
                lw=1,
                label=f"F_{name}",
            )
        axes.set_title(title, fontsize=9)
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
