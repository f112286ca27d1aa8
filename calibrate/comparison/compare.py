"""Fits nested models of one experiment, and says which effects its data ask for.

The plain model comes first, then each effect alone. Models that improve on all smaller ones are
extended by further effects. A verdict compares the best model that has an effect with the best one
that lacks it. So two effects that explain the same readings are both undecided.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from calibrate.comparison.effects import EFFECTS, Effect, combine, refusal, with_effects
from calibrate.comparison.evidence import Evidence, evidence, reduced_chi_squared
from calibrate.experiment.experiment import Experiment
from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem
from calibrate.problem.solve import fit_experiment, fit_from_start
from mrjax import InputError, SimulationError

CLEAR = 4.0
"""Difference of BIC from which one model is preferred. One value more is then worth its place if
chi-squared falls by 7 with 20 readings, which chance does in one of 100."""
ASKED_FOR, NOT_NEEDED, UNDECIDED, NOT_TRIED = "asked for", "not needed", "undecided", "not tried"


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
        """True if the fit converged, so that it can be compared."""
        return self.fit.converged


@dataclass(frozen=True)
class Verdict:
    """The verdict on one effect."""

    effect: Effect
    word: str
    """`asked for`, `not needed`, `undecided` or `not tried`."""
    gain: float | None = None
    """BIC of the best model that lacks it, less that of the best one that has it."""
    left_out_gain: float | None = None
    """The same of the deviance of readings that are left out."""
    left_out_error: float | None = None
    """Standard error of that, from the spread over the readings."""
    best_with: Candidate | None = None
    best_without: Candidate | None = None
    reason: str = ""
    """Reason why it was not tried, or could not be decided."""
    unfitted: str = ""
    """Name of a model whose fit did not converge, which alone leaves it undecided."""


@dataclass(frozen=True)
class Comparison:
    """Nested models of one experiment, best first, and the verdicts on the effects."""

    experiment: Experiment
    candidates: tuple[Candidate, ...]
    """Fitted models, best first by BIC; those that did not converge come last."""
    verdicts: tuple[Verdict, ...]
    """One for each effect."""
    error_scale: float
    """Factor on the stated errors; above 1 if they are too small for every model."""
    failures: tuple[tuple[str, str], ...] = ()
    """Name and reason of each model that could not be fitted."""

    @property
    def best(self) -> Candidate:
        """The model with the least BIC."""
        return self.candidates[0]

    @property
    def decided(self) -> bool:
        """True if no effect is undecided."""
        return all(verdict.word != UNDECIDED for verdict in self.verdicts)


def compare(
    experiment: Experiment | str | Path,
    *,
    starts: int = 1,
    seed: int = 0,
    checkpoint: str | Path | None = None,
    progress: bool = False,
) -> Comparison:
    """Fits nested models of an experiment: which effects do its data ask for?

    Effects are flocs, a yielding bed, a delay at the start and several sizes. Every model is the
    `column` of the same samples and parameters. An effect that the file of the experiment has keeps
    its priors from there; any other gets wide ones.

    Args:
      experiment: samples and parameters, or the name or file to load them from.
      starts, seed: as for `run`.
      checkpoint: folder that stores the finished work of each model, as for `run`.
      progress: whether to show a progress bar, on standard error.

    Returns:
      a Comparison; `verdicts` says what the data ask for, and where they cannot choose.

    Raises:
      InputError: no sample has a curve, or the plain model cannot be used.
      SimulationError: the plain model did not converge.
    """
    if not isinstance(experiment, Experiment):
        experiment = Experiment.load(experiment)
    if not any(sample.readings_of_curve for sample in experiment.samples):
        raise InputError(
            f"{experiment.name}: no sample has a curve; effects are told apart by the mudline "
            "against time, so give a sample a curve"
        )
    reasons = {effect: refusal(experiment, effect) for effect in EFFECTS}
    possible = [effect for effect in EFFECTS if reasons[effect] is None]
    bar = tqdm(desc="compare", disable=not progress, leave=False, bar_format="{desc}, {elapsed}")

    def fit_model(effects: frozenset[Effect], near: Candidate | None) -> Candidate:
        ordered = tuple(sorted(effects, key=EFFECTS.index))
        name = "-".join(effect.name.replace(" ", "-") for effect in ordered) or "plain"
        bar.set_description(f"compare: {name}")
        folder = None if checkpoint is None else Path(checkpoint) / name
        options: dict[str, Any] = dict(starts=starts, seed=seed, checkpoint=folder)
        changed = with_effects(experiment, effects)
        problem, fit = fit_experiment(_begun_near(changed, near), "column", **options)
        candidate = Candidate(ordered, problem, fit, evidence(problem, fit))
        if near is None or _is_no_worse(candidate, near):
            return candidate
        del options["starts"]
        if folder is not None:
            options["checkpoint"] = folder / "near"
        problem, fit = fit_from_start(_begun_near(changed, near, ordered), "column", **options)
        beside = Candidate(ordered, problem, fit, evidence(problem, fit))
        return min(candidate, beside, key=lambda one: (not one.usable, one.evidence.deviance))

    with bar:
        models, failures = _search(fit_model, possible)
    scale = _error_scale(models.values())
    candidates = [
        replace(one, evidence=evidence(one.problem, one.fit, scale)) for one in models.values()
    ]
    candidates.sort(key=lambda one: (not one.usable, one.evidence.bic))
    reasons |= {effect: dict(failures).get(effect.name) for effect in possible}
    verdicts = tuple(_verdict(effect, candidates, reasons[effect]) for effect in EFFECTS)
    return Comparison(experiment, tuple(candidates), verdicts, scale, tuple(failures))


def _search(
    fit_model: Callable[[frozenset[Effect], Candidate | None], Candidate], possible: list[Effect]
) -> tuple[dict[frozenset[Effect], Candidate], list[tuple[str, str]]]:
    """Fits the plain model, and extends whatever improves on all smaller models.

    Args:
      fit_model: function from effects, and a smaller model to begin near, to a fitted model.
      possible: effects that can be tried.

    Returns:
      the fitted models by their effects, and name and reason of each that could not be fitted.

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
    frontier = [plain]
    while frontier:
        scale = _error_scale(models.values())
        before = min(_bic(one, scale) for one in models.values())
        larger = {}
        for effects in frontier:
            for effect in possible:
                wider = effects | {effect}
                if wider not in models and wider not in larger and combine(wider):
                    larger[wider] = effects
        for effects, parent in larger.items():
            try:
                models[effects] = fit_model(effects, models[parent])
            except (InputError, SimulationError) as error:
                name = " + ".join(one.name for one in EFFECTS if one in effects)
                failures.append((name, str(error)))
        scale = _error_scale(models.values())
        now = min(_bic(one, scale) for one in models.values())
        frontier = [
            effects
            for effects in larger
            if effects in models and _bic(models[effects], scale) < min(before, now + CLEAR)
        ]
    return models, failures


def _bic(candidate: Candidate, scale: float) -> float:
    if not candidate.usable:
        return np.inf
    return evidence(candidate.problem, candidate.fit, scale).bic


def _error_scale(candidates: Iterable[Candidate]) -> float:
    """Factor that brings the stated errors to the residuals of the best model; at least 1."""
    reduced = (reduced_chi_squared(one.problem, one.fit) for one in candidates if one.usable)
    return max(1.0, min(reduced, default=1.0) ** 0.5)


def _is_no_worse(candidate: Candidate, smaller: Candidate) -> bool:
    """True if a fit converged, and fits no worse than a smaller model, but for its priors."""
    return candidate.usable and candidate.evidence.deviance < smaller.evidence.deviance + CLEAR


def _begun_near(
    experiment: Experiment, near: Candidate | None, hardly: Iterable[Effect] = ()
) -> Experiment:
    """The experiment with searches that begin at the values of a smaller model.

    Args:
      experiment: experiment with one more effect.
      near: the smaller model.
      hardly: effects that begin where they hardly act, unless the smaller model has them.
    """
    if near is None:
        return experiment
    values = {effect.quantities[0]: effect.hardly for effect in hardly if effect.hardly is not None}
    values |= {
        parameter.label: float(parameter.value(x))
        for parameter, x in zip(near.problem.experiment.parameters, near.fit.values, strict=True)
    }
    parameters = tuple(
        replace(parameter, begin=values.get(parameter.label, parameter.begin))
        for parameter in experiment.parameters
    )
    return replace(experiment, parameters=parameters)


def _verdict(effect: Effect, candidates: list[Candidate], reason: str | None) -> Verdict:
    """The verdict on one effect, from all candidates, best first."""
    usable = [one for one in candidates if one.usable]
    having = [one for one in usable if effect in one.effects]
    lacking = [one for one in usable if effect not in one.effects]
    if not having:
        return Verdict(effect, NOT_TRIED, reason=reason or "its fit did not converge")
    best_with, best_without = having[0], lacking[0]
    gain = best_without.evidence.bic - best_with.evidence.bic
    differences = best_without.evidence.left_out - best_with.evidence.left_out
    left_out_gain = float(differences.sum())
    left_out_error = float(np.std(differences, ddof=1) * differences.size**0.5)
    word, why = _word(usable[0], best_with, best_without, gain, left_out_gain)
    rivals = [one.name for one in candidates if not one.usable and effect not in one.effects]
    unfitted = ""
    if word == ASKED_FOR and rivals:
        word, unfitted = UNDECIDED, rivals[0]
        why = f"the fit of {unfitted} did not converge, and may explain as much"
    return Verdict(
        effect, word, gain, left_out_gain, left_out_error, best_with, best_without, why, unfitted
    )


def _word(
    best: Candidate,
    best_with: Candidate,
    best_without: Candidate,
    gain: float,
    left_out_gain: float,
) -> tuple[str, str]:
    if gain >= CLEAR and left_out_gain > 0.0:
        return ASKED_FOR, ""
    if gain >= CLEAR:
        return UNDECIDED, "readings that are left out are predicted no better with it"
    rivals = set(best_without.effects) - set(best_with.effects)
    if gain > 0.0:
        if rivals:
            return UNDECIDED, f"{best_without.name} explains the readings nearly as well"
        return UNDECIDED, "it explains the readings only a little better"
    if gain > -CLEAR and rivals:
        return UNDECIDED, f"{best_with.name} explains the readings nearly as well as {best.name}"
    return NOT_NEEDED, ""
