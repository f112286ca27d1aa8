"""Profile likelihoods where the answer is known: bent valleys, intervals, what has no end."""

from collections import OrderedDict

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate.inference import profile
from calibrate.inference.profile import profiles


def bent(theta):
    """A valley y = x^2 in logarithms, along which chi-squared is (1 - x)^2."""
    x, y = jnp.log(theta["a"]), jnp.log(theta["b"])
    return jnp.stack([10.0 * (y - x**2), 1.0 - x])


def test_a_profile_follows_a_bent_valley():
    """With b at a^(ln a) nothing but (1 - x)^2 is left, however far the straight valley leads."""
    fit = calibrate.fit(bent, OrderedDict(a=2.0, b=2.0))
    held = {one.name: one for one in profiles(fit)}["a"]
    np.testing.assert_allclose(np.log(held.values), 1.0 + np.arange(-4.0, 5.0), atol=1e-5)
    np.testing.assert_allclose(held.increase, np.arange(-4.0, 5.0) ** 2, rtol=1e-4, atol=1e-6)
    for coverage, reach in {"68 %": 1.0, "95 %": 1.96}.items():
        ends = np.log(held.intervals[coverage]) - 1.0
        np.testing.assert_allclose(ends, [-reach, reach], rtol=1e-3)


OFFSETS = np.linspace(-4.0, 4.0, 9)


def test_ends_of_an_interval_are_where_a_parabola_has_its_level():
    """Steeper below than above: ends at 1 / 2 and 1, in logarithms, for a level of 1."""
    increase = np.where(OFFSETS < 0.0, 4.0, 1.0) * OFFSETS**2
    low, high = profile._interval(np.exp(OFFSETS), increase, 1.0)
    assert np.log([low, high]) == pytest.approx([-0.5, 1.0], abs=1e-12)
    low, high = profile._interval(np.exp(OFFSETS), increase, 6.25)
    assert np.log([low, high]) == pytest.approx([-1.25, 2.5], abs=1e-12)


def test_an_interval_that_a_profile_does_not_reach_has_no_end():
    increase = np.where(OFFSETS < 0.0, 0.01, 1.0) * OFFSETS**2
    assert profile._interval(np.exp(OFFSETS), increase, 1.0) == (0.0, pytest.approx(np.e))
    turned = increase[::-1]
    low, high = profile._interval(np.exp(OFFSETS), turned, 1.0)
    assert low == pytest.approx(np.exp(-1.0)) and high == np.inf
    assert profile._interval(np.exp(OFFSETS), 0.0 * OFFSETS, 1.0) == (0.0, np.inf)


def test_what_leads_beyond_all_numbers_ends_a_profile():
    """Slopes that are no numbers from ln a = 2 on: what is known there stays infinite."""

    def cliff(theta):
        x = jnp.log(theta["a"])
        return jnp.atleast_1d(jnp.where(x < 2.0, x, jnp.nan))

    fit = calibrate.fit(cliff, {"a": 1.5})
    (held,) = profiles(fit)
    beyond = np.log(held.values) >= 2.0
    assert beyond.any() and np.isinf(held.increase[beyond]).all()
    np.testing.assert_allclose(held.increase[~beyond], np.log(held.values[~beyond]) ** 2, atol=1e-9)


def test_estimated_errors_make_intervals_wider():
    """Squares of Student's t of a table: 1.067 and 2.262 for 9 degrees of freedom."""
    assert profile.levels() == profile.LEVELS
    found = profile.levels(9.0)
    assert found["95 %"] == pytest.approx(2.262**2, rel=1e-3)
    assert found["68 %"] == pytest.approx(1.059**2, rel=1e-3)
    (held,) = profiles(calibrate.fit(line, {"a": 2.0}), degrees_of_freedom=2.0)
    # Beyond four standard errors, which a profile with stated errors does not reach.
    assert np.log(held.intervals["95 %"][1]) == pytest.approx(4.303, rel=1e-3)


def line(theta):
    """ln a is 0 +- 1."""
    return jnp.log(theta["a"])[None]
