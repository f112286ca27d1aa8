"""Single steps and whole paths of Levenberg and Marquardt's method, by hand."""

import numpy as np
import pytest

from calibrate.least_squares import levenberg
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.levenberg import Point

OPEN = Bounds(np.full(2, -np.inf), np.full(2, np.inf))


def point_of(residuals, jacobian, logs=(0.0, 0.0)):
    value, slopes = np.array(residuals, float), np.array(jacobian, float)
    return Point(0.5 * float(value @ value), np.array(logs, float), slopes, value)


def each(at):
    return lambda places: [at(place) for place in places]


def test_a_free_step_solves_straight_residuals_and_promises_all_of_them():
    change, promised = levenberg.step(point_of([3.0, -4.0], [[1.0, 0.0], [0.0, 2.0]]), OPEN)
    np.testing.assert_allclose(change, [-3.0, 2.0], rtol=1e-12)
    assert promised == pytest.approx(25.0)


def test_a_step_is_no_longer_than_its_radius():
    point = point_of([3.0, -4.0], [[1.0, 0.0], [0.0, 2.0]])
    change, promised = levenberg.step(point, OPEN, 0.5)
    assert np.linalg.norm(change) == pytest.approx(0.5, rel=2e-3)
    assert 0.0 < promised < 25.0


def test_a_step_far_below_the_free_one_has_its_radius_whatever_the_rounding():
    rng = np.random.default_rng(0)
    for scale in (1.0, 1e-20, 1e-100):
        for radius in 10.0 ** rng.uniform(-12, -6, 100):
            point = point_of(rng.normal(size=3), scale * rng.normal(size=(3, 2)))
            change, _ = levenberg.step(point, OPEN, radius)
            assert np.linalg.norm(change) == pytest.approx(radius, rel=2e-3)


def test_a_step_goes_nowhere_along_what_the_data_do_not_see():
    change, _ = levenberg.step(point_of([2.0], [[1.0, 1.0]]), OPEN)
    np.testing.assert_allclose(change, [-1.0, -1.0], rtol=1e-12)
    change, _ = levenberg.step(point_of([2.0], [[1.0, 1e-12]]), OPEN)
    np.testing.assert_allclose(change, [-2.0, -2e-12], rtol=1e-6)


def test_what_would_leave_the_bounds_ends_on_them_and_the_rest_follows():
    """x ends on its bound, which drives y onto its own; z takes what both leave of the sum, 6."""
    box = Bounds(np.array([-1.0, -0.5, -9.0]), np.array([1.0, 0.5, 9.0]))
    jacobian = [[10.0, 10.0, 10.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    change, _ = levenberg.step(point_of([-60.0, -3.0, -3.4], jacobian, (0.0,) * 3), box)
    np.testing.assert_allclose(change, [1.0, 0.5, 4.5], rtol=1e-9)


def test_without_numbers_there_is_no_step():
    change, promised = levenberg.step(point_of([np.nan], [[1.0, 1.0]]), OPEN)
    assert not change.any() and promised == np.inf


def test_a_path_that_overshoots_is_shortened_and_never_taken_uphill():
    """atan, whose full steps from 3 on lead farther and farther away."""
    asked = []

    def at(logs):
        asked.append(float(logs[0]))
        return point_of(np.arctan(logs), 1.0 / (1.0 + logs[:, None] ** 2), logs)

    one = Bounds(np.array([-np.inf]), np.array([np.inf]))
    (end,), runs = levenberg.minimise(each(at), [at(np.array([3.0]))], one, 60)
    assert abs(end.logs[0]) < 1e-4 and runs == len(asked) - 1
    # Ten to the left it is worse there: from where it was, a quarter as far.
    np.testing.assert_allclose(asked[1:3], [-7.0, 0.5], rtol=5e-3)
    assert levenberg.LONGEST == 10.0 and len(asked) < 12


def test_a_path_ends_where_next_to_nothing_is_promised():
    def at(logs):
        return point_of(logs - 1.0, np.eye(2), logs)

    (end,), runs = levenberg.minimise(each(at), [at(np.zeros(2))], OPEN, 20)
    np.testing.assert_allclose(end.logs, [1.0, 1.0], rtol=1e-12)
    assert runs <= 2
    _, runs = levenberg.minimise(each(at), [at(np.ones(2))], OPEN, 20)
    assert runs == 0


def test_paths_side_by_side_are_those_of_each_alone():
    """From three places to the two roots of x^2 = 4, one call for all that are under way."""
    calls = []

    def at(logs):
        return point_of(logs**2 - 4.0, 2.0 * logs[None], logs)

    def together(places):
        calls.append(len(places))
        return [at(place) for place in places]

    one = Bounds(np.array([-np.inf]), np.array([np.inf]))
    firsts = [at(np.array([x])) for x in (2.0, 30.0, -1.0)]
    ends, runs = levenberg.minimise(together, firsts, one, 60)
    alone = [levenberg.minimise(each(at), [first], one, 60) for first in firsts]
    assert [end.logs for end in ends] == [path[0][0].logs for path in alone]
    np.testing.assert_allclose(np.ravel([end.logs for end in ends]), [2, 2, -2], rtol=1e-5)
    assert runs == sum(path[1] for path in alone) == sum(calls)
    assert len(calls) == max(path[1] for path in alone)
