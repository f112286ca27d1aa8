"""What follows from a lab sheet, and where the model's assumptions end."""

from functools import partial

import numpy as np
import pytest

import mrjax
from mrjax.laws import dimensionless, particle
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


@pytest.mark.parametrize("name, steps, seconds", [("case2", 176580, 606), ("case3", 133560, 817)])
def test_the_cost_of_a_run_to_rest_is_about_right(name, steps, seconds):
    """Against runs to rest with the first seed."""
    found = of(Recipe.load(name))
    assert found["steps of a run to rest, about"] == near(steps, rel=0.2)
    assert found["duration of a run to rest, about"] == near(seconds, rel=0.2)


def spheres(diameter, viscosity=0.01):
    return mrjax.Parameters(
        radius=0.5 * diameter, particle_density=7470.0, fluid_density=950.0, viscosity=viscosity,
        elastic_modulus=2e11, poisson_ratio=0.3,
    ).astype(float)  # fmt: skip


def test_numbers_are_those_of_their_definitions():
    fine = spheres(4e-6)
    reynolds, stokes, peclet = dimensionless.numbers(fine, 1e-6, temperature=300.0)
    assert reynolds.value == near(950.0 * 1e-6 * 4e-6 / 0.01, rel=1e-12)
    response = float(particle.inertia(fine)) / (6 * 3.141592653589793 * 0.01 * 2e-6)
    assert stokes.value == near(response * 1e-6 / 2e-6, rel=1e-12)
    weight = float(particle.net_weight(fine))
    assert peclet.value == near(weight * 2e-6 / (1.380649e-23 * 300.0), rel=1e-12)


@pytest.mark.parametrize(
    "diameter, viscosity, warned",
    [
        (4e-6, 0.01, set()),
        (0.2e-6, 0.01, {"Peclet"}),
        (1e-3, 0.01, {"Reynolds", "Stokes"}),
        (1e-3, 1.0, set()),
    ],
)
def test_warnings_where_the_model_ends(diameter, viscosity, warned):
    parameters = spheres(diameter, viscosity)
    velocity = mrjax.terminal_velocity(parameters)
    found = dimensionless.numbers(parameters, velocity)
    assert {one.name for one in found if one.warning} == warned
    for one in found:
        if one.warning:
            assert f"{one.name} number {one.value:.2g} is" in one.warning


def test_the_worst_particle_of_many_counts():
    many = spheres(4e-6).replace(radius=np.array([2e-6, 0.1e-6, 0.5e-3]))
    reynolds, stokes, peclet = dimensionless.numbers(many, mrjax.terminal_velocity(many))
    assert reynolds.warning and stokes.warning and peclet.warning


def test_contacts_too_viscous_for_any_step_are_refused(case2):
    viscous = case2.replace(
        gravity=1e9, contact={"dissipation": 1e3}, drag={"f_w": 1e-6, "f_s": 1e-6, "f_v": 1e-6}
    )
    with pytest.raises(mrjax.InputError, match="no step is stable: give less dissipation"):
        derived.derived(viscous)


def test_the_numbers_in_words_say_where_the_model_holds():
    said = dimensionless.in_words(dimensionless.numbers(spheres(4e-6), 1e-7, temperature=300.0))
    assert said == "Reynolds 3.8e-08 (below 0.1), Stokes 3.5e-08 (below 1), Peclet 1e+03 (above 10)"
