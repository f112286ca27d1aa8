"""The estimated scatter of readings: that of the noise, never less than can be read."""

import numpy as np
import pytest

from calibrate.experiment.readings.scatter import scatter


@pytest.mark.parametrize("sigma", [0.3, 2.0])
def test_it_is_that_of_noise_on_a_straight_fall(sigma):
    """Unequal steps of time: the median of 400 distances is within some 8 % of that of many."""
    generator = np.random.default_rng(0)
    times = np.cumsum(generator.uniform(0.2, 3.0, 400))
    values = 100.0 - 0.1 * times + sigma * generator.standard_normal(400)
    assert scatter(list(times), list(values), 100.0) == pytest.approx(sigma, rel=0.1)


def test_repeats_are_compared_with_their_mean():
    """Two of each time differ by the root of two of one; a bend between times is no scatter."""
    generator = np.random.default_rng(1)
    times = np.repeat(np.arange(200.0), 2)
    values = 50.0 + 0.5 * generator.standard_normal(400)
    assert scatter(list(times), list(values), 100.0) == pytest.approx(0.5, rel=0.1)
    assert scatter([0.0, 0.0, 9.0, 9.0], [10.0, 12.0, 3.0, 5.0], 100.0) == pytest.approx(
        np.sqrt(2.0) / 0.6745
    )


def test_it_has_a_floor_and_a_guess_for_a_few_readings():
    assert scatter([0.0, 1.0, 2.0, 3.0, 4.0], [100.0, 90.0, 80.0, 70.0, 60.0], 100.0) == 0.1
    assert scatter([0.0, 1.0], [100.0, 90.0], 100.0) == 1.0


def test_a_bend_is_hardly_scatter():
    """Two millimetres on a curve that bends: lines through neighbours would give more."""
    generator = np.random.default_rng(2)
    found = []
    for _ in range(30):
        times = 100.0 * np.linspace(0.0, 1.0, 25) ** 1.5
        values = 760.0 * (0.4 + 0.6 * np.exp(-times / 15.0)) + 2.0 * generator.standard_normal(25)
        found.append(scatter(list(times), list(values), 760.0))
    assert np.median(found) == pytest.approx(2.0, rel=0.15)


def test_a_parabola_at_unequal_times_has_none():
    times = [0.0, 1.0, 3.0, 4.5, 9.0, 11.0]
    assert scatter(times, [100.0 - 5.0 * one + 0.2 * one**2 for one in times], 100.0) == 0.1


def test_times_far_apart_or_close_together_are_no_matter():
    times = [0.0, 1e-300, 2e-300, 1.0, 1e20, 1e30, 1.1e30]
    assert 0.1 <= scatter(times, [100.0, 99.0, 98.0, 70.0, 60.0, 50.0, 49.0], 100.0) < 100.0
    times = [0.0, 5e-324, 1e-323, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert scatter(times, [100.0, 99.0, 100.0, 90.0, 80.0, 70.0, 60.0, 50.0], 100.0) < 100.0


def test_an_outlier_hardly_counts():
    times, values = np.arange(30.0), 100.0 - np.arange(30.0)
    values[10] -= 40.0
    assert scatter(list(times), list(values), 100.0) == 0.1
