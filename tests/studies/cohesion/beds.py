"""Beds of spheres that attract each other, by mrjax and by LAMMPS from the same starts.

Units: radius, density and gravity are 1. The walls do not attract, the attraction acts in contact
only, and the Stokes number is 0.04.
"""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

import mrjax

FILE = Path(__file__).parent / "beds.csv"
SIZE, COUNT = (12.5, 12.5, 25.0), 314
"""Box and number of spheres of case 2."""
FRICTION, DRAG, DURATION = 0.3, 5.0, 260.0
"""Coulomb's coefficient; drag coefficient over weight; time until rest."""
WEIGHT = 4.0 / 3.0 * np.pi
STEPS = {0: (4e3, 4e-3), 1: (4e3, 4e-3), 3: (8e3, 4e-3), 10: (1.5e4, 3e-3), 30: (3e4, 2e-3)}
"""Elastic modulus and step by Bond number; half the step with rolling resistance."""


class Bed(NamedTuple):
    """One bed at rest."""

    code: str
    bond_number: int
    rolling_friction: float
    start: int
    top: float  # of the highest sphere, over the height of the box
    twice_mean_height: float  # of the centres, over the height of the box
    coordination: float
    deepest_overlap: float  # radii


def measured() -> list[Bed]:
    """The beds of `beds.csv`."""
    with FILE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    kinds = Bed.__annotations__
    return [Bed(**{name: kinds[name](value) for name, value in row.items()}) for row in rows]


def start(seed: int) -> np.ndarray:
    """Centres of spheres at random without overlap, (N, 3)."""
    rng, size, cells = np.random.default_rng(seed), np.array(SIZE), (6, 6, 12)
    grid = np.stack(np.unravel_index(np.arange(np.prod(cells)), cells), axis=1)
    position = ((grid + 0.5) * size / np.array(cells))[rng.permutation(len(grid))[:COUNT]]
    for _ in range(200):
        for one in range(COUNT):
            moved = position[one] + 0.3 * rng.uniform(-1.0, 1.0, 3)
            if (moved < 1.0).any() or (moved > size - 1.0).any():
                continue
            square = ((position - moved) ** 2).sum(axis=1)
            square[one] = np.inf
            if square.min() > 4.02:
                position[one] = moved
    return position


def parameters(bond_number: int, rolling_friction: float) -> mrjax.Parameters:
    """Spheres with this Bond number, in walls that neither attract nor resist rolling."""
    modulus, _ = STEPS[bond_number]
    layer = 1e-3
    hamaker = bond_number * WEIGHT * 12.0 * (2.0 * layer) ** 2
    between = np.array([[1.0, 0.0], [0.0, 0.0]])
    attraction = {} if bond_number == 0 else dict(hamaker=hamaker * between, layer_thickness=layer)
    return mrjax.Parameters(
        radius=1.0,
        particle_density=1.0,
        fluid_density=0.0,
        added_mass=0.0,
        viscosity=DRAG * WEIGHT / (6.0 * np.pi),
        gravity=1.0,
        elastic_modulus=modulus,
        poisson_ratio=0.3,
        wall_elastic_modulus=modulus,
        wall_poisson_ratio=0.3,
        friction=FRICTION,
        rolling_friction=rolling_friction * between,
        rolling_damping=0.3,
        attraction_range=0.0,
        **attraction,
    ).astype(float)


def settled(bond_number: int, rolling_friction: float, seed: int) -> Bed:
    """The bed of one start by mrjax."""
    spheres, box = parameters(bond_number, rolling_friction), mrjax.Box(SIZE)
    _, step = STEPS[bond_number]
    run = mrjax.simulate(
        mrjax.place(start(seed)),
        spheres,
        box,
        duration=DURATION,
        frames=10,
        time_step=step / 2.0 if rolling_friction else step,
        skin=0.05,
    )
    height = np.asarray(run.state.position[:, 2])
    touching = np.asarray(mrjax.coordination_number(run.state, spheres, box))
    return Bed(
        "mrjax",
        bond_number,
        rolling_friction,
        seed,
        round((height.max() + 1.0) / SIZE[2], 3),
        round(2.0 * height.mean() / SIZE[2], 3),
        round(float(touching.mean()), 2),
        round(float(run.deepest_overlap), 3),
    )
