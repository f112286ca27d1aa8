"""Fronts of beds only a few particles high, and settling velocities of either sign."""

import numpy as np
import pytest

import mrjax
from mrjax.observables.concentration import half_concentration
from tests.builders.runs import run_of

BOX = mrjax.Box((10.0, 10.0, 40.0))


@pytest.mark.parametrize(
    "mean_velocity, settling",
    [
        ([0.0, 1.0, 3.0, 2.0], 3.0),
        ([5.0, 1.0, 2.0, 0.5], 2.0),  # the start does not count
        ([0.0, -1.0, -4.0, 0.5], -4.0),
        ([0.0, -1.0, 4.0, -3.9], 4.0),
        ([0.0, -4.0, 4.0, 1.0], 4.0),
    ],
)
def test_the_settling_velocity_is_the_one_of_the_greatest_magnitude(mean_velocity, settling):
    run = run_of(range(4), np.full((4, 1), 5.0), BOX, mean_velocity=np.array(mean_velocity))
    assert float(mrjax.settling_velocity(run)) == settling


@pytest.mark.parametrize("layers", [2, 3, 6])
def test_the_bulk_of_a_low_bed_is_clear_of_its_floor(layers):
    """Layers a diameter apart: half of their concentration is at their top, however few.

    From 0.3 of the top on where that is nearer than a diameter: slabs that reach under the floor
    hold less.
    """
    centres = 1.0 + 2.0 * np.arange(layers)
    run = run_of([0.0, 1.0], np.stack([centres, centres]), BOX)
    np.testing.assert_allclose(half_concentration(run), 2.0 * layers, rtol=1e-9)
