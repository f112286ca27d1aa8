"""The simulations from which the numbers are computed: the three cases of the paper, and its beds.

Velocities come from the simulation of all particles, not from the closed form. Final ratios come
from beds that were dropped without a fluid, as in the paper.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
from jax import Array

import mrjax
from mrjax import Parameters, Recipe, Run, State
from mrjax.core.units import MM_PER_DAY
from mrjax.laws import time_scales
from mrjax.observables.interface import RELAXATIONS_TO_STEADY
from mrjax.paper.dry_beds import dropped

CASES = ("case1", "case2", "case3")

PAPER_STEPS = {"case1": 100e-9, "case2": 0.1e-9, "case3": 1.0e-9}
"""Steps of Table 2, s."""


@dataclass(frozen=True)
class Simulated:
    """Results of the simulations from which the rows are computed."""

    velocities: dict[str, float]
    """Initial settling velocities by case, and that of case2 with the printed f_w; mm/day."""
    beds: dict[str, Run]
    """M dropped beds, by case. case1 and case2 share their beds, because they differ in drag only.
    """
    dispersed: dict[str, State]
    """Initial suspension of the first bed, by case."""

    def final_ratios(self, case: str) -> Array:
        """Returns the top of the highest particle at rest over the height of the box; %, (M,)."""
        bed = self.beds[case]
        return 100 * bed.mudline[:, -1] / bed.initial_height

    def final_ratio(self, case: str) -> float:
        """Returns the mean of `final_ratios`, %."""
        return float(jnp.mean(self.final_ratios(case)))


def simulated(
    seed: int = 0,
    starts: int = 3,
    report: Callable[[str], None] = lambda text: None,
    checkpoint: Path | None = None,
    progress: bool = False,
) -> Simulated:
    """Simulates the cases of the paper, and case 2 with the printed f_w, too.

    Args:
      seed: seed of the random suspension; the dropped ones have this and the following seeds.
      starts: number M of random starts for each kind of bed.
      report: function called with a line of text before each part.
      checkpoint: folder for checkpoints of the beds, as for `mrjax.settle`.
      progress: True to show progress bars on standard error.
    """
    recipes = {case: Recipe.load(case) for case in CASES}
    velocities = {}
    for case, recipe in recipes.items():
        report(f"simulating {case}")
        parameters = recipe.parameters()
        velocities[case] = simulated_velocity(recipe, parameters, seed, PAPER_STEPS[case])
    report("simulating case2 with the printed f_w")
    printed_f_w = recipes["case2"].parameters().replace(f_w=48.49)
    velocities["printed f_w"] = simulated_velocity(
        recipes["case2"], printed_f_w, seed, PAPER_STEPS["case2"]
    )
    beds = {}
    for case in ("case1", "case3"):
        report(f"dropping {starts} suspension{'s' * (starts > 1)} of {case}")
        folder = checkpoint and checkpoint / case
        seeds = range(seed, seed + starts)
        beds[case] = dropped(recipes[case], seeds, progress=progress, checkpoint=folder)
    beds["case2"] = beds["case1"]
    dispersed = {case: mrjax.disperse(recipe, seed) for case, recipe in recipes.items()}
    return Simulated(velocities, beds, dispersed)


def simulated_velocity(
    recipe: Recipe, parameters: Parameters, seed: int, time_step: float
) -> float:
    """Simulates the particles of a recipe; returns the initial settling velocity, mm/day."""
    relaxation = float(jnp.max(time_scales.relaxation_time(parameters)))
    run = mrjax.simulate(
        mrjax.disperse(recipe, seed),
        parameters,
        recipe.box,
        duration=RELAXATIONS_TO_STEADY * relaxation,
        time_step=time_step,
    )
    return MM_PER_DAY * float(mrjax.settling_velocity(run))
