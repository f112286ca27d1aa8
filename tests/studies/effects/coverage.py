"""How often fits of the true model cover the values that are in the data.

Twice the rise of the loss from the fit to the true values follows chi-squared, with as many degrees
of freedom as there are values (Wilks 1938). That holds where readings leave several optima, too, as
far as their likelihoods differ; standard errors do not.
"""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from tests.studies.effects import synthetic
from tests.studies.effects.synthetic import Set

FILE = Path(__file__).parent / "coverage.csv"


class Rise(NamedTuple):
    """The rise of chi-squared, priors included, from a fit to the true values of a set."""

    number: int
    values: int
    """Number of fitted values."""
    rise: float

    def within(self, probability: float) -> bool:
        """True if the true values are in the joint region of this probability about the fit."""
        return self.rise < chi2.ppf(probability, self.values)


def rise(chosen: Set, error: float) -> Rise:
    """The rise for a set, with its first values that can be predicted.

    Args:
      chosen: the set.
      error: standard deviation of the noise, mm.
    """
    random = np.random.default_rng(chosen.number)
    problem, _ = synthetic.problems(chosen.truth)
    for _ in range(synthetic.TRIALS):
        values = synthetic.values(chosen, random)
        exact = synthetic.measured_by(problem, values)
        if np.isfinite(exact).all():
            break
    readings = exact + error * random.standard_normal(exact.size)
    fit = synthetic.fitted(chosen.truth, readings, error).fit
    true = np.log([values[name] for name in fit.names])
    return Rise(chosen.number, true.size, 2.0 * (fit.at(true).loss - float(fit.loss[-1])))


def append(found: Rise) -> None:
    """Writes one more row."""
    new = not FILE.exists()
    with FILE.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(Rise._fields)
        writer.writerow([*found[:2], f"{found.rise:.3f}"])


def measured() -> list[Rise]:
    """The rows of `coverage.csv`, none before the first."""
    if not FILE.exists():
        return []
    with FILE.open(encoding="utf-8") as file:
        return [
            Rise(int(row["number"]), int(row["values"]), float(row["rise"]))
            for row in csv.DictReader(file)
        ]
