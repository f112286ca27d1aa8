"""Starts, the search and what it trusts, robust residuals: each by hand."""

from collections import OrderedDict

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate import LogNormal
from calibrate.least_squares import search
from calibrate.least_squares.draws import SPREAD, WIDER
from calibrate.least_squares.programs import pseudo_huber
from calibrate.least_squares.unknowns import unknowns
from tests.calibrate.least_squares.test_kinks import evaluator_of


@pytest.mark.parametrize("longest", [0.5, 2.0])
def test_squares_of_robust_residuals_are_pseudo_huber_losses(longest):
    residuals = np.array([-30.0, -1.0, 0.0, 1e-3, 2.0, 100.0])
    loss = 2.0 * longest**2 * (np.sqrt(1.0 + (residuals / longest) ** 2) - 1.0)
    counted = np.asarray(pseudo_huber(jnp.asarray(residuals), longest))
    np.testing.assert_allclose(counted**2, loss, rtol=1e-9, atol=1e-15)
    assert (np.sign(counted) == np.sign(residuals)).all()


def test_further_starts_are_as_wide_as_the_priors_and_within_bounds():
    """ln a by its prior, ln b by the spread of those without one; c evenly between its bounds."""
    start = OrderedDict(a=2.0, b=3.0, c=5.0)
    priors = {"a": LogNormal(7.0, 0.3), "c": LogNormal(5.0, 10.0)}
    unknown = unknowns(start, priors, {"c": (4.0, 6.0)})
    drawn = unknown.starts(4000, seed=3)
    np.testing.assert_allclose(np.exp(drawn[0]), [2.0, 3.0, 5.0], rtol=1e-12)
    spread = (drawn[1:] - np.log([7.0, 3.0, 5.0]))[:, :2]
    # Sobol's points are even to 1 / S, and tails that are cut off: twice as much, by trial.
    np.testing.assert_allclose(spread.std(axis=0), [WIDER * 0.3, WIDER * SPREAD], rtol=2e-3)
    np.testing.assert_allclose(spread.mean(axis=0), 0.0, atol=5e-3)
    shares = np.sort((drawn[1:, 2] - np.log(4.0)) / np.log(1.5))
    np.testing.assert_allclose(shares, np.linspace(0.0, 1.0, 3999), atol=5e-3)
    assert not (unknown.starts(5, seed=4)[1:, :2] == drawn[1:5, :2]).any()
    assert unknown.starts(1, seed=3).shape == (1, 3)


@pytest.mark.parametrize("left, trusted", [(0.74, True), (0.76, False)])
def test_a_step_is_trusted_that_brings_a_quarter_of_its_promise(left, trusted):
    """From 1 the straight residual goes to 0, at x = -1; this one has the root of `left` there."""

    def residuals(theta):
        x = jnp.log(theta["a"])
        return jnp.atleast_1d(1.0 + x + np.sqrt(left) * x**2)

    evaluator = evaluator_of(residuals, {"a": 1.0})
    ahead = search._trusted_step(evaluator, evaluator.at(np.zeros(1)))
    assert (ahead is not None) == trusted
    if trusted:
        np.testing.assert_allclose(ahead, [-1.0], rtol=1e-9)


def test_a_step_that_promises_nothing_is_the_end():
    evaluator = evaluator_of(lambda theta: jnp.log(theta["a"])[None], {"a": 1.0})
    np.testing.assert_array_equal(search._trusted_step(evaluator, evaluator.at(np.zeros(1))), [0.0])


def test_a_start_with_nothing_to_come_back_to_is_given_up_at_once():
    fit = calibrate.fit(lambda theta: jnp.log(theta["a"] - 10.0)[None], {"a": 5.0})
    assert not fit.converged
    assert len(fit.loss) == 2 and fit.model_runs < 5


def test_a_fit_is_no_worse_than_any_place_that_its_search_met():
    """It begins in a narrow valley, which a step of the search leaves for a wide one."""

    def narrow_and_wide(theta):
        log = jnp.log(theta["a"])
        narrow = 20.0 * (1.0 - jnp.exp(-0.5 * ((log + 1.0) / 0.01) ** 2))
        return jnp.stack([narrow, 0.5 * (log - 1.0)])

    start = {"a": np.exp(-1.0 + 1e-5)}
    begun = np.asarray(narrow_and_wide(start))
    fit = calibrate.fit(narrow_and_wide, start)
    assert fit.loss[-1] <= 0.5 * begun @ begun
    assert np.log(fit.values[0]) == pytest.approx(-1.0, abs=0.01)
    assert fit.loss[-1] == fit.loss.min()
