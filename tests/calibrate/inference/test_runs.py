"""The runs test: its probabilities by counting all orders, and what a fit says of a wrong shape."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.sample import Concentration, Measurement, Point, Scatter
from calibrate.inference.runs import as_few_runs, runs_tests


@pytest.mark.parametrize("positive, negative", [(1, 1), (2, 3), (4, 4), (1, 6), (5, 3)])
def test_probabilities_are_those_of_all_orders(positive, negative):
    total = positive + negative
    counts = []
    for places in combinations(range(total), positive):
        signs = np.full(total, -1)
        signs[list(places)] = 1
        counts.append(1 + np.count_nonzero(np.diff(signs)))
    for runs in range(1, total + 1):
        share = np.mean(np.array(counts) <= runs)
        assert as_few_runs(positive, negative, runs) == pytest.approx(share, rel=1e-12)


def test_residuals_of_one_sign_have_nothing_to_compare():
    assert as_few_runs(5, 0, 1) == 1.0 and as_few_runs(0, 0, 0) == 1.0


def test_readings_are_taken_in_the_order_of_their_concentration():
    """Signs + + - - by concentration, in a file in another order; what has an error is left."""

    def velocity(place):
        at = Concentration(0.1 * place, "volume fraction", 0.1 * place, place)
        return Measurement("initial_velocity", 1.0, 0.1, "m/s", 1.0, concentration=at)

    measurements = (Measurement("final_ratio", 0.5, 0.1, "1", 1.0), *map(velocity, (2, 0, 3, 1)))
    scatter = Scatter(0.1, 2.0, "fit")
    sample = SimpleNamespace(
        name="A", measurements=measurements, curve=None, scatter=scatter, concentrations=()
    )
    problem = SimpleNamespace(experiment=Experiment("mine", (sample,), ()))
    fit = SimpleNamespace(residuals=np.array([9.0, -1.0, 1.0, -1.0, 1.0]))
    (found,) = runs_tests(problem, fit)
    assert (found.sample, found.observable, found.readings) == ("A", "initial_velocity", 4)
    assert (found.runs, found.p_value) == (2, pytest.approx(2.0 / 6.0))
    empty = SimpleNamespace(name="A", measurements=(), curve=None, scatter=None, concentrations=())
    nothing = SimpleNamespace(experiment=Experiment("mine", (empty,), ()))
    assert runs_tests(nothing, fit) == []


def test_each_table_of_local_concentrations_has_its_runs():
    """Two tables, read one after the other; the second states its errors."""

    def reading(number, table):
        at = Point(0.1, float(number), 0.01, number, table, "m", "s")
        return Measurement("volume_fraction", 0.3, 0.1, "1", 1.0, point=at)

    tables = [SimpleNamespace(name="low", scatter=Scatter(0.1, 3.0, "fit"))]
    tables.append(SimpleNamespace(name="high", scatter=None))
    measurements = tuple(reading(place, "low" if place < 4 else "high") for place in range(6))
    sample = SimpleNamespace(
        name="A", measurements=measurements, curve=None, scatter=None, concentrations=tables
    )
    problem = SimpleNamespace(experiment=Experiment("mine", (sample,), ()))
    fit = SimpleNamespace(residuals=np.array([-1.0, -1.0, 1.0, 1.0, -1.0, 1.0]))
    (found,) = runs_tests(problem, fit)
    assert (found.sample, found.observable, found.readings, found.runs) == ("A", "low", 4, 2)
