"""The table [magnetism]: its leaves, what is refused, and the notes of `mrjax check`."""

import numpy as np
import pytest

import mrjax
from mrjax.recipe import magnetism_notes
from mrjax.simulation import derived

CASE = mrjax.Recipe.load("case2")


def test_the_keys_become_leaves():
    table = {
        "remanence": 1e3, "field": [0.0, 10.0, 1e4], "susceptibility": 50.0, "saturation": 1.7e6
    }  # fmt: skip
    parameters = CASE.replace(magnetism=table).parameters()
    for name, value in table.items():
        assert np.array_equal(getattr(parameters, name), value)
    assert CASE.parameters().remanence is CASE.parameters().field is None
    some = CASE.replace(magnetism={"remanence": 1e3}).parameters()
    assert some.susceptibility is some.saturation is some.field is None


@pytest.mark.parametrize(
    "table, words",
    [
        ({}, "magnetism.remanence is missing"),
        ({"field": [0.0, 0.0, 1e4]}, "magnetism.susceptibility is missing"),
        ({"field": [0.0, 1e4], "susceptibility": 1.0}, "three components"),
        ({"field": [0.0, 0.0, 1e9], "susceptibility": 1.0}, "7.96e5"),
        ({"remanence": -1.0}, "at least 0"),
        ({"remanence": 1e9}, "1 emu/cm"),
        ({"remanence": 1e3, "saturation": 1e6}, "needs susceptibility"),
        ({"remanence": 1e6, "susceptibility": 1.0, "saturation": 1e5}, "above the saturation"),
        ({"remanence": 1e3, "fields": 1.0}, "fields"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(table, words):
    with pytest.raises(mrjax.InputError, match="magnetism") as error:
        CASE.replace(magnetism=table)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_remanence_gives_directions_by_the_seed():
    sheet = CASE.replace(magnetism={"remanence": 1e3}, box={"size": [12e-6] * 3})
    first, again, other = (
        mrjax.disperse(sheet, seed).memory["remanence_direction"] for seed in (0, 0, 1)
    )
    assert np.array_equal(first, again) and not np.any(first == other)
    assert not mrjax.disperse(sheet.replace(magnetism=None)).memory


@pytest.mark.parametrize(
    "remanence, bond, effect",
    [
        (100.0, "0.012", "hardly matters"),
        (5e2, "0.31", "weaker than gravity"),
        (3e3, "11", "holds together"),
    ],
)
def test_check_says_the_magnetic_bond_number_and_the_coupling(remanence, bond, effect):
    notes = derived.notes(CASE.replace(magnetism={"remanence": remanence}))
    (line,) = (note for note in notes if "magnetic Bond number" in note)
    assert f"is {bond}: " in line and effect in line
    (line,) = (note for note in notes if "dipolar coupling" in note)
    assert "over kT" in line and "chains form" in line


def test_nothing_is_said_without_magnetism_and_the_cost_of_many_particles_is():
    assert not magnetism_notes.notes(CASE.parameters(), 293.15, 5000)
    magnetic = CASE.parameters().replace(remanence=1e3)
    assert "100 times as long" in magnetism_notes.notes(magnetic, 293.15, 5000)[-1]
