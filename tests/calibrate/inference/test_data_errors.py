"""Errors by the data alone: profiles whose ends are known exactly."""

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate import LogNormal
from calibrate.inference import identify
from calibrate.inference.data_errors import NEAR, data_errors
from tests.calibrate.least_squares.test_fit import near


def errors_of(residuals, start, directions=None, level=1.0, **options):
    found = calibrate.fit(residuals, start, **options)
    directions = np.eye(found.values.size) if directions is None else np.asarray(directions)
    return data_errors(found, directions, level)


def test_straight_residuals_have_the_errors_of_their_curvature():
    """And products, the roots of c (J'J)^-1 c; priors have no part in it."""
    slopes = np.random.default_rng(3).normal(size=(7, 3))

    def residuals(theta):
        return slopes @ jnp.log(jnp.stack([theta["a"], theta["b"], theta["c"]])) + 0.1

    directions = np.vstack([np.eye(3), [[0.6, 0.8, 0.0]]])
    covariance = np.linalg.inv(slopes.T @ slopes)
    exact = np.sqrt(np.einsum("kp,pq,kq->k", directions, covariance, directions))
    priors = {"a": LogNormal(3.0, 0.1)}
    for level in (1.0, 9.0):
        found = errors_of(residuals, dict(a=1.0, b=2.0, c=3.0), directions, level, priors=priors)
        np.testing.assert_allclose(found, exact * level**0.5, rtol=1e-6)


def test_what_a_jacobian_does_not_see_is_seen_at_a_distance():
    """(ln a)^3 = 0 +- 0.1 rises by one at 0.1^(1/3), to either side."""

    def residuals(theta):
        return jnp.stack([jnp.log(theta["a"]) ** 3 / 0.1, jnp.log(theta["b"]) / 0.3])

    a, b = errors_of(residuals, dict(a=1.0, b=1.0))
    assert a == near(0.1 ** (1 / 3), rel=NEAR)
    assert b == near(0.3, rel=1e-6)


def test_a_valley_that_bends_is_followed():
    """b = a^ln(a) leaves a open along it, but for what a itself is read to."""

    def residuals(theta):
        a, b = jnp.log(theta["a"]), jnp.log(theta["b"])
        return jnp.stack([(b - a**2) / 1e-2, (a - 0.5) / 0.7])

    a, b = errors_of(residuals, dict(a=2.0, b=1.5))
    assert a == near(0.7, rel=NEAR)
    # From a = 1.2; and where b is below the least of the valley, by 0.7 % with the other residual.
    below = -1e-2 * (1.0 - (0.5 / 0.7) ** 2) ** 0.5
    assert b == near(0.5 * (1.2**2 - below), rel=NEAR)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_one_end_alone_is_no_interval(way):
    """exp(-a) of what has decayed: on one side chi-squared never rises by one."""

    def residuals(theta):
        return (jnp.exp(-5.0 * way * jnp.log(theta["a"])) - 0.1)[None] / 0.2

    assert errors_of(residuals, dict(a=1.3**way)) == [np.inf]


def test_bounds_are_no_data():
    """Of a product one is as open as the other's bounds let it be: that is no error of the data."""

    def residuals(theta):
        return jnp.log(theta["a"] * theta["b"])[None] / 0.1

    start, bounds = dict(a=1.0, b=1.0), {"b": (0.5, 2.0)}
    assert errors_of(residuals, start, bounds=bounds).tolist() == [np.inf, np.inf]
    product = errors_of(residuals, start, [np.array([1.0, 1.0]) / 2**0.5], bounds=bounds)
    assert product[0] == near(0.1 / 2**0.5, rel=1e-6)


def test_a_bed_that_is_not_reached_is_not_determined():
    """max(1 - t, bed) at times before the bed is met says only that it is below."""

    def residuals(theta):
        times = jnp.array([0.2, 0.4, 0.6])
        line = jnp.maximum(1.0 - theta["v"] * times, theta["bed"])
        return (line - jnp.array([0.81, 0.59, 0.4])) / 0.01

    bed, speed = errors_of(residuals, dict(v=1.0, bed=0.2))
    assert speed < 0.03 and bed == np.inf


def test_errors_are_scaled_where_the_data_do_not_fit():
    """Four readings of one number, 5 errors apart: chi-squared of a degree of freedom is 33.3."""
    readings = np.array([-5.0, 5.0, -5.0, 5.0])

    def residuals(theta):
        return jnp.log(theta["a"]) / 0.1 + readings

    found = calibrate.identify(calibrate.fit(residuals, dict(a=1.0)))
    assert found.error_scale == near((100.0 / 3.0) ** 0.5, rel=1e-9)
    assert found.data_standard_errors["a"] == near(0.05 * found.error_scale, rel=1e-6)


@pytest.mark.parametrize("error", [0.05, 0.001])
def test_a_bound_that_hardly_matters_is_no_end(error):
    """a * b^0.05 of which b is between bounds: a is known to a twentieth of how far b may be."""

    def residuals(theta):
        return (jnp.log(theta["a"]) + 0.05 * jnp.log(theta["b"]))[None] / error

    found = errors_of(residuals, dict(a=1.0, b=1.0), [np.eye(2)[0]], bounds={"b": (1 / 55, 55)})
    assert found[0] == near(0.05 * np.log(55.0) + error, rel=NEAR)


def test_a_bound_like_a_wall_is_no_data_either():
    """The product of a and b, read a million times better than b is bounded."""

    def residuals(theta):
        return jnp.log(theta["a"] * theta["b"])[None] / 1e-7

    found = errors_of(residuals, dict(a=1.0, b=1.0), [np.eye(2)[0]], bounds={"b": (0.5, 2.0)})
    assert found[0] == np.inf


def test_a_slope_on_the_edge_of_a_front_is_no_error():
    """A front of width 1e-3 at ln a: a reading on its edge, and nothing else for 0.4 to a side."""

    def residuals(theta):
        places = jnp.array([-0.4, 0.0, 0.4])
        level = jnp.clip((places - jnp.log(theta["a"])) / 1e-3, 0.0, 1.0)
        return (level - jnp.array([0.0, 0.999, 1.0])) / 0.01

    priors = {"a": LogNormal(1.0, 2.0)}
    fitted = calibrate.fit(residuals, {"a": 0.9991}, priors=priors)
    found = calibrate.identify(fitted)
    # From the edge at -0.001 to that of the reading before: nothing changes between.
    assert found.data_standard_errors["a"] == near(0.5 * 0.4, rel=0.05)
    assert found.standard_errors["a"] == near(found.data_standard_errors["a"], rel=0.1)
    # Errors of readings that are larger make none smaller.
    scaled = identify.widened_errors(fitted, found.widening, 3.0)
    assert scaled["a"] == near(3.0 * found.standard_errors["a"], rel=0.1)


def test_what_is_not_seen_near_the_fit_makes_up_for_a_value():
    """Without its bed, v rises by one 0.0668 from 1; a bed at the last reading leaves 0.1118."""

    def residuals(theta):
        line = jnp.maximum(1.0 - theta["v"] * jnp.array([0.2, 0.4, 0.6]), theta["bed"])
        return (line - jnp.array([0.8, 0.6, 0.4])) / 0.05

    bed, speed = errors_of(residuals, dict(v=1.0, bed=0.2), priors={"bed": LogNormal(0.2, 0.5)})
    slow, fast = 0.05 / 0.56**0.5, 0.05 / 0.2**0.5
    assert speed == near(0.5 * (np.log(1.0 + fast) - np.log(1.0 - slow)), rel=NEAR)
    assert bed == np.inf


def test_priors_of_others_bound_a_value_that_the_data_leave_wide():
    """a b = 1 to a hundredth, and ln a between walls at -1 and 1; b is believed within a tenth."""

    def residuals(theta):
        a, b = jnp.log(theta["a"]), jnp.log(theta["b"])
        return jnp.stack([(a + b) / 0.01, jnp.maximum(jnp.abs(a) - 1.0, 0.0) / 1e-3])

    priors = {"b": LogNormal(1.0, 0.1)}
    found = calibrate.identify(calibrate.fit(residuals, dict(a=1.0, b=1.0), priors=priors))
    assert found.data_standard_errors["a"] == near(1.0, rel=NEAR)
    assert found.standard_errors["a"] == near((0.1**2 + 0.01**2) ** 0.5, rel=NEAR)


def test_a_large_chi_squared_of_few_readings_is_chance():
    """Two readings of one number, 3.2 errors apart: 5.1 for one degree of freedom, p = 0.024."""

    def residuals(theta):
        return jnp.log(theta["a"]) / 0.1 + jnp.array([-1.6, 1.6])

    fitted = calibrate.fit(residuals, dict(a=1.0))
    assert fitted.chi_squared > 4.0
    assert calibrate.identify(fitted).error_scale == 1.0
