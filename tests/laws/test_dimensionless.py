"""Reynolds', Stokes' and Peclet's number by their definitions, and where the model ends."""

from functools import partial

import numpy as np
import pytest

import mrjax
from mrjax.laws import dimensionless, particle

near = partial(pytest.approx, abs=0.0)


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


def test_the_fluid_meets_the_coated_particle():
    """With its coated size, in the fluid that additives have thickened; for each velocity."""
    coated = spheres(4e-6).replace(f_r=1.25, f_v=2.0)
    found = mrjax.reynolds_number(np.array([1e-6, 3e-6]), coated)
    np.testing.assert_allclose(found, 950.0 * np.array([1e-6, 3e-6]) * 5e-6 / 0.02, rtol=1e-12)
    reynolds, stokes, peclet = dimensionless.numbers(coated, -1e-6, temperature=300.0)
    assert reynolds.value == near(950.0 * 1e-6 * 5e-6 / 0.02, rel=1e-12)
    response = float(particle.inertia(coated)) / (6 * np.pi * 0.02 * 2.5e-6)
    assert stokes.value == near(response * 1e-6 / 2.5e-6, rel=1e-12)
    weight = float(particle.net_weight(coated))
    assert peclet.value == near(weight * 2.5e-6 / (1.380649e-23 * 300.0), rel=1e-12)


def test_bounds_are_probed_from_both_sides():
    for at_most, inside, outside in ((True, 0.999, 1.0), (False, 1.0, 0.999)):
        below, above = (
            dimensionless.Number("Some", value, 1.0, at_most, "what is left out")
            for value in (inside, outside)
        )
        assert below.warning is None
        side = "above" if at_most else "below"
        assert above.warning == f"Some number {outside:.2g} is {side} 1: what is left out"
        assert dimensionless.warnings([below, above, below]) == [above.warning]


def test_the_numbers_in_words_say_where_the_model_holds():
    said = dimensionless.in_words(dimensionless.numbers(spheres(4e-6), 1e-7, temperature=300.0))
    assert said == "Reynolds 3.8e-08 (below 0.1), Stokes 3.5e-08 (below 1), Peclet 1e+03 (above 10)"
