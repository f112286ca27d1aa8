"""How often stated intervals hold the truth: fits to synthetic data sets with noise.

The truth of each set is drawn from the priors of the experiment, and the data from the model at
that truth with the stated errors. Of N sets the share whose 68 % interval holds the truth is then
68 %, but for chance.
"""

import csv
from collections import OrderedDict
from pathlib import Path

import numpy as np
from scipy.stats import binom
from tqdm import tqdm

from calibrate.data import Experiment
from calibrate.fit import fit
from calibrate.profile import LEVELS, profiles
from calibrate.residuals import Problem

SETS = {
    ("fang2005", "closed-form"): 200,
    ("synthetic", "column"): 200,
    ("fang2005", "particles"): 40,
}
"""Number of data sets, by experiment and model."""
FILE = Path(__file__).parent / "coverage.csv"
CHANCE = 0.01
"""Of a share outside its limits where the intervals are right."""


def measured(experiment: str, model: str, sets: int, seed: int = 0) -> list[dict]:
    """A line for each data set and parameter: whether its intervals hold the truth."""
    problem = Problem.prepare(Experiment.load(experiment), model)
    random = np.random.default_rng(seed)
    errors = np.array([one.standard_deviation for _, one in problem.measurements])
    rows = []
    for number in tqdm(range(sets), desc=f"{experiment}, {model}"):
        truth = OrderedDict(
            (name, prior.median * np.exp(prior.log_standard_deviation * random.standard_normal()))
            for name, prior in problem.priors.items()
        )
        data = np.asarray(problem.predict(truth)) + errors * random.standard_normal(errors.size)
        found = fit(problem.residuals, problem.start, priors=problem.priors, data=data)
        for profile in profiles(found):
            held = {
                coverage: int(ends[0] <= truth[profile.name] <= ends[1])
                for coverage, ends in profile.intervals.items()
            }
            rows.append(
                {
                    "experiment": experiment,
                    "model": model,
                    "set": number,
                    "converged": int(found.converged),
                    "model_runs": found.model_runs,
                    "parameter": profile.name,
                    **held,
                }
            )
    return rows


def limits(sets: int, coverage: str) -> tuple[int, int]:
    """Fewest and most sets of N whose intervals hold the truth, but for `CHANCE`."""
    share = float(coverage.removesuffix(" %")) / 100
    low, high = binom.ppf([CHANCE / 2, 1 - CHANCE / 2], sets, share)
    return int(low), int(high)


def held(rows: list[dict]) -> dict[tuple, dict]:
    """Sets, and how many of them hold the truth, by experiment, model and parameter."""
    found: dict[tuple, dict] = {}
    for row in rows:
        key = (row["experiment"], row["model"], row["parameter"])
        one = found.setdefault(
            key, {"sets": 0, "converged": 0, "runs": [], **dict.fromkeys(LEVELS, 0)}
        )
        one["sets"] += 1
        one["converged"] += int(row["converged"])
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
