"""Fits nested models of one experiment, and says which effects its data ask for.

A verdict compares the best model that has an effect with the best one
that lacks it. So two effects that explain the same readings are both undecided.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from calibrate.comparison.effects import EFFECTS, Effect, refusal, with_effects
from calibrate.comparison.evidence import evidence
from calibrate.comparison.nested import CLEAR, Candidate, search
from calibrate.experiment.experiment import Experiment
from calibrate.problem.solve import fit_experiment, fit_from_start
from mrjax import InputError

ASKED_FOR, NOT_NEEDED, UNDECIDED, NOT_TRIED = "asked for", "not needed", "undecided", "not tried"


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
        models, failures, scale = search(fit_model, possible)
    candidates = [
        replace(one, evidence=evidence(one.problem, one.fit, scale, one.evidence))
        for one in models.values()
    ]
    candidates.sort(key=lambda one: (not one.usable, one.evidence.bic))
    reasons |= {effect: dict(failures).get(effect.name) for effect in possible}
    verdicts = tuple(_verdict(effect, candidates, reasons[effect]) for effect in EFFECTS)
    return Comparison(experiment, tuple(candidates), verdicts, scale, tuple(failures))


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
    opposed = [one for one in candidates if (effect in one.effects) == (word == NOT_NEEDED)]
    reach = usable[0].evidence.bic + CLEAR
    rivals = [one.name for one in opposed if not one.usable and one.least_bic < reach]
    unfitted = ""
    if word != UNDECIDED and rivals:
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
