"""One of the paper's cases: its lab sheet, and the runs of it."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from mrjax import Parameters, Recipe, standard_error
from mrjax.paper.runs import CASES, Simulated

T = TypeVar("T")

MEASURED_RATIO = {"case1": 78.0, "case2": 78.0, "case3": 90.0}
"""Fang et al. (2005), %."""
FINAL_RATIO_WITHIN = 2.0
"""Percentage points: beds of a few hundred particles differ by up to 3 from one random start to
another, and the printed ratio is that of a single one."""


@dataclass(frozen=True)
class Case:
    """A case with what a row needs of it."""

    name: str
    recipe: Recipe
    runs: Simulated

    @cached_property
    def parameters(self) -> Parameters:
        """The parameters of the lab sheet."""
        return self.recipe.parameters()

    @property
    def velocity(self) -> float:
        """Initial settling velocity, simulated; mm/day."""
        return self.runs.velocities[self.name]

    @property
    def measured_ratio(self) -> float:
        """Final sedimentation ratio measured by Fang et al. (2005), %."""
        return MEASURED_RATIO[self.name]

    @property
    def final_ratio(self) -> float:
        """Final sedimentation ratio, simulated; mean of the random starts, %."""
        return self.runs.final_ratio(self.name)

    @property
    def final_ratio_error(self) -> float | None:
        """Standard error of `final_ratio`, %; None of a single start."""
        ratios = self.runs.final_ratios(self.name)
        return float(standard_error(ratios)) if len(ratios) > 1 else None

    def choose(self, *values: T) -> T:
        """The value of this case, of three that are given for `CASES`."""
        return values[CASES.index(self.name)]
