"""A comparison of models: evidence, verdicts, the readings that would decide, the command."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import calibrate
import calibrate.__main__
import mrjax
from calibrate.comparison import compare as comparing
from calibrate.comparison.compare import (
    ASKED_FOR,
    NOT_NEEDED,
    NOT_TRIED,
    UNDECIDED,
    _verdict,
    compare,
)
from calibrate.comparison.deciding import deciding_readings
from calibrate.comparison.effects import (
    DELAY_AT_START,
    EFFECTS,
    FLOCS,
    SIZES,
    YIELDING_BED,
    with_effects,
)
from calibrate.comparison.evidence import Evidence, _unsettled, evidence
from calibrate.comparison.nested import Candidate, search
from calibrate.comparison.tables import in_words, markdown, tables
from calibrate.experiment.sample import Scatter
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.levenberg import Point, minimise
from calibrate.problem.problem import Problem
from tests.builders.result_keys import documented
from tests.calibrate.comparison.test_effects import FALL, experiment

FREE = Bounds(np.array([-np.inf]), np.array([np.inf]))
DELAYED = {"f_s": 1.1, "bed_fraction[A]": 0.3, "delay": 0.1 * FALL}


def candidate(effects, bic, left_out, usable=True, unsettled=1e3):
    found = Evidence(0.0, 0.0, 0, bic, np.array([left_out - 0.5, 0.5]), np.zeros(2), unsettled)
    return Candidate(tuple(effects), None, SimpleNamespace(converged=usable), found)


def verdict(effect, *candidates):
    return _verdict(
        effect, sorted(candidates, key=lambda one: (not one.usable, one.evidence.bic)), None
    )


PLAIN = candidate([], 100.0, 90.0)


def test_an_effect_is_asked_for_if_all_models_without_it_are_clearly_worse():
    delay = candidate([DELAY_AT_START], 80.0, 70.0)
    found = verdict(DELAY_AT_START, PLAIN, delay)
    assert (found.word, found.gain, found.left_out_gain) == (ASKED_FOR, 20.0, 20.0)
    assert verdict(FLOCS, PLAIN, delay, candidate([FLOCS], 102.0, 92.0)).word == NOT_NEEDED
    assert verdict(SIZES, PLAIN, candidate([SIZES], 50.0, 50.0, usable=False)).word == NOT_TRIED


def test_a_model_that_did_not_converge_leaves_others_undecided():
    lost = candidate([FLOCS], 300.0, 300.0, usable=False)
    found = verdict(DELAY_AT_START, PLAIN, candidate([DELAY_AT_START], 80.0, 70.0), lost)
    assert found.word == UNDECIDED
    assert "flocs did not converge" in found.reason and found.unfitted == "flocs"


def test_a_fit_that_did_not_converge_counts_as_far_as_it_may_still_go():
    delay = candidate([DELAY_AT_START], 80.0, 70.0)
    hopeless = candidate([FLOCS], 300.0, 300.0, usable=False, unsettled=1.0)
    assert verdict(DELAY_AT_START, PLAIN, delay, hopeless).word == ASKED_FOR
    at_its_end = candidate([FLOCS], 300.0, 300.0, usable=False, unsettled=0.01)
    assert at_its_end.usable
    assert verdict(FLOCS, PLAIN, delay, at_its_end).word == NOT_NEEDED
    both = candidate([FLOCS, DELAY_AT_START], 70.0, 60.0, usable=False)
    assert verdict(FLOCS, PLAIN, delay, at_its_end, both).word == UNDECIDED


def test_two_effects_that_explain_the_same_are_both_undecided():
    models = PLAIN, candidate([DELAY_AT_START], 80.0, 70.0), candidate([FLOCS], 81.0, 71.0)
    assert verdict(DELAY_AT_START, *models).word == UNDECIDED
    found = verdict(FLOCS, *models)
    assert found.word == UNDECIDED
    assert "flocs explains the readings nearly as well as delay" in found.reason


def test_a_small_gain_and_one_that_readings_left_out_do_not_confirm_are_undecided():
    assert verdict(FLOCS, PLAIN, candidate([FLOCS], 98.0, 80.0)).word == UNDECIDED
    assert verdict(FLOCS, PLAIN, candidate([FLOCS], 80.0, 91.0)).word == UNDECIDED


MADE_UP = {
    (): 584.0,
    (YIELDING_BED,): 80.0,
    (DELAY_AT_START,): 118.0,
    (FLOCS,): 494.0,
    (FLOCS, DELAY_AT_START): 21.0,
    (FLOCS, YIELDING_BED): 79.9,
    (YIELDING_BED, DELAY_AT_START): 57.0,
    (FLOCS, YIELDING_BED, DELAY_AT_START): 20.0,
}
"""Chi-squared of 24 readings: a yielding bed is the best single effect, two others are true."""


def test_the_search_finds_two_effects_behind_a_better_single_one():
    problem = SimpleNamespace(experiment=replace(experiment(), parameters=()))

    def fit_model(effects, near):
        ordered = tuple(effect for effect in EFFECTS if effect in effects)
        squares, count = MADE_UP[ordered], 2 + len(ordered)
        residuals = np.full(24, (squares / 24) ** 0.5)
        names = tuple("f_s" for _ in range(count))
        fit = SimpleNamespace(residuals=residuals, names=names, values=np.ones(0), converged=True)
        fit.chi_squared = squares
        found = Evidence(squares, 0.0, count, 0.0, residuals**2, residuals, 0.0)
        return Candidate(ordered, problem, fit, found)

    found = search(fit_model, [FLOCS, YIELDING_BED, DELAY_AT_START])
    assert frozenset([FLOCS, DELAY_AT_START]) in found.models
    assert found.error_scale == pytest.approx((21.0 / 20.0) ** 0.5)


def test_a_reading_with_most_of_the_say_is_left_out_by_a_new_fit():
    """r(x) = x^2 - 4 of one reading, and x - 1 of another: without the first, x = 1 and r = -3."""

    def at(logs):
        x = np.exp(logs[0])
        value, slopes = np.array([x**2 - 4.0, 0.1 * (x - 1.0)]), np.array([2 * x**2, 0.1 * x])
        return Point(0.5 * value @ value, logs, slopes[:, None], value)

    (end,), _ = minimise(lambda places: list(map(at, places)), [at(np.zeros(1))], FREE, 30)
    fit = SimpleNamespace(
        at=at,
        box=FREE,
        residuals=end.value,
        jacobian=end.jacobian,
        prior_precision=np.zeros(1),
        values=np.exp(end.logs),
        names=("f_s",),
        chi_squared=2.0 * end.loss,
    )
    found = evidence(SimpleNamespace(experiment=experiment()), fit)
    assert found.left_out_residuals[0] == pytest.approx(-3.0, abs=1e-3)
    leverage = end.jacobian[1, 0] ** 2 / np.sum(end.jacobian**2)
    assert found.left_out_residuals[1] == pytest.approx(end.value[1] / (1.0 - leverage), rel=1e-12)
    assert found.unsettled < 1e-6


@pytest.mark.parametrize("true_slope, unsettled", [(1.0, 25.0), (-1.0, 0.0)])
def test_what_a_fit_may_still_gain_is_what_steps_bring(true_slope, unsettled):
    """r = 5 + s ln x, with the slope 1 as stated: one step of -5 removes 25, or makes it worse."""

    def at(logs):
        value = np.array([5.0 + true_slope * logs[0]])
        return Point(0.5 * value @ value, logs, np.ones((1, 1)), value)

    fit = SimpleNamespace(at=at, box=FREE, values=np.ones(1))
    assert _unsettled(fit) == pytest.approx(unsettled, abs=1e-9)


def test_evidence_of_stated_and_of_estimated_errors():
    """A linear model with known numbers: chi-squared, N ln(sum r^2 / N), leverages."""
    bare = experiment()
    problem = SimpleNamespace(experiment=bare)
    residuals = np.array([1.0, -2.0, 0.5, 0.0, 1.0, -1.0])
    jacobian = np.ones((6, 1))
    fit = SimpleNamespace(
        residuals=residuals,
        jacobian=jacobian,
        prior_precision=np.array([4.0]),
        values=np.array([np.exp(0.5)]),
        names=("f_s",),
        chi_squared=float(residuals @ residuals),
        box=FREE,
        at=lambda logs: Point(0.0, logs, jacobian, residuals),
    )
    squares, of_prior, penalty = 7.25, (0.5 / 0.5) ** 2, np.log(6.0)
    stated = evidence(problem, fit)
    assert stated.deviance == pytest.approx(squares + of_prior, rel=1e-12)
    assert stated.bic == pytest.approx(squares + of_prior + penalty, rel=1e-12)
    assert stated.left_out == pytest.approx((residuals / 0.9) ** 2, rel=1e-12)  # h = 1 / (6 + 4)
    assert evidence(problem, fit, 2.0).deviance == pytest.approx(
        squares / 4.0 + of_prior, rel=1e-12
    )

    (sample,) = bare.samples
    scatter = Scatter(2.0, 5.0, "fit")
    problem.experiment = replace(bare, samples=(replace(sample, curve_scatter=scatter),))
    estimated = evidence(problem, fit)
    likelihood = 6.0 * np.log(squares / 6.0 * 2.0**2)
    assert estimated.deviance == pytest.approx(likelihood + of_prior, rel=1e-12)


@pytest.fixture(scope="module")
def delayed():
    """A tube whose readings have a delay, and its comparison of plain, flocs and delay."""
    bare = experiment()
    problem = Problem.prepare(with_effects(bare, [DELAY_AT_START]), "column")
    predicted = np.asarray(problem.predict(DELAYED))
    (sample,) = bare.samples
    noise = np.random.default_rng(3).standard_normal(predicted.size)
    readings = tuple(
        one._replace(value=float(value))
        for one, value in zip(sample.measurements, predicted + 0.5 * noise, strict=True)
    )
    exact = replace(bare, samples=(replace(sample, measurements=readings),))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(comparing, "EFFECTS", (FLOCS, DELAY_AT_START))
        return compare(exact)


def test_a_delay_is_found_and_flocs_are_not(delayed):
    words = {found.effect.name: found.word for found in delayed.verdicts}
    assert words == {"flocs": NOT_NEEDED, "delay": ASKED_FOR}
    assert delayed.best.effects == (DELAY_AT_START,)
    fitted = dict(zip(delayed.best.fit.names, delayed.best.fit.values, strict=True))
    assert fitted["delay"] == pytest.approx(DELAYED["delay"], rel=0.2)
    assert delayed.decided


def test_a_comparison_in_words(delayed):
    result = tables(delayed)
    assert json.loads(json.dumps(result["effects"]["delay"]["verdict"])) == ASKED_FOR
    text = " ".join(in_words(result))
    assert "Delay: the data ask for it" in text and "Flocs: the data do not need it" in text
    assert "| delay |" in markdown(result)
    assert set(result) == documented("compare.json")
    assert set(result["effects"]["delay"]) == documented("Effects")
    assert set(result["models"][0]) == documented("Models")


def test_readings_that_would_decide_are_those_where_the_models_differ(delayed):
    by_name = {one.name: one for one in delayed.candidates}
    (found,) = (one for one in delayed.verdicts if one.effect is DELAY_AT_START)
    undecided = replace(found, best_with=by_name["delay"], best_without=by_name["plain"])
    best, *_ = deciding_readings(undecided)
    assert best.deviations >= 3.0
    # Half the tube has half the fall, and the same delay.
    assert best.unit in ("mm", "µm/s")
    assert not deciding_readings(replace(undecided, best_without=by_name["delay"]))


def test_the_command_refuses_what_it_does_not_take(capsys):
    for words, message in (
        (["--compare", "--posterior"], "--posterior: is not for --compare"),
        (["--compare", "--model", "closed-form"], "--model: is not for --compare"),
    ):
        with pytest.raises(mrjax.InputError, match=message):
            calibrate.__main__.cli.main(["fang2005", *words], standalone_mode=False)


def test_velocities_alone_are_refused():
    (sample,) = experiment().samples
    without = replace(experiment(), samples=(replace(sample, measurements=(), times=()),))
    with pytest.raises(mrjax.InputError, match="no sample has a curve"):
        calibrate.compare(without)
