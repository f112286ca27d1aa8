"""Reduced units: what one of them is in SI, for every dimension."""

import pytest

from mrjax.core.units import MM_PER_DAY, Units

UNITS = Units(mass=2.0, length=3.0, time=5.0)


@pytest.mark.parametrize(
    "dimension, value",
    [
        ((1, 0, 0), 2.0),
        ((0, 1, 0), 3.0),
        ((0, 0, 1), 5.0),
        ((1, 1, -2), 2.0 * 3.0 / 25.0),  # N
        ((1, 2, -2), 2.0 * 9.0 / 25.0),  # N m
        ((1, -1, -2), 2.0 / 3.0 / 25.0),  # Pa
        ((0, 0, 0), 1.0),
    ],
)
def test_the_unit_of_a_dimension(dimension, value):
    assert UNITS.scale(dimension) == pytest.approx(value, rel=1e-15, abs=0.0)


def test_velocities():
    assert UNITS.velocity == 3.0 / 5.0
    assert UNITS.scale((0, 1, -1)) == pytest.approx(UNITS.velocity, rel=1e-15, abs=0.0)
    assert MM_PER_DAY == 1000 * 24 * 3600


def test_units_of_micrometres_do_not_vanish():
    """Powers that single precision has no form for."""
    assert Units(1.0, 1e-6, 1e-9).scale((0, -8, 0)) == pytest.approx(1e48, rel=1e-12)
