"""Which ends of searches are different optima, and which are told."""

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate import LogNormal
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.levenberg import Point
from calibrate.least_squares.optima import Optimum, distinct, with_others
from calibrate.least_squares.scout import scout
from calibrate.least_squares.unknowns import unknowns

OPEN = Bounds(np.full(2, -np.inf), np.full(2, np.inf))


def end_of(logs, value, jacobian=((1.0, 0.0), (0.0, 1.0))):
    logs, value = np.array(logs, float), np.array(value, float)
    return Point(0.5 * float(value @ value), logs, np.array(jacobian, float), value)


ORTHOGONAL = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
"""Slopes across a residual alone: of an optimum."""


def optimum_of(logs, value):
    return end_of(logs, [value, 0.0, 0.0], ORTHOGONAL)


def ridge(loss):
    return lambda logs: Point(loss, logs, np.eye(2), np.zeros(2))


def test_the_best_comes_first_and_what_predicts_otherwise_is_another():
    best, other = optimum_of([0, 0], 3.0), optimum_of([5, 5], 4.1)
    assert distinct([other, best], np.zeros(2), OPEN, ridge(np.inf)) == [best, other]


@pytest.mark.parametrize("loss, count", [(4.99, 1), (5.01, 2)])
def test_like_predictions_are_of_one_optimum_unless_a_ridge_is_between(loss, count):
    one, far = optimum_of([0, 0], 3.0), optimum_of([5, 5], 3.0)
    assert len(distinct([one, far], np.zeros(2), OPEN, ridge(loss))) == count
    nearby = optimum_of([0.3, 0.3], 3.0)
    assert len(distinct([one, nearby], np.zeros(2), OPEN, ridge(np.inf))) == 1


def test_of_one_valley_the_nearest_to_the_start_is_told():
    far, close, worse = (optimum_of([x, 0], v) for x, v in ((5, 3.0), (2, 3.0), (0, 3.001)))
    assert distinct([far, close, worse], np.zeros(2), OPEN, ridge(4.5)) == [close]


def test_no_other_optimum_is_where_slopes_lead_on_or_a_plateau_or_nothing_is_predicted():
    best = optimum_of([0, 0], 3.0)
    slope = end_of([5, 5], [9.0, 0.0, 0.0], ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0)))
    plateau = end_of([6, 6], [9.0, 0.0, 0.0], ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)))
    nothing = end_of([7, 7], [np.nan, 0.0, 0.0], ORTHOGONAL)._replace(loss=np.inf)
    ends = [slope, plateau, nothing, best]
    assert distinct(ends, np.zeros(2), OPEN, ridge(np.inf)) == [best]
    assert distinct([slope], np.zeros(2), OPEN, ridge(np.inf)) == [slope]


def test_optima_of_others_are_added_where_they_are_elsewhere():
    first, near_by, far = (
        Optimum(np.array([x]), loss, 0.0) for x, loss in ((2, 3), (3, 2.8), (9, 1))
    )
    assert with_others([first], [near_by, far]) == (first, far)
    worse = near_by._replace(loss=3.6)
    assert with_others([first], [worse]) == (first, worse)


def valleys(theta):
    """Two, at ln a = -1 and nearly 1, whose losses are about 2 0.4^2 apart."""
    log = jnp.log(theta["a"])
    return jnp.stack([10.0 * (log**2 - 1.0), 0.4 * (log + 1.0)])


PRIOR = {"a": LogNormal(1.0, 3.0)}


def test_a_fit_tells_all_optima_however_nearly_they_are_as_good():
    fit = calibrate.fit(valleys, {"a": 2.5}, priors=PRIOR, starts=8)
    assert fit.places == 8
    best, other = fit.optima
    assert (best.loss, best.chi_squared) == (fit.loss[-1], fit.chi_squared)
    np.testing.assert_allclose(np.log([*best.values, *other.values]), [-1.0, 1.0], atol=0.02)
    assert other.loss - best.loss == pytest.approx(2.0 * 0.4**2, rel=0.05)
    assert other.loss - 0.5 * other.chi_squared == pytest.approx(0.5 / 9.0, rel=0.05)
    assert fit.other_optima == ((other.loss, other.values),)


def test_a_fit_begins_also_where_it_is_told():
    alone = calibrate.fit(valleys, {"a": 2.5}, priors=PRIOR)
    assert np.log(alone.values[0]) > 0.9 and len(alone.optima) == 1
    told = calibrate.fit(valleys, {"a": 2.5}, also=[{"a": 0.3}], priors=PRIOR)
    assert np.log(told.values[0]) < -0.9 and len(told.optima) == 2


def test_a_scout_finds_the_optima_of_a_fit_and_finishes_none():
    unknown = unknowns({"a": 2.5}, PRIOR, {})
    best, other = scout(valleys, unknown, unknown.starts(20, 0))
    fit = calibrate.fit(valleys, {"a": 2.5}, priors=PRIOR, starts=8)
    for one, same in zip((best, other), fit.optima, strict=True):
        np.testing.assert_allclose(one.values, same.values, rtol=1e-3)
        assert one.chi_squared == pytest.approx(same.chi_squared, rel=1e-3)
        assert not one.finished and same.finished


def test_a_scout_finds_nothing_where_nothing_is_predicted():
    unknown = unknowns({"a": 2.5}, PRIOR, {})
    assert scout(lambda theta: jnp.nan * theta["a"][None], unknown, unknown.starts(9, 0)) == []
