"""Synthetic problems, fitted, beside their references: a line for each value of each."""

import csv
import tempfile
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibrate.inference.identify import Identification, identify
from calibrate.inference.profile import profiles
from calibrate.least_squares.fit import Fit, fit
from calibrate.problem.beginnings import begin
from calibrate.problem.problem import Problem

from .designs import Design, designs, experiment
from .reference import Reference, reference

DESIGNS, EACH = 25, 20
"""Designs, and problems of each."""
SEED = 5
FILE = Path(__file__).parent / "problems.csv"


def measured(numbers: range, each: int = EACH) -> list[dict]:
    """Lines for so many problems of each of the numbered designs."""
    rows = []
    every = designs(DESIGNS, SEED)
    for number in numbers:
        design = every[number]
        with tempfile.TemporaryDirectory() as folder:
            loaded = experiment(design, Path(folder))
        problem = Problem.prepare(loaded, design.model)
        cheap = problem if problem.everywhere else Problem.prepare(loaded, "closed-form")
        rows += _of_design(number, design, problem, cheap, each)
    return rows


def _of_design(
    number: int, design: Design, problem: Problem, cheap: Problem, each: int
) -> list[dict]:
    """Lines for the problems of one design, which share their compiled programs."""
    by_reference, rows = reference(problem), []
    residuals = problem.residuals, cheap.residuals
    for place in range(each):
        random = np.random.default_rng([SEED, number, place])
        truth, data = _drawn(problem, by_reference, random)
        found = _fitted(problem, cheap, residuals, data)
        known = {
            "design": number,
            "what": design.name,
            "problem": place,
            "converged": int(found.converged),
            "optima": len(found.optima),
            "objective": by_reference.objective(np.log(found.values), data),
            "best": by_reference.best(data, truth, random),
            "of_truth": by_reference.objective(truth, data),
        }
        errors, optimum = by_reference.data_errors(data)
        beside = np.abs(np.log(found.values) - optimum) <= np.maximum(errors, 1e-6)
        values = _of_values(found, identify(found), truth, errors)
        rows += [
            known | one | {"beside": int(near)} for one, near in zip(values, beside, strict=True)
        ]
    return rows


def _drawn(
    problem: Problem, by_reference: Reference, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms from the priors that can be, (P,), and readings, (M,)."""
    while True:
        truth = by_reference.middle + by_reference.width * random.standard_normal(
            by_reference.width.size
        )
        exact = np.asarray(by_reference.predict(truth))
        inside = (truth > by_reference.lower) & (truth < by_reference.upper)
        if np.isfinite(exact).all() and inside.all():
            return truth, exact + problem.errors * random.standard_normal(exact.size)


def _fitted(
    problem: Problem, cheap: Problem, residuals: tuple[Callable, Callable], data: np.ndarray
) -> Fit:
    """As `fit_experiment` fits, with readings as data, so that problems share their programs.

    Args:
      problem, cheap: the model, and that of searches.
      residuals: those of both, the same objects for all problems.
      data: readings, (M,).
    """
    places = iter(data)
    samples = tuple(
        replace(
            sample,
            measurements=tuple(
                one._replace(value=float(next(places))) for one in sample.measurements
            ),
        )
        for sample in problem.experiment.samples
    )
    read = replace(cheap, experiment=replace(problem.experiment, samples=samples))
    first, *also = begin(read, residuals[1], 0, data=data).promising
    common = dict(data=data, priors=problem.priors, bounds=problem.bounds)
    return fit(residuals[0], OrderedDict(first), also=also, **common)


def _of_values(
    found: Fit, said: Identification, truth: np.ndarray, errors: np.ndarray
) -> list[dict]:
    """A line for each value."""
    intervals = {one.name: one.intervals for one in profiles(found)} if found.converged else {}
    rows = []
    for place, name in enumerate(found.names):
        width = 1.0 / found.prior_precision[place] ** 0.5
        row = {
            "parameter": name,
            "status": said.status[name],
            "said": said.data_standard_errors[name] / width,
            "exact": errors[place] / width,
        }
        for coverage in ("68 %", "95 %"):
            low, high = intervals.get(name, {}).get(coverage, (np.nan, np.nan))
            row[coverage] = int(low <= np.exp(truth[place]) <= high)
        rows.append(row)
    return rows


def write(rows: list[dict], file: Path = FILE) -> None:
    """Keeps the lines, to four digits."""
    with file.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {key: f"{x:.4g}" if isinstance(x, float) else x for key, x in row.items()}
            for row in rows
        )


def known(file: Path = FILE) -> list[dict]:
    """The lines that were measured last, as numbers where they are."""
    numbers = ("objective", "best", "of_truth", "said", "exact")
    with file.open(encoding="utf-8", newline="") as lines:
        return [
            {key: float(x) if key in numbers else x for key, x in row.items()}
            for row in csv.DictReader(lines)
        ]
