"""Search through nested models, from the plain one upwards.

Every model is extended by each further effect if it is better than all smaller models within it.
The best model is not the only one to be extended: an effect that explains most by itself may be
needless beside two others.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

from calibrate.comparison.effects import EFFECTS, Effect, combine
from calibrate.comparison.evidence import Evidence, evidence, reduced_chi_squared
from calibrate.least_squares.finish import SETTLED_BELOW
from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem
from mrjax import InputError, SimulationError

CLEAR = 4.0
"""Difference of BIC from which one model is preferred. One value more is then worth its place if
chi-squared falls by 7 with 20 readings, which chance does in one of 100."""


@dataclass(frozen=True)
class Candidate:
    """A fitted model with some of the effects."""

    effects: tuple[Effect, ...]
    problem: Problem
    fit: Fit
    evidence: Evidence

    @property
    def name(self) -> str:
        """Names of its effects; `plain` without any."""
        return " + ".join(effect.name for effect in self.effects) or "plain"

    @property
    def usable(self) -> bool:
        """True if the fit is at an optimum, so that it can be compared."""
        return self.fit.converged or self.evidence.unsettled < SETTLED_BELOW

    @property
    def least_bic(self) -> float:
        """BIC that the model may still reach; its own if the fit is at an optimum."""
        return self.evidence.bic - (0.0 if self.usable else 2.0 * self.evidence.unsettled)


class Searched(NamedTuple):
    """The models that a search has fitted."""

    models: dict[frozenset[Effect], Candidate]
    """Fitted models by their effects."""
    failures: list[tuple[str, str]]
    """Name and reason of each model that could not be fitted."""
    error_scale: float
    """Factor that brings the stated errors to the residuals of the best model; at least 1."""


def search(
    fit_model: Callable[[frozenset[Effect], Candidate | None], Candidate], possible: list[Effect]
) -> Searched:
    """Fits the plain model, and extends whatever is better than all smaller models within it.

    Args:
      fit_model: function from effects, and a smaller model to begin near, to a fitted model.
      possible: effects that can be tried.

    Raises:
      SimulationError: the plain model did not converge.
    """
    plain = frozenset[Effect]()
    models = {plain: fit_model(plain, None)}
    if not models[plain].usable:
        raise SimulationError(
            "the plain model did not converge, so that nothing can be compared with it; start "
            "nearer, or give narrower priors"
        )
    failures: list[tuple[str, str]] = []
    scale = _error_scale(models.values())
    extended = [plain]
    while extended:
        parents = {
            smaller | {effect}: smaller
            for smaller in reversed(extended)  # the best of a model's parents stays
            for effect in possible
            if effect not in smaller and combine(smaller | {effect})
        }
        for effects, parent in parents.items():
            try:
                models[effects] = fit_model(effects, models[parent])
            except (InputError, SimulationError) as error:
                name = " + ".join(one.name for one in EFFECTS if one in effects)
                failures.append((name, str(error)))
        scale = _error_scale(models.values())
        bic = {effects: _bic(one, scale) for effects, one in models.items()}
        extended = [
            effects
            for effects in sorted(filter(bic.__contains__, parents), key=bic.__getitem__)
            if all(bic[effects] < bic[smaller] for smaller in bic if smaller < effects)
        ]
    return Searched(models, failures, scale)


def _bic(candidate: Candidate, scale: float) -> float:
    """BIC with stated errors that are scaled, also of a fit that has not quite converged."""
    return evidence(candidate.problem, candidate.fit, scale, candidate.evidence).bic


def _error_scale(candidates: Iterable[Candidate]) -> float:
    reduced = (reduced_chi_squared(one.problem, one.fit) for one in candidates if one.usable)
    return max(1.0, min(reduced, default=1.0) ** 0.5)
