"""Kynch's theory of sedimentation (1952) against particles in a tall periodic column.

The drag follows Richardson & Zaki at each particle's height. A suspension of volume fraction phi
falls with v = v_0 (1 - phi)^n; its interface falls with that of the initial fraction. Where the
flux phi v(phi) lies above the chord from (phi_0, phi_0 v(phi_0)) to (phi_bed, 0) for all fractions
in between, suspension and bed meet in one shock, which rises with

    phi_0 v(phi_0) / (phi_bed - phi_0)

and meets the interface at t* = H (1 - phi_0 / phi_bed) / v(phi_0).
"""

import os
from concurrent.futures import ThreadPoolExecutor

import jax.numpy as jnp
import numpy as np

import mrjax
from mrjax.recipe.recipe import Recipe

FRACTION, EXPONENT = 0.125, 4.65
"""Initial volume fraction, for which there is one shock; exponent of Richardson & Zaki."""
WIDTH, HEIGHT = 8, 100
"""Of the column, in particle diameters. The mean over a width holds a particle itself, which is
not in its own way, and lacks those that it keeps away: eight times its volume, of which a share of
phi is solid. In a narrow column that shows, except about phi = 1/8."""
STARTS = 4
"""A random suspension is denser here and there: of 1500 particles, by some per cent."""
STEP, OVERLAP = 0.7e-3, 0.1
"""s: contacts in the thin suspension, where drag is 25 times weaker than in a bed, limit it."""


def recipe(fraction: float, exponent: float, width: float, height: float) -> Recipe:
    """Particles, oil and drag of case2 in a column, without friction."""
    sheet = Recipe.load("case2").model_dump()
    dense, light = sheet["particle"]["density"], sheet["fluid"]["density"]
    weight = fraction * dense / (fraction * dense + (1 - fraction) * light)
    diameter = sheet["particle"]["diameter"]
    return Recipe.model_validate(
        sheet
        | {
            "name": "column",
            "composition": {"particle": weight, "fluid": 1 - weight},
            "drag": {
                "f_w": {"closure": "richardson-zaki", "exponent": exponent},
                "local": True,
            },
            "contact": {"friction": 0.0, "restitution": 1.0},
            "box": {
                "size": [width * diameter, width * diameter, height * diameter],
                "periodic": [True, True, False],
            },
        }
    )


def measured() -> dict:
    """The interface, the bed's front and where they meet, each over Kynch's value."""
    column = recipe(FRACTION, EXPONENT, WIDTH, HEIGHT)
    parameters = mrjax.softened(column.parameters(), column.box, column.particle_count, OVERLAP)
    falling = float(mrjax.terminal_velocity(parameters))
    expected = column.box.height * (1 - FRACTION / 0.6) / falling

    def followed(seed: int) -> mrjax.Run:
        return mrjax.simulate(
            mrjax.disperse(column, seed),
            parameters,
            column.box,
            duration=1.2 * expected,
            frames=120,
            time_step=STEP,
            skin=0.05,
            hindrance=column.hindrance,
        )

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return compared(list(pool.map(followed, range(STARTS))), column, falling)


def compared(runs: list[mrjax.Run], column: Recipe, falling: float) -> dict:
    """What the mean of runs shows, over what the theory says; and the curves, in heights."""
    height, diameter = column.box.height, column.particle.diameter
    times, phi = np.asarray(runs[0].times), column.volume_fraction
    # While the suspension above the bed is a good part of the column.
    rising = slice(len(times) // 6, int(0.55 * len(times)))
    bed = float(np.mean([bed_fraction(run, rising, diameter) for run in runs]))
    mudline = np.mean([run.mudline for run in runs], axis=0)
    front = np.mean([mrjax.bed_front(run, bed, phi) for run in runs], axis=0)
    rises = phi * falling / (bed - phi)
    meets = height * (1 - phi / bed) / falling
    down, up = (np.polyfit(times[rising], line[rising], 1) for line in (mudline, front))
    return {
        "starts": len(runs),
        "particles": column.particle_count,
        "bed_fraction": bed,
        "interface": -down[0] / falling,
        "front": up[0] / rises,
        "meeting": (down[1] - up[1]) / (up[0] - down[0]) / meets,
        "overlap": max(float(run.deepest_overlap) for run in runs),
        "times": times / meets,
        "mudline": mudline / height,
        "bed": front / height,
    }


def bed_fraction(run: mrjax.Run, frames: slice, diameter: float) -> float:
    """Volume fraction of the bed while it grows: of what lies well below its front; 1."""
    levels = diameter * np.arange(1.0, 0.4 * run.box.height / diameter)
    phi = np.asarray(mrjax.concentration(run, levels, 2 * diameter))[frames]
    packed = phi > 0.5  # no suspension is, and a packing hardly anywhere less
    inside = packed & np.roll(packed, -3, axis=1) & np.roll(packed, -2, axis=1)
    return float(jnp.mean(phi[inside]))
