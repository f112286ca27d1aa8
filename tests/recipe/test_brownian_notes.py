"""Brownian motion in a lab sheet: its temperature, and the Peclet number in words."""

import pytest

import mrjax
from mrjax.laws import dimensionless
from mrjax.recipe import brownian_notes
from mrjax.simulation import derived


@pytest.fixture(scope="module")
def colloid():
    return mrjax.Recipe.load("case2").replace(
        particle={"diameter": 0.1e-6}, box={"size": [1e-6, 1e-6, 2e-6]}, temperature=310.0
    )


def test_a_sheet_with_brownian_motion_has_its_temperature_in_the_parameters(colloid):
    assert colloid.parameters().temperature is None
    assert colloid.replace(brownian={"on": False}).parameters().temperature is None
    assert float(colloid.replace(brownian={"on": True}).parameters().temperature) == 310.0
    with pytest.raises(mrjax.InputError, match=r"brownian\.on"):
        colloid.replace(brownian={"on": "warm"})


def test_a_note_says_what_the_peclet_number_means(colloid):
    (off,) = brownian_notes.notes(colloid)
    assert "Brownian motion is off, though it keeps such particles from packing" in off
    (on,) = brownian_notes.notes(colloid.replace(brownian={"on": True}))
    # k T / W = R / Pe.
    height = 1e6 * 0.05e-6 / colloid.peclet_number
    assert "Peclet number (net weight" in on and f"within about {height:.2g} um" in on
    (iron,) = brownian_notes.notes(mrjax.Recipe.load("case2"))
    assert "hardly matters" in iron
    assert not brownian_notes.notes(colloid.replace(gravity=0.0))
    assert on in derived.notes(colloid.replace(brownian={"on": True}))


def test_with_brownian_motion_no_peclet_number_is_out_of_range(colloid):
    cold, warm = colloid.parameters(), colloid.replace(brownian={"on": True}).parameters()
    assert dimensionless.numbers(cold, 1e-9)[2].warning
    number = dimensionless.numbers(warm, 1e-9)[2]
    assert not number.warning and number.holds == "any"
