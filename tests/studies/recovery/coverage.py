"""How often stated intervals hold the truth: fits to synthetic data sets with noise.

The truth of each set is drawn from the priors of the experiment, and the data from the model at
that truth with the stated errors. Of N sets the share whose 68 % interval holds the truth is then
68 %, but for chance.
"""

import csv
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import binom
from tqdm import tqdm

from calibrate.experiment.experiment import Experiment
from calibrate.inference.identify import identify
from calibrate.inference.profile import LEVELS, profiles
from calibrate.least_squares.fit import Fit, fit
from calibrate.problem.problem import Problem

PROFILE, CURVATURE = "profile", "curvature"
SETS = {
    ("fang2005", "closed-form", PROFILE): 200,
    ("synthetic", "column", CURVATURE): 200,
    ("fang2005", "particles", CURVATURE): 60,
}
"""Number of data sets, by experiment, model and how intervals are found: by profile likelihood, or
as standard errors from the curvature at the optimum, which takes a tenth of the time."""
FILE = Path(__file__).parent / "coverage.csv"
CHANCE = 0.01
"""Of a share outside its limits where the intervals are right."""


def measured(experiment: str, model: str, by: str, sets: Sequence[int]) -> list[dict]:
    """A line for each of the numbered data sets, each with random numbers of its own, and each
    parameter: whether its intervals hold the truth.
    """
    problem = Problem.prepare(Experiment.load(experiment), model)
    errors = np.array([one.standard_deviation for _, one in problem.measurements])
    rows = []
    for number in tqdm(sets, desc=f"{experiment}, {model}"):
        random = np.random.default_rng(number)
        truth, exact = _drawn(problem, random)
        data = exact + errors * random.standard_normal(errors.size)
        found = fit(
            problem.residuals,
            problem.start,
            priors=problem.priors,
            bounds=problem.bounds,
            data=data,
        )
        for name, intervals in _intervals(found, by).items():
            rows.append(
                {
                    "experiment": experiment,
                    "model": model,
                    "by": by,
                    "set": number,
                    "converged": int(found.converged),
                    "on_a_kink": int(found.on_a_kink),
                    "model_runs": found.model_runs,
                    "parameter": name,
                    **{
                        coverage: int(low <= truth[name] <= high)
                        for coverage, (low, high) in intervals.items()
                    },
                }
            )
    return rows


def _drawn(
    problem: Problem, random: np.random.Generator
) -> tuple[OrderedDict[str, float], np.ndarray]:
    """Values from the priors, and what they predict, (M,); of samples that can be.

    A bed is denser than its suspension.
    """
    while True:
        truth = OrderedDict(
            (name, prior.median * np.exp(prior.log_standard_deviation * random.standard_normal()))
            for name, prior in problem.priors.items()
        )
        exact = np.asarray(problem.predict(truth))
        if np.isfinite(exact).all():
            return truth, exact


def _intervals(found: Fit, by: str) -> dict[str, dict[str, tuple[float, float]]]:
    """By parameter and coverage."""
    if by == PROFILE:
        return {one.name: one.intervals for one in profiles(found)}
    errors = identify(found).standard_errors
    return {
        name: {
            coverage: (value - level**0.5 * errors[name], value + level**0.5 * errors[name])
            for coverage, level in LEVELS.items()
        }
        for name, value in zip(found.names, found.values, strict=True)
    }


def limits(sets: int, coverage: str) -> tuple[int, int]:
    """Fewest and most sets of N whose intervals hold the truth, but for `CHANCE`."""
    share = float(coverage.removesuffix(" %")) / 100
    low, high = binom.ppf([CHANCE / 2, 1 - CHANCE / 2], sets, share)
    return int(low), int(high)


def held(rows: list[dict]) -> dict[tuple, dict]:
    """Sets, and how many of them hold the truth, by experiment, model, intervals and parameter."""
    found: dict[tuple, dict] = {}
    for row in rows:
        key = (row["experiment"], row["model"], row["by"], row["parameter"])
        one = found.setdefault(
            key,
            {"sets": 0, "converged": 0, "on_a_kink": 0, "runs": [], **dict.fromkeys(LEVELS, 0)},
        )
        one["sets"] += 1
        one["converged"] += int(row["converged"])
        one["on_a_kink"] += int(row["on_a_kink"])
        one["runs"].append(int(row["model_runs"]))
        for coverage in LEVELS:
            one[coverage] += int(row[coverage])
    return found


def known() -> list[dict]:
    """The lines that were measured last."""
    with FILE.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def write(rows: list[dict]) -> None:
    """Keeps the lines."""
    with FILE.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
