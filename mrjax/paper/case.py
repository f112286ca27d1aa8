"""A case of the paper: its lab sheet and its simulations."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from mrjax import Parameters, Recipe, standard_error
from mrjax.paper.runs import CASES, Simulated

T = TypeVar("T")

MEASURED_RATIO = {"case1": 78.0, "case2": 78.0, "case3": 90.0}
"""Final sedimentation ratios measured by Fang et al. (2005), %."""
FINAL_RATIO_WITHIN = 2.0
"""Tolerance of a final ratio, percentage points. Beds of a few hundred particles differ by up to 3
points between random starts, and the printed ratio is that of a single start."""


@dataclass(frozen=True)
class Case:
    """A case with the data for the rows of the table."""

    name: str
    recipe: Recipe
    runs: Simulated

    @cached_property
    def parameters(self) -> Parameters:
        """The parameters of the lab sheet."""
        return self.recipe.parameters()

    @property
    def velocity(self) -> float:
        """Simulated initial settling velocity, mm/day."""
        return self.runs.velocities[self.name]

    @property
    def measured_ratio(self) -> float:
        """Final sedimentation ratio measured by Fang et al. (2005), %."""
        return MEASURED_RATIO[self.name]

    @property
    def final_ratio(self) -> float:
        """Simulated final sedimentation ratio, mean of the random starts, %."""
        return self.runs.final_ratio(self.name)

    @property
    def final_ratio_error(self) -> float | None:
        """Standard error of `final_ratio`, %; None for a single start."""
        ratios = self.runs.final_ratios(self.name)
        return float(standard_error(ratios)) if len(ratios) > 1 else None

    def choose(self, *values: T) -> T:
        """Returns the value for this case, from one value for each of `CASES`."""
        return values[CASES.index(self.name)]
