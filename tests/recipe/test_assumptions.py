"""What a sheet leaves to be assumed: water, and a box for its particles."""

from functools import partial

import numpy as np
import pytest

import mrjax
from mrjax.laws import water

near = partial(pytest.approx, rel=1e-12, abs=0.0)  # its own abs passes all within 1e-12

CHALK = {
    "name": "chalk",
    "particle": {"density": 2150.0, "diameter": 2e-5},
    "composition": {"volume_fraction": 0.04},
}
WATER = {**CHALK, "fluid": {"liquid": "water"}}
OIL = {**CHALK, "fluid": {"density": 950.0, "viscosity": 0.01}}


# Water ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("temperature", [None, 275.0, 353.15])
def test_water_has_density_and_viscosity_of_the_temperature(temperature):
    recipe = mrjax.Recipe(**WATER, **({"temperature": temperature} if temperature else {}))
    kelvin = temperature or 293.15
    parameters = recipe.parameters()
    assert float(parameters.fluid_density) == near(water.density(kelvin))
    assert float(parameters.viscosity) == near(water.viscosity(kelvin))
    assert recipe.fluid.density == near(water.density(kelvin))
    (note,) = recipe.notes
    assert note.startswith(f"water at {kelvin:g} K has density ")


def test_what_is_stated_of_a_liquid_counts():
    recipe = mrjax.Recipe(**CHALK, fluid={"liquid": "water", "viscosity": 0.0012})
    assert (recipe.fluid.viscosity, recipe.fluid.density) == (0.0012, near(water.density(293.15)))
    assert recipe.notes == ["water at 293.15 K has density 998.204 kg/m^3"]
    both = mrjax.Recipe(**CHALK, fluid={"liquid": "water", "viscosity": 0.0012, "density": 1025})
    assert both.notes == [] and both.fluid.density == 1025


def test_water_follows_a_temperature_that_is_replaced():
    recipe = mrjax.Recipe(**WATER)
    warm = recipe.replace(temperature=333.15)
    assert warm.fluid.viscosity == near(water.viscosity(333.15))
    assert recipe.fluid.viscosity == near(water.viscosity(293.15))
    assert warm.replace(temperature=293.15) == recipe
    assert mrjax.Recipe(**OIL).replace(fluid={"liquid": "water"}).fluid == recipe.fluid
    thick = recipe.replace(fluid={"viscosity": 0.1})
    assert (thick.fluid.viscosity, thick.fluid.density) == (0.1, recipe.fluid.density)


@pytest.mark.parametrize(
    "sheet, changes, begins",
    [
        (WATER, {"temperature": 20}, "temperature = 20: water is liquid from 273.15 to 373.15"),
        (WATER, {"temperature": 400.0}, "temperature = 400: water is liquid"),
        (OIL, {"temperature": 20}, "temperature = 20.0: no suspension is so cold; give K"),
        (OIL, {"temperature": -5.0}, "temperature = -5.0: must be greater than 0; give the temp"),
        (OIL, {"fluid": {"liquid": "oil"}}, "fluid.liquid = 'oil': must be 'water'"),
        (OIL, {"fluid": {}}, "fluid.density is missing; give the density in kg/m^3, above zero, "
         'or liquid = "water"'),
        (OIL, {"fluid": {"density": 950.0}}, "fluid.viscosity is missing; give the viscosity in"),
    ],
)  # fmt: skip
def test_a_fluid_that_is_not_known_gets_one_line(sheet, changes, begins):
    with pytest.raises(mrjax.InputError) as refusal:
        mrjax.Recipe(**{**sheet, **changes})
    message = str(refusal.value)
    assert message.startswith(begins) and "\n" not in message, message


# The box ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fraction", [1e-6, 0.04, 0.6])
def test_a_box_of_300_particles_is_chosen(fraction):
    recipe = mrjax.Recipe(**{**OIL, "composition": {"volume_fraction": fraction}})
    width, depth, height = recipe.box.size
    assert width == depth and height == near(2.0 * width)
    assert recipe.box.periodic == (True, True, False)
    assert recipe.particle_count == 300
    assert fraction * recipe.box.volume == near(300 * np.pi / 6 * 2e-5**3)


def test_a_chosen_box_follows_what_is_replaced_and_a_stated_one_stays(case2):
    recipe = mrjax.Recipe(**OIL)
    dense = recipe.replace(composition={"volume_fraction": 0.32})
    assert dense.box.volume == near(recipe.box.volume / 8.0)
    stated = recipe.replace(box={"size": [1e-3, 1e-3, 1e-3]})
    assert stated.replace(composition={"volume_fraction": 0.32}).box == stated.box
    assert case2.replace(gravity=1.0).box == case2.box
    assert stated.contact_notes == [] != recipe.contact_notes


@pytest.mark.parametrize(
    "diameter",
    [
        {"median": 2e-5, "geometric_standard_deviation": 1.3},
        {"d10": 5e-6, "d50": 2e-5, "d90": 5e-5},
        {"values": [1e-6, 3e-5], "fractions": [0.5, 0.5], "by": "volume"},
    ],
)
def test_the_largest_of_a_spread_of_sizes_fits_into_a_chosen_box(diameter):
    recipe = mrjax.Recipe(**{**OIL, "particle": {"density": 2150.0, "diameter": diameter}})
    solid = np.pi / 6 * (recipe.diameters**3).sum()
    assert solid == pytest.approx(0.04 * recipe.box.volume, rel=0.02)
    assert recipe.particle_count >= 299
    assert min(recipe.box.size) >= 3.9 * recipe.largest_diameter


def test_a_chosen_box_takes_the_particles_that_it_was_chosen_for():
    recipe = mrjax.Recipe(**OIL).replace(particle={"material": "mineral"})
    assert mrjax.disperse(recipe).position.shape == (300, 3)
