"""A fit prepared again where it leads far, and what the models are asked near; by fakes."""

from collections import OrderedDict
from types import SimpleNamespace

import numpy as np
import pytest

import mrjax
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement, Sample
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.optima import Optimum
from calibrate.problem import solve
from calibrate.problem.beginnings import Beginnings
from calibrate.problem.problem import Problem

VELOCITY = Measurement("initial_velocity", 8.0, 0.5, "m/s", 1.0)


@pytest.fixture
def experiment(case2) -> Experiment:
    sample = Sample("A", case2, 0.1, None, (VELOCITY,))
    return Experiment("mine", (sample,), (FreeParameter("f_s", "f_s", ("A",), 1.0, 0.3),))


@pytest.mark.parametrize("factor, holds", [(2.9, True), (3.1, False), (0.35, True), (0.3, False)])
def test_a_model_holds_within_a_factor_of_three_of_its_velocity(experiment, factor, holds):
    problem = Problem(experiment, (), OrderedDict(f_s=1.0), everywhere=False)
    assert problem.holds_at({"f_s": factor}) == holds
    assert Problem(experiment, (), OrderedDict(f_s=1.0), everywhere=True).holds_at({"f_s": factor})


def test_residuals_are_differences_in_standard_deviations(experiment):
    models = (lambda suspension: {"initial_velocity": 9.0 * suspension.parameters.f_s},)
    problem = Problem(experiment, models, OrderedDict(f_s=1.0), everywhere=True)
    assert float(problem.residuals({"f_s": 1.0})[0]) == pytest.approx(2.0)
    assert float(problem.residuals({"f_s": 1.0}, np.array([10.0]))[0]) == pytest.approx(-2.0)


def ended(value, runs, converged=True):
    theta = OrderedDict(f_s=value)
    numbers = np.array([value])
    return Fit(theta, ("f_s",), numbers, numbers, numbers[None], numbers, numbers, converged, False,
               runs, None, None, None, optima=(optimum_of(value),))  # fmt: skip


def optimum_of(value, finished=True):
    return Optimum(np.array([value]), value, value, finished)


@pytest.fixture
def searches(monkeypatch):
    """Fits end where a list says; what each was asked is kept."""
    ends, calls, others, also_asked = [], [], [], []
    promising = [OrderedDict(f_s=1.0)]

    def prepare(experiment, model, seed, near, folder):
        calls.append((model, near["f_s"], folder))
        return Problem(experiment, (), near, everywhere=model == "closed-form")

    def fit(residuals, start, *, starts, also, **_):
        calls[-1] += (starts,)
        also_asked.append([theta["f_s"] for theta in also])
        return ends.pop(0)

    def begun(*_):
        return Beginnings(promising, list(others), 65)

    monkeypatch.setattr(solve, "beginnings", begun)
    monkeypatch.setattr(Problem, "prepare", prepare)
    monkeypatch.setattr(solve, "fit", fit)
    return SimpleNamespace(
        ends=ends, calls=calls, promising=promising, others=others, also=also_asked
    )


def test_a_model_is_prepared_again_where_a_fit_leads_far(experiment, searches, tmp_path):
    searches.ends += [ended(4.0, 10), ended(5.0, 7)]
    problem, found = solve.fit_experiment(experiment, "column", starts=8, checkpoint=tmp_path)
    assert searches.calls == [
        ("column", 1.0, tmp_path / "prepared-0", 8),
        ("column", 4.0, tmp_path / "prepared-1", 1),
    ]
    assert (found.model_runs, found.converged, problem.near["f_s"]) == (17, True, 4.0)


def test_a_fit_that_leads_on_and_on_has_not_converged(experiment, searches):
    searches.ends += [ended(4.0**number, 1) for number in range(1, 9)]
    _, found = solve.fit_experiment(experiment, "column")
    assert (len(searches.calls), found.model_runs, found.converged) == (4, 4, False)


def test_a_fit_begins_where_a_cheaper_model_ends(experiment, searches, tmp_path):
    searches.ends += [ended(2.0, 30), ended(2.1, 5)]
    _, found = solve.fit_experiment(
        experiment, "column", begin_with="closed-form", starts=8, checkpoint=tmp_path
    )
    assert searches.calls == [
        ("closed-form", 1.0, tmp_path / "begin-with" / "prepared-0", 8),
        ("column", 2.0, tmp_path / "prepared-0", 1),
    ]
    assert found.model_runs == 5


def test_a_cheaper_model_that_did_not_converge_begins_nothing(experiment, searches):
    searches.ends += [ended(2.0, 30, converged=False)]
    with pytest.raises(mrjax.SimulationError, match="the cheaper model did not converge"):
        solve.fit_experiment(experiment, "column", begin_with="closed-form")


def test_a_fit_begins_at_the_promising_where_its_model_holds_and_tells_the_others(
    experiment, searches
):
    """2.9 times slower the model holds, 3.1 times it does not; 1.2 is the optimum of 1 again."""
    searches.promising += [OrderedDict(f_s=2.9), OrderedDict(f_s=3.1)]
    searches.others += [optimum_of(90.0, False), optimum_of(40.0, False), optimum_of(1.2, False)]
    searches.ends += [ended(1.0, 10)]
    _, found = solve.fit_experiment(experiment, "column", starts=2)
    assert searches.also == [[2.9]]
    assert [one.values[0] for one in found.optima] == [1.0, 40.0, 90.0]
    assert found.places == 67


def test_optima_of_an_earlier_preparation_are_told_too(experiment, searches):
    first = ended(4.0, 10)
    searches.ends += [
        Fit(**{**vars(first), "optima": (optimum_of(4.0), optimum_of(30.0))}),
        ended(5.0, 7),
    ]
    _, found = solve.fit_experiment(experiment, "column")
    assert [one.values[0] for one in found.optima] == [5.0, 30.0]
