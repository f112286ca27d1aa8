"""The covariance at an optimum: weak directions have errors, those of rounding have none."""

from types import SimpleNamespace

import numpy as np
import pytest

from calibrate.inference.curvature import RANK_TOLERANCE, covariance, information, standard_errors


def test_a_weak_direction_has_a_finite_error():
    """Ten thousand times weaker than the strongest, which its square makes 1e-8; by hand."""
    known, unbounded = covariance(np.diag([1e8, 1.0]))
    np.testing.assert_allclose(known, np.diag([1e-8, 1.0]), rtol=1e-12)
    assert unbounded.shape == (2, 0)


@pytest.mark.parametrize("factor, bounded", [(1.5, True), (0.7, False)])
def test_directions_are_lost_below_the_rank_tolerance_of_the_jacobian(factor, bounded):
    """Singular values count beside it; information has their squares."""
    weak = (factor * RANK_TOLERANCE) ** 2
    known, unbounded = covariance(np.diag([1.0, weak]))
    assert unbounded.shape == (2, 0 if bounded else 1)
    assert known[1, 1] == pytest.approx(1.0 / weak if bounded else 0.0)
    if not bounded:
        np.testing.assert_allclose(np.abs(unbounded[:, 0]), [0.0, 1.0], atol=1e-12)


def test_a_covariance_is_the_inverse_of_its_information():
    turned = np.array([[0.8, -0.6], [0.6, 0.8]])
    strength = turned @ np.diag([25.0, 4.0]) @ turned.T
    known, unbounded = covariance(strength)
    np.testing.assert_allclose(known @ strength, np.eye(2), atol=1e-14)
    assert unbounded.shape == (2, 0)


def fit_of(jacobian, precision, values):
    names = tuple("abc"[: len(values)])
    return SimpleNamespace(
        jacobian=np.array(jacobian, float),
        prior_precision=np.array(precision, float),
        values=np.array(values, float),
        names=names,
    )


def test_information_is_that_of_data_and_priors():
    fit = fit_of([[3.0, 0.0], [0.0, 4.0], [1.0, 1.0]], [0.0, 5.0], [2.0, 7.0])
    np.testing.assert_allclose(information(fit), [[10.0, 1.0], [1.0, 22.0]])


def test_errors_of_values_are_those_of_logarithms_times_the_values():
    """ln a to 0.1, ln b to 11, beyond which nothing is known; c by nothing at all."""
    fit = fit_of([[10.0, 0.0, 0.0], [0.0, 1.0 / 11.0, 0.0]], [0.0, 0.0, 0.0], [2.0, 7.0, 3.0])
    errors = standard_errors(fit)
    assert errors["a"] == pytest.approx(0.2)
    assert errors["b"] == errors["c"] == np.inf
    fit = fit_of([[10.0, 0.0], [0.0, 1.0 / 9.0]], [0.0, 0.0], [2.0, 7.0])
    assert standard_errors(fit)["b"] == pytest.approx(63.0)
