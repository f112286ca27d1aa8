"""What follows from a lab sheet, and where the model's assumptions end."""

import re
from functools import partial

import pytest

import mrjax
from mrjax.recipe.recipe import Recipe
from mrjax.simulation import derived

near = partial(pytest.approx, abs=0.0)


def of(recipe):
    return {one.name: one.value for one in derived.derived(recipe)}


def test_the_papers_second_case(case2):
    found = of(case2)
    assert found["particles in the box"] == 314  # Table 2
    assert found["volume fraction of particles"] == near(0.33718, rel=1e-5)
    assert found["settling velocity (Eq. 27)"] == near(9.1164, rel=1e-5)
    assert found["f_w, crowding"] == near(48.985, rel=1e-6)
    # 2.14e-12 N of net weight times 2e-6 m over k T at 293.15 K.
    assert found["Peclet number"] == near(1059, rel=1e-3)
    assert found["Reynolds number"] == near(4.0e-8, rel=1e-2)
    assert derived.warnings(case2) == []


def test_sizes_are_those_of_the_coated_particles(case3):
    """f_r times the smallest and the largest diameter; equal ones of the bundled sheet."""
    found = of(case3)
    assert found["smallest coated diameter"] == near(4.4, rel=1e-12)
    assert found["largest coated diameter"] == near(4.4, rel=1e-12)
    mixed = of(case3.replace(particle={"diameter": {"values": [3e-6, 4e-6, 5e-6]}}))
    assert found["f_r, coating"] == mixed["f_r, coating"] == near(1.1, rel=1e-12)
    assert mixed["smallest coated diameter"] == near(3.3, rel=1e-12)
    assert mixed["largest coated diameter"] == near(5.5, rel=1e-12)


@pytest.mark.parametrize("name, steps, seconds", [("case2", 176580, 606), ("case3", 133560, 817)])
def test_the_cost_of_a_run_to_rest_is_about_right(name, steps, seconds):
    """Against runs to rest with the first seed."""
    found = of(Recipe.load(name))
    assert found["steps of a run to rest, about"] == near(steps, rel=0.2)
    assert found["duration of a run to rest, about"] == near(seconds, rel=0.2)


CHALK = mrjax.Recipe(
    name="chalk",
    particle={"density": 2150.0, "diameter": 2e-5},
    fluid={"density": 1000.0, "viscosity": 0.001},
    composition={"particle": 0.085, "fluid": 0.915},
)
OF_CONTACTS = {
    *("rayleigh_time", "time_step", "softening", "time_step_to_rest", "duration_to_rest"),
    *("steps_to_rest", "wall_time_to_rest"),
}


def test_what_only_contacts_have_is_left_out_where_moduli_are_missing():
    stone = CHALK.replace(particle={"material": "mineral"})
    whole = {one.key: one for one in derived.derived(stone)}
    found = {one.key: one for one in derived.derived(CHALK)}
    assert whole.keys() - found.keys() == OF_CONTACTS
    assert all(found[key] == whole[key] for key in found)
    assert found["settling_velocity"].value == near(
        # 2/9 (2150 - 1000) 9.81 (1e-5)^2 / 0.001 over f_w, Eq. 14 at 0.0414.
        86400e3 * 2.507e-4 / found["f_w"].value,
        rel=1e-6,
    )
    box, left_out, _, peclet, branch = derived.notes(CHALK)
    assert "below 1e+08, hindered settling is on the low branch" in branch
    assert box.startswith("no box is given: one of ") and "300 particles" in box
    assert left_out.startswith("times and steps of contacts are left out: particle.elastic_modulus")
    assumed, same_box, _, same_peclet, same_branch = derived.notes(stone)
    assert (same_box, same_peclet, same_branch) == (box, peclet, branch)
    assert "assumed for a mineral" in assumed


def test_what_only_contacts_have_is_left_out_where_a_box_holds_no_particle():
    dilute = CHALK.replace(
        particle={"elastic_modulus": 70e9, "poisson_ratio": 0.25},
        composition={"volume_fraction": 1e-6},
        box={"size": [1.2e-4, 1.2e-4, 2.4e-4]},
    )
    found = {one.key: one.value for one in derived.derived(dilute)}
    assert not OF_CONTACTS & found.keys()
    assert found["particles"] == 0 and found["largest_diameter"] == near(20.0, rel=1e-12)
    left_out, *_ = derived.notes(dilute)
    assert "box.size = [0.00012, 0.00012, 0.00024]: holds 1e-06 of its volume" in left_out


@pytest.mark.parametrize(
    "diameter, f_w, said",
    [
        (4e-6, "son2018", r"number of 1.1e\+03, below .* the low branch .* an exponent of 5\.6$"),
        (4e-4, "brzinski-durian", r"number of 1.1e\+11, above .* the high branch .* of 4\.48$"),
        (
            4e-6,
            "richardson-zaki",
            r"5\.6; 4\.65, that of its .*, is on neither branch$",
        ),
        (
            4e-6,
            {"closure": "richardson-zaki", "exponent": 4.48},
            r"4\.48, that of its richardson-zaki, is on the high branch$",
        ),
    ],
)
def test_the_branch_of_hindered_settling_is_said(case2, diameter, f_w, said):
    recipe = case2.replace(particle={"diameter": diameter}, drag={"f_w": f_w}, box=None)
    assert re.search(said, derived.notes(recipe)[-1])


def test_contacts_too_viscous_for_any_step_are_refused(case2):
    viscous = case2.replace(
        gravity=1e9, contact={"dissipation": 1e3}, drag={"f_w": 1e-6, "f_s": 1e-6, "f_v": 1e-6}
    )
    with pytest.raises(mrjax.InputError, match="no step is stable: give less dissipation"):
        derived.derived(viscous)


def test_the_peclet_number_is_that_of_the_temperature(case2):
    """In the table, in its warning, and on its branch."""
    hot = case2.replace(temperature=400.0)
    cold, warm = of(case2)["Peclet number"], of(hot)["Peclet number"]
    assert warm == near(cold * 293.15 / 400.0, rel=1e-12) == hot.peclet_number
    assert f"at a Peclet number of {warm:.2g}," in derived.notes(hot)[-1]
    tiny = case2.replace(particle={"diameter": 1.25e-6}, temperature=293.15, box=None)
    assert derived.warnings(tiny) == []  # 10.1
    (warning,) = derived.warnings(tiny.replace(temperature=310.0))
    assert warning.startswith("Peclet number 9.6 is below 10")


def test_a_tall_narrow_tube_is_warned_of(case2):
    assert not any("tilt" in line for line in derived.warnings(case2, 0.03, 0.1))
    assert not any("tilt" in line for line in derived.warnings(case2, 0.03))
    warned = derived.warnings(case2, 0.03, 0.3)
    assert len(warned) == len(derived.warnings(case2)) + 1
    assert "13 times as tall as the gap of its tube" in warned[-1]


def test_the_layers_of_a_tube_are_said_beside_those_of_the_box(case2):
    """0.1 m and 50 um over 4 um."""
    assert not any("diameters high" in note for note in derived.notes(case2))
    (note,) = [one for one in derived.notes(case2, None, 0.1) if "diameters high" in one]
    assert (
        "of 100 mm in its tube is 2.5e+04 diameters high, and that of the simulated box 12" in note
    )


@pytest.mark.parametrize(
    ("gel", "stress", "said"),
    [
        (0.2, 1e3, r"load over strength is 0\.\d+, it stands without settling"),
        (0.2, 10.0, r"load over strength is \d+\.?\d*, it settles until denser"),
        (0.4, 10.0, "there is no network: it settles until 0.4 at least"),
    ],
)
def test_a_network_that_bears_its_load_is_said_to_stand(case2, gel, stress, said):
    law = mrjax.Compression(gel_fraction=gel, stress=stress, exponent=6.0)
    assert not any("on its floor" in note for note in derived.notes(case2, None, None, law))
    (note,) = [one for one in derived.notes(case2, None, 0.1, law) if "on its floor" in one]
    # (7470 - 950) kg/m^3 x 9.81 m/s^2 x 0.337 x 0.1 m
    load = (7470.0 - 950.0) * 9.81 * case2.volume_fraction * 0.1
    assert f"weighs {load:.3g} Pa" in note and re.search(said, note)
    strength = stress * ((case2.volume_fraction / gel) ** 6 - 1.0)
    if strength > 0.0:
        assert f"bears {strength:.3g} Pa: load over strength is {load / strength:.3g}" in note
