"""The runs test (Wald & Wolfowitz 1940), which compares the signs of residuals with those of noise.

Readings without a stated error have no p-value of chi-squared, since their scatter comes from the
same residuals. The runs test still detects a model that misses the shape of the data: its residuals
have long runs of one sign, in the order of time, concentration or height.
"""

from math import comb
from typing import NamedTuple

import numpy as np

from calibrate.experiment.sample import Sample
from calibrate.experiment.simulator import SimulatedExperiment
from calibrate.least_squares.fit import Fit
from calibrate.problem.problem import Problem

TOO_FEW_BELOW = 0.01
"""p-value below which the runs are too few for noise."""


class RunsTest(NamedTuple):
    """The runs test of the readings of one file."""

    sample: str | None
    """Name of the sample; None for a simulator."""
    observable: str
    """Name of the measured quantity."""
    readings: int
    """Number of readings."""
    runs: int
    """Number of runs: successive residuals of one sign."""
    p_value: float
    """Probability that noise has at most as many runs."""


def runs_tests(problem: Problem, fit: Fit) -> list[RunsTest]:
    """The runs test of each file whose readings have no stated error."""
    if isinstance(problem.experiment, SimulatedExperiment):
        return _simulator_test(problem.experiment, fit)
    return [
        _test(sample.name, observable, fit.residuals[of_sample][places])
        for sample, of_sample in problem.experiment.by_sample()
        for observable, places in _files_without_errors(sample)
    ]


def _simulator_test(experiment: SimulatedExperiment, fit: Fit) -> list[RunsTest]:
    """The runs test of a simulator's readings, if they have an order and no stated error."""
    simulator = experiment.simulator
    if experiment.errors == "stated" or simulator.labels is not None:
        return []
    order = np.arange(fit.residuals.size)
    if simulator.at is not None:
        order = np.argsort(np.asarray(simulator.at), kind="stable")
    return [_test(None, simulator.quantity, fit.residuals[order])]


def _test(sample: str | None, observable: str, residuals: np.ndarray) -> RunsTest:
    """The runs test of residuals in their order, (N,)."""
    signs = np.sign(residuals)
    signs = signs[signs != 0.0]
    runs = int(np.count_nonzero(np.diff(signs))) + bool(signs.size)
    chance = as_few_runs(int(np.sum(signs > 0)), int(np.sum(signs < 0)), runs)
    return RunsTest(sample, observable, residuals.size, runs, chance)


def _files_without_errors(sample: Sample) -> list[tuple[str, list[int]]]:
    """Observable and indices of readings by file, sorted by time, concentration or height."""
    files = []
    measurements = list(enumerate(sample.measurements))
    if sample.curve is not None and sample.curve.errors == "estimated":
        of_curve = [
            (measurement.place, place)
            for place, measurement in measurements
            if measurement.place is not None
        ]
        files.append((sample.curve.observable, [place for _, place in sorted(of_curve)]))
    if sample.scatter is not None:
        of_table = [
            (measurement.concentration.place, place)
            for place, measurement in measurements
            if measurement.concentration is not None
        ]
        files.append(("initial_velocity", [place for _, place in sorted(of_table)]))
    for table in sample.concentrations:
        if table.scatter is not None:  # their readings are in the order of time or height
            points = (
                (place, measurement.point)
                for place, measurement in measurements
                if measurement.point is not None
            )
            files.append(
                (table.name, [place for place, point in points if point.table == table.name])
            )
    return files


def as_few_runs(positive: int, negative: int, runs: int) -> float:
    """Exact probability of at most this many runs, if all orders of the signs are equally likely.

    Of the C(m+n, m) orders of m positive and n negative signs, 2 C(m-1, k-1) C(n-1, k-1) have 2 k
    runs, and C(m-1, k) C(n-1, k-1) + C(m-1, k-1) C(n-1, k) have 2 k + 1 runs.
    """
    m, n = positive, negative
    if not m or not n:
        return 1.0
    orders = 0
    for number in range(2, runs + 1):
        k, odd = divmod(number, 2)
        if odd:
            orders += comb(m - 1, k) * comb(n - 1, k - 1) + comb(m - 1, k - 1) * comb(n - 1, k)
        else:
            orders += 2 * comb(m - 1, k - 1) * comb(n - 1, k - 1)
    return orders / comb(m + n, m)
