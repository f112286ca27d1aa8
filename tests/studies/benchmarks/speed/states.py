"""What is followed: 314 particles of case2, dispersed or at rest, and larger beds made of them.

Without a fluid, equal in both codes: softened contacts with friction and restitution between rigid
walls. Beds are kept in the output folder, as they take a minute each.
"""

from pathlib import Path

import numpy as np

import mrjax
from mrjax.core.box import Box
from mrjax.core.interruption import Stop
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.dem.plan import RunPlan, System
from mrjax.paper.dry_beds import ELASTIC_MODULUS, REST, RESTITUTION
from mrjax.recipe.recipe import Recipe
from mrjax.simulation.options import RunOptions
from mrjax.simulation.overlap import OVERLAP
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run

FRICTION = 0.5
TIME_STEP = 5e-8
"""s."""
SKIN = 0.1
"""Reach of the neighbour lists beyond contact, in diameters."""
DILUTE, SETTLED, IN_OIL = "dilute", "settled", "settled in oil"
TILES = (1, 4, 8, 18)
"""Along x and along y: 314, 5,024, 20,096 and 101,736 particles."""


def recipe() -> Recipe:
    """case2."""
    return Recipe.load("case2")


def dry() -> Parameters:
    """Of the particles in a vacuum, between rigid walls."""
    return (
        recipe()
        .parameters()
        .replace(
            elastic_modulus=ELASTIC_MODULUS,
            viscosity=0.0,
            fluid_density=0.0,
            friction=FRICTION,
            restitution=RESTITUTION,
        )
    )


def dry_run(state: State, box: Box, steps: int, rebuild_every: int | None = None) -> RunPlan:
    """So many steps of the particles in a vacuum, in one frame."""
    options = RunOptions(time_step=TIME_STEP, skin=SKIN, rebuild_every=rebuild_every)
    system = System.of(state, dry(), box)
    return plan_run(system, options, duration=steps * TIME_STEP, frames=1)


def run(state: State, parameters: Parameters, box: Box, plan: RunPlan) -> Run:
    """A run as `mrjax.simulate` makes it, with all decided."""
    whole = PiecewiseRun(System.of(state, parameters, box), plan, stop=Stop())
    whole.advance(plan.schedule.frames)
    return whole.run()


def in_oil() -> Parameters:
    """Of case2 at its own viscosity, softened as `mrjax.sedimentation` does."""
    sheet = recipe()
    return mrjax.softened(sheet.parameters(), sheet.box, sheet.particle_count, OVERLAP)


def make(folder: Path, phase: str) -> None:
    """Makes the file of a phase unless it is there."""
    file = _file(folder, phase)
    if file.exists():
        return
    sheet = recipe()
    if phase == DILUTE:
        state, of_run = mrjax.disperse(sheet), {}
    elif phase == SETTLED:
        state, of_run = _dropped(), {}
    else:
        run = mrjax.settle(mrjax.disperse(sheet), in_oil(), sheet.box)
        state, of_run = run.state, {"time_step": run.time_step, "steps": run.steps}
    position, velocity = (
        np.asarray(part).reshape(-1, 3) for part in (state.position, state.velocity)
    )
    np.savez(file, position=position, velocity=velocity, **of_run)


def _dropped() -> State:
    """At rest, and still so beside its mirror image: friction on walls would not be there."""
    smooth = dry().replace(friction=np.diag([FRICTION, 0.0]))
    run = mrjax.settle(
        mrjax.disperse(recipe()), smooth, recipe().box, time_step=TIME_STEP, rest=REST, longest=0.05
    )
    return run.state


def load(folder: Path, phase: str, tiles: int = 1, dtype="float64") -> tuple[State, Box]:
    """The state of a phase, without what its contacts remember: the other code cannot know it."""
    kept, size = np.load(_file(folder, phase)), recipe().box.size
    position, velocity = tiled(kept["position"], kept["velocity"], size, tiles)
    diameter = 2.0 * float(recipe().parameters().radius)
    state = mrjax.place(position, velocity, contact_diameter=diameter, dtype=dtype)
    return state, Box((tiles * size[0], tiles * size[1], size[2]))


def curve(folder: Path) -> tuple[float, int]:
    """Time step, s, and number of steps of the run that settled in oil."""
    kept = np.load(_file(folder, IN_OIL))
    return float(kept["time_step"]), int(kept["steps"])


def tiled(
    position: np.ndarray, velocity: np.ndarray, size: tuple[float, float, float], tiles: int
) -> tuple[np.ndarray, np.ndarray]:
    """Every second tile is a mirror image: what leaned on a rigid wall leans as much on its image.

    A mirror is as stiff as a rigid wall, and has no friction.
    """
    places, rates = [], []
    for i in range(tiles):
        for j in range(tiles):
            sign = np.array([(-1.0) ** i, (-1.0) ** j, 1.0])
            shift = np.array([(i + i % 2) * size[0], (j + j % 2) * size[1], 0.0])
            places.append(position * sign + shift)
            rates.append(velocity * sign)
    return np.concatenate(places), np.concatenate(rates)


def tiles_of(particles: int) -> int:
    """How many times along x and along y, for about so many particles."""
    return max(1, round((particles / recipe().particle_count) ** 0.5))


def look(position: np.ndarray, velocity: np.ndarray) -> dict[str, float]:
    """By which two codes can be told to have the same bed; positions (N, 3) in m."""
    from scipy.spatial import cKDTree

    diameter = 2.0 * float(recipe().parameters().radius)
    pairs = cKDTree(position).query_pairs(diameter)
    return {
        "mean_height": float(position[:, 2].mean()),
        "mean_speed": float(np.linalg.norm(velocity, axis=1).mean()),
        "coordination_number": 2.0 * len(pairs) / len(position),
    }


def _file(folder: Path, phase: str) -> Path:
    return folder / f"{phase.replace(' ', '_')}.npz"
