"""Granular Bond numbers in words, against the pull-off force of Derjaguin over the net weight."""

import numpy as np
import pytest

import mrjax
from mrjax.laws import dimensionless
from mrjax.recipe import attraction_notes
from mrjax.simulation import derived

CASE = mrjax.Recipe.load("case2").parameters()


@pytest.mark.parametrize(
    "gap, diameter, bond",
    [(0.4e-9, 4e-6, 4.9e4), (2e-9, 4e-6, 1900), (400e-9, 4e-6, 0.05), (10e-9, 2e-6, 311)],
)
def test_the_bond_number_of_iron_in_oil(gap, diameter, bond):
    """A R* / (6 h_0^2) of 1e-19 J over the net weight, 2.14 pN at 4 um."""
    found = dimensionless.granular_bond_number(CASE.replace(radius=diameter / 2), 1e-19, gap)
    assert float(found) == pytest.approx(bond, rel=0.03)
    weight = 4 / 3 * 3.14159265 * (diameter / 2) ** 3 * (7470 - 950) * 9.81
    assert float(found) == pytest.approx(1e-19 * diameter / 4 / (6 * gap**2) / weight, rel=1e-2)


def test_typical_surfaces_are_said_where_none_are_stated():
    (note,) = attraction_notes.notes(CASE)
    assert "is 4.9e+04 with bare surfaces, 4.9e+02 with layers of 2 nm (oleic acid)" in note
    assert "below a layer of 44 nm on each surface it is above 1" in note
    (several,) = attraction_notes.notes(CASE.replace(radius=np.array([1e-6, 2e-6])))
    assert "4.9e+04 to 1.9e+05 with bare" in several
    assert attraction_notes.notes(CASE.replace(gravity=0.0)) == []


@pytest.mark.parametrize(
    "layer, bond, effect",
    [
        (200e-9, "0.049", "attraction hardly matters"),
        (60e-9, "0.54", "attraction is weaker than gravity"),
        (20e-9, "4.9", "the bed is looser the larger it is"),
        (None, "4.9e+04", "from 10 on a bed hardly becomes looser"),
    ],
)
def test_the_effect_of_a_stated_attraction_is_said(layer, bond, effect):
    (note,) = attraction_notes.notes(CASE, 1e-19, layer)
    assert f"over net weight) is {bond}, with a Hamaker constant of 1e-19 J" in note
    assert effect in note


def test_a_stated_attraction_is_in_the_notes_of_a_sheet():
    sheet = mrjax.Recipe.load("case2").replace(attraction={"hamaker": 1e-19})
    bond = mrjax.bond_number(sheet.parameters())
    (note,) = (note for note in derived.notes(sheet) if f"net weight) is {bond:.2g}, with" in note)
    assert "layers of 0.2 nm, assumed for bare surfaces:" in note
    stated = sheet.replace(attraction={"layer_thickness": 2e-10})
    assert not any("assumed for bare" in note for note in derived.notes(stated))
