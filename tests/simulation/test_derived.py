"""What follows from a lab sheet, and where the model's assumptions end."""

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
    # 6.66e-13 N of net weight times 2e-6 m over k T.
    assert found["Peclet number"] == near(1041, rel=1e-3)
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


def test_contacts_too_viscous_for_any_step_are_refused(case2):
    viscous = case2.replace(
        gravity=1e9, contact={"dissipation": 1e3}, drag={"f_w": 1e-6, "f_s": 1e-6, "f_v": 1e-6}
    )
    with pytest.raises(mrjax.InputError, match="no step is stable: give less dissipation"):
        derived.derived(viscous)
