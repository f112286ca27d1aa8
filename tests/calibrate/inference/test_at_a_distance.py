"""Null directions, along which predictions are asked for again at a distance."""

from collections import OrderedDict

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate.inference.at_a_distance import unchanged_at_a_distance

START = OrderedDict(a=2.0, b=3.0)


def product(theta):
    return (theta["a"] * theta["b"] - 6.0)[None] / 0.1


def bent(theta):
    """At a = 2 nothing is seen of a / b; farther away it is."""
    farther = jnp.maximum(jnp.abs(jnp.log(theta["a"] / theta["b"] * 1.5)) - 0.5, 0.0)
    return jnp.stack([(theta["a"] * theta["b"] - 6.0) / 0.1, farther])


def lost(theta):
    """Nothing is predicted where a is large."""
    return jnp.where(theta["a"] < 3.0, product(theta), jnp.nan)


def lost_below(theta):
    """Nothing is predicted where a is small."""
    return jnp.where(theta["a"] > 1.0, product(theta), jnp.nan)


@pytest.mark.parametrize(
    "residuals, unchanged", [(product, True), (bent, False), (lost, False), (lost_below, False)]
)
def test_no_prediction_changes_where_none_does_at_a_distance(residuals, unchanged):
    fit = calibrate.fit(residuals, START)
    found = calibrate.identify(fit)
    assert found.null_directions == ("a / b",)
    np.testing.assert_allclose(found.null_exponents, [[1.0, -1.0]])
    assert unchanged_at_a_distance(fit, found) == (("a / b",) if unchanged else ())


def test_the_distance_ends_at_the_bounds():
    """Beyond a = 3 it would change."""
    fit = calibrate.fit(lost, START, bounds={"a": (1.0, 2.9)})
    assert unchanged_at_a_distance(fit, calibrate.identify(fit)) == ("a / b",)


def test_what_the_data_determine_has_no_such_direction():
    fit = calibrate.fit(lambda theta: jnp.log(theta["a"])[None] / 0.1, {"a": 1.5})
    assert unchanged_at_a_distance(fit, calibrate.identify(fit)) == ()
