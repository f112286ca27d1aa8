"""Assumptions for what a sheet leaves open: properties of its liquid, the box of its particles."""

import math

import numpy as np

from mrjax.core.box import Box
from mrjax.laws import water
from mrjax.recipe.suspension import CHOSEN_PARTICLES, Suspension
from mrjax.recipe.tables import Fluid

SLENDER = 2.0
"""Height of a chosen box over its width, as of the boxes of the bundled sheets."""
NARROWEST = 4.0
"""Width of a chosen box, in largest diameters: none of its particles meets two images of another.
"""
MOST_CHOSEN = 10**5
"""Particles of a chosen box; more would be needed only where a few hold all the volume."""


def fluid(sheet: Fluid, temperature: float) -> Fluid:
    """The fluid with what its liquid gives at a temperature in K.

    Raises:
      ValueError: the liquid would be frozen, or boil.
    """
    if sheet.liquid is None:
        return sheet
    if not water.FREEZING <= temperature <= water.BOILING:
        raise ValueError(
            f"temperature = {temperature:g}: water is liquid from {water.FREEZING:g} to "
            f"{water.BOILING:g}; give K: 20 degrees Celsius are 293.15"
        )
    found = sheet.model_copy()
    of_water = {"density": water.density, "viscosity": water.viscosity}
    found.assume(
        **{key: law(temperature) for key, law in of_water.items() if key not in sheet.stated}
    )
    return found


def box(recipe: Suspension) -> Box:
    """A box for `CHOSEN_PARTICLES`, periodic at its sides, with a floor and a lid.

    Nobody stated walls, so that none hinders the particles at the sides. A spread of sizes takes
    more particles where the largest would not fit otherwise.
    """
    count = CHOSEN_PARTICLES
    while True:
        diameters = _diameters(recipe, count)
        solid = math.pi / 6.0 * float(np.sum(diameters**3))
        width = (solid / recipe.volume_fraction / SLENDER) ** (1 / 3)
        largest = float(diameters[-1]) * recipe.radius_factor
        if width >= NARROWEST * largest or count >= MOST_CHOSEN:
            return Box((width, width, SLENDER * width), (True, True, False))
        count *= 2


def _diameters(recipe: Suspension, count: int) -> np.ndarray:
    diameter = recipe.particle.diameter
    return np.full(count, diameter) if isinstance(diameter, float) else diameter.sample(count)


def notes(recipe: Suspension) -> list[str]:
    """Remarks on what was assumed of the liquid."""
    found = recipe.fluid
    if found.liquid is None:
        return []
    values = {"density": f"{found.density:.6g} kg/m^3", "viscosity": f"{found.viscosity:.4g} Pa s"}
    assumed = [f"{key} {value}" for key, value in values.items() if key not in found.stated]
    if not assumed:
        return []
    return [f"{found.liquid} at {recipe.temperature:g} K has {' and '.join(assumed)}"]
