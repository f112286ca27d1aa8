"""Particles that many tests use: parameters by material, a pair on a line."""

from typing import Any

import numpy as np

import mrjax

DRY = dict(fluid_density=0.0, viscosity=0.0, gravity=0.0)
"""Neither fluid nor weight."""


def unit_spheres(**changes: Any) -> mrjax.Parameters:
    """Of 1 m in radius and 1 kg, soft, dry; leaves as arrays."""
    leaves = dict(radius=1.0, particle_density=3 / (4 * np.pi), **DRY)
    leaves |= dict(elastic_modulus=1000.0, poisson_ratio=0.3)
    return mrjax.Parameters(**(leaves | changes)).astype(float)


def glass(**changes: Any) -> mrjax.Parameters:
    """Softened beads of 2 mm, dry."""
    leaves = dict(radius=1e-3, particle_density=2500.0, **DRY)
    leaves |= dict(elastic_modulus=1e7, poisson_ratio=0.3)
    return mrjax.Parameters(**(leaves | changes))


def iron(**changes: Any) -> mrjax.Parameters:
    """Softened spheres of 2 um in a thin oil."""
    leaves = dict(radius=1e-6, particle_density=7000.0, fluid_density=1000.0, viscosity=0.01)
    leaves |= dict(elastic_modulus=1e9, poisson_ratio=0.3)
    return mrjax.Parameters(**(leaves | changes))


def light_balls(**changes: Any) -> mrjax.Parameters:
    """A little heavier than the water around them, 4 um, soft."""
    leaves = dict(radius=2e-6, particle_density=1200.0, fluid_density=1000.0, viscosity=1e-3)
    leaves |= dict(elastic_modulus=1e7, poisson_ratio=0.25)
    return mrjax.Parameters(**(leaves | changes))


def head_on(
    box_size: float = 10e-6, gap: float = 1e-8
) -> tuple[mrjax.State, mrjax.Parameters, mrjax.Box]:
    """A pair on a line: two iron spheres about to meet along x in vacuum."""
    middle = box_size / 2
    state = mrjax.place(
        [[middle - 1e-6 - gap / 2, middle, middle], [middle + 1e-6 + gap / 2, middle, middle]],
        [[0.01, 0, 0], [-0.01, 0, 0]],
    )
    return state, iron(**DRY), mrjax.Box((box_size,) * 3)
