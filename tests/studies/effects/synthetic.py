"""Synthetic mudlines with known effects, and the verdicts of a comparison on each.

A set has one tube of mineral powder in water, 24 readings, values drawn from the priors, and
normal noise. The expected gain of an effect is the least chi-squared, without noise in the data, of
all models that lack it: other effects may take its place. The noise is chosen so that the weakest
effect of a set has the drawn gain.
"""

import csv
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jax import Array

import mrjax
from calibrate.comparison.compare import (
    _begun_near,
    _is_no_worse,
    _verdict,
)
from calibrate.comparison.effects import EFFECTS, Effect, combine, with_effects
from calibrate.comparison.evidence import evidence
from calibrate.comparison.nested import Candidate, search
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement, Sample
from calibrate.least_squares.fit import fit
from calibrate.models.column import column
from calibrate.models.forward_models import cheap_model
from calibrate.problem.beginnings import begin
from calibrate.problem.problem import Problem

HEIGHT, FRACTION, ERROR, READINGS = 0.3, 0.08, 1.0, 24
FIRST, LAST = 0.03, 6.0
"""Times of the first and the last reading, in times of a free fall."""
LEAST_GAIN, MOST_GAIN = 25.0, 100.0
LEAST_ERROR = 0.02
"""Noise in mm; values whose effects are seen only with less are drawn anew."""
TRIALS = 20
"""Number of draws, at most."""
FINE = 0.1
"""Standard deviation in mm by which rivals are fitted to readings without noise."""
FILE = Path(__file__).parent / "verdicts.csv"
FLOCS, YIELDING, DELAY, SIZES = EFFECTS
RANGES = {
    "f_w.floc_volume": (2.0, 5.0),
    "compression.gel_fraction": (0.12, 0.2),
    "compression.stress": (1.0, 30.0),
    "compression.exponent": (2.0, 4.0),
    "delay": (0.05, 0.4),
    "geometric_standard_deviation": (1.2, 1.8),
}
"""Range of each value of an effect; that of the delay in times of free fall."""


TRIED = [FLOCS, YIELDING, DELAY]
KINDS = [
    frozenset(truth)
    for truth in (
        (), (), (FLOCS,), (FLOCS,), (DELAY,), (DELAY,), (YIELDING,), (YIELDING,),
        (FLOCS, DELAY), (YIELDING, DELAY),
    )
]  # fmt: skip
"""Effects of the sets, in turn."""


class Set(NamedTuple):
    """A synthetic data set."""

    number: int
    truth: frozenset[Effect]
    gain: float
    """Expected gain of its weakest effect."""


def recipe() -> mrjax.Recipe:
    """The powder and its water."""
    return mrjax.Recipe(
        name="powder",
        particle={"density": 2600.0, "diameter": 10e-6},
        fluid={"density": 998.0, "viscosity": 1e-3},
        composition={"volume_fraction": FRACTION},
        drag={"f_w": {"closure": "richardson-zaki", "exponent": 4.65}, "local": True},
    )


@cache
def experiment() -> Experiment:
    """The tube with readings at stated times; their values are those of the plain model."""
    powder = recipe()
    fall = HEIGHT / float(mrjax.terminal_velocity(powder.parameters()))
    times = tuple(float(t) for t in fall * np.geomspace(FIRST, LAST, READINGS))
    readings = tuple(
        Measurement("mudline", 1e3 * HEIGHT, ERROR, "mm", 1e-3, place) for place in range(READINGS)
    )
    sample = Sample("A", powder, HEIGHT, None, readings, times=times)
    parameters = (
        FreeParameter("f_s", "f_s", ("A",), 1.0, 0.5),
        FreeParameter("bed_fraction", "bed_fraction", ("A",), 0.3, 0.5),
    )
    bare = Experiment("synthetic", (sample,), parameters)
    problem = Problem.prepare(bare, "column")
    predicted = np.asarray(problem.predict(problem.start))
    readings = tuple(
        reading._replace(value=float(value))
        for reading, value in zip(readings, predicted, strict=True)
    )
    return replace(bare, samples=(replace(sample, measurements=readings),))


@cache
def problems(effects: frozenset[Effect]) -> tuple[Problem, Problem]:
    """The problem with some effects, and the cheap one of its search, compiled once."""
    changed = with_effects(experiment(), effects)
    problem = Problem.prepare(changed, "column")
    quick = cheap_model(column, costly=bool(effects & {YIELDING, SIZES}))
    return problem, Problem.prepare(changed, quick)


def measured_by(problem: Problem, values: dict[str, float]) -> np.ndarray:
    """Readings without noise at some values of the quantities, (N,) in mm."""
    theta = OrderedDict(
        (one.variable, (v - one.bounds[0]) / (one.bounds[1] - v) if one.bounds else v)
        for one in problem.experiment.parameters
        for v in [values[one.name]]
    )
    return np.asarray(problem.predict(theta))


@cache
def _residuals(effects: frozenset[Effect]) -> tuple[Callable, Callable]:
    """Residuals of both problems as functions of the values, and of readings and their error."""

    def of(problem: Problem) -> Callable:
        def residuals(theta: OrderedDict, data: tuple) -> Array:
            readings, error = data
            return problem.residuals(theta, readings) * (ERROR / error)

        return residuals

    full, quick = map(of, problems(effects))
    return full, quick


def fitted(effects: frozenset[Effect], readings: np.ndarray, error: float) -> Candidate:
    """A model with some effects, fitted to readings, (N,) in mm, with a standard deviation."""
    (problem, quick), (residuals, quick_residuals) = problems(effects), _residuals(effects)
    data = readings, np.asarray(error)
    first, *rest = begin(quick, quick_residuals, 0, None, data).promising
    found = fit(
        residuals, first, also=rest, data=data, priors=problem.priors, bounds=problem.bounds
    )
    ordered = tuple(effect for effect in EFFECTS if effect in effects)
    return Candidate(ordered, problem, found, evidence(problem, found))


def _as_good(
    effects: frozenset[Effect], readings: np.ndarray, error: float, near: Candidate | None
) -> Candidate:
    """A fitted model; it starts again near a smaller one that fits better, as `compare` does."""
    candidate = fitted(effects, readings, error)
    if near is None or _is_no_worse(candidate, near):
        return candidate
    problem, _ = problems(effects)
    start = _begun_near(problem.experiment, near, effects).start
    found = fit(
        _residuals(effects)[0],
        start,
        data=(readings, np.asarray(error)),
        priors=problem.priors,
        bounds=problem.bounds,
    )
    other = replace(candidate, fit=found, evidence=evidence(problem, found))
    return min(candidate, other, key=lambda one: (not one.usable, one.evidence.deviance))


class Drawn(NamedTuple):
    """Readings of a set."""

    readings: np.ndarray
    """Heights with noise, mm, (N,)."""
    error: float
    """Standard deviation of the noise, mm."""
    gains: dict[str, float]
    """Expected gain of each effect in the data, by its name."""


def drawn(chosen: Set) -> Drawn:
    """Readings of a set, from the first values that are not hidden from any reading of a tube."""
    random = np.random.default_rng(chosen.number)
    problem, _ = problems(chosen.truth)
    error, gains = ERROR, dict[str, float]()
    for _ in range(TRIALS):
        exact = measured_by(problem, values(chosen, random))
        if not np.isfinite(exact).all():
            continue
        if not chosen.truth:
            break
        squares = _least_squares_without(chosen.truth, exact)
        error = (min(squares.values()) / chosen.gain) ** 0.5
        gains = {name: square / error**2 for name, square in squares.items()}
        if error > LEAST_ERROR:
            break
    return Drawn(exact + error * random.standard_normal(exact.size), error, gains)


def values(chosen: Set, random: np.random.Generator) -> dict[str, float]:
    """Values of all quantities, drawn from their ranges."""
    fall = experiment().samples[0].times[-1] / LAST
    drawn = {"f_s": np.exp(random.normal(0.0, 0.3)), "bed_fraction": random.uniform(0.2, 0.5)}
    for name, (low, high) in RANGES.items():
        drawn[name] = float(np.exp(random.uniform(np.log(low), np.log(high))))
    drawn["delay"] *= fall
    if FLOCS in chosen.truth:
        drawn["bed_fraction"] = min(drawn["bed_fraction"], 0.9 / drawn["f_w.floc_volume"])
    return drawn


def _least_squares_without(truth: frozenset[Effect], exact: np.ndarray) -> dict[str, float]:
    """Least sum of squared residuals, mm^2, of all models that lack an effect, by its name."""
    rivals = [
        frozenset(rival)
        for count in range(len(TRIED))
        for rival in combinations(TRIED, count)
        if combine(rival) and not truth <= set(rival)
    ]
    found = {rival: fitted(rival, exact, FINE) for rival in rivals}
    squares = {rival: one.evidence.deviance * FINE**2 for rival, one in found.items() if one.usable}
    return {
        effect.name: min(square for rival, square in squares.items() if effect not in rival)
        for effect in EFFECTS
        if effect in truth
    }


def verdicts(chosen: Set, tried: list[Effect]) -> dict[str, str]:
    """The verdict on each effect that is tried, by its name, and what the set was."""
    readings, error, gains = drawn(chosen)
    found = search(lambda effects, near: _as_good(effects, readings, error, near), tried)
    candidates = sorted(found.models.values(), key=lambda one: (not one.usable, one.evidence.bic))
    row = {
        "set": str(chosen.number),
        "truth": " + ".join(effect.name for effect in EFFECTS if effect in chosen.truth),
        "gains": " + ".join(f"{gains[one.name]:.1f}" for one in EFFECTS if one in chosen.truth),
        "error_mm": f"{error:.3g}",
        "best": candidates[0].name,
    }
    return row | {effect.name: _verdict(effect, candidates, None).word for effect in tried}


def the_set(number: int) -> Set:
    """The set of a number; every tenth one has the same effects."""
    truth = KINDS[number % len(KINDS)]
    random = np.random.default_rng([number, 1])
    return Set(number, truth, float(random.uniform(LEAST_GAIN, MOST_GAIN)))


def append(row: dict[str, str]) -> None:
    """Writes one more row of verdicts."""
    new = not FILE.exists()
    with FILE.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)
