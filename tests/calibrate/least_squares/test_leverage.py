"""Leverages by hand: of a mean, of a line, beside a prior."""

import numpy as np
import pytest

from calibrate.least_squares.leverage import leverages


def test_each_of_equal_readings_has_an_equal_share_of_their_mean():
    np.testing.assert_allclose(leverages(np.ones((4, 1)), np.zeros(1)), 0.25)


def test_readings_at_the_ends_of_a_line_have_more():
    """1/n + x^2 / sum x^2 of a line through n = 5 points about zero."""
    x = np.arange(-2.0, 3.0)
    found = leverages(np.stack([np.ones(5), x], 1), np.zeros(2))
    np.testing.assert_allclose(found, 0.2 + x**2 / 10.0, rtol=1e-12)
    assert found.sum() == pytest.approx(2.0)


def test_a_prior_takes_its_share():
    """One reading of a value with a prior as precise: half of it is from the reading."""
    np.testing.assert_allclose(leverages(np.ones((1, 1)), np.ones(1)), 0.5)


def test_what_is_not_determined_has_none():
    jacobian = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    assert leverages(jacobian, np.zeros(2)).sum() == pytest.approx(1.0)
    assert leverages(np.full((2, 1), np.nan), np.zeros(1)).tolist() == [0.0, 0.0]
