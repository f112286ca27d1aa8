"""Assumptions for keys that a sheet does not state: properties of its liquid, and its box."""

import math

import numpy as np

from mrjax.core.box import Box
from mrjax.laws import water
from mrjax.recipe.suspension import CHOSEN_PARTICLES, Suspension
from mrjax.recipe.tables import Fluid

SLENDER = 2.0
"""Height of a chosen box over its width, as in the bundled sheets."""
NARROWEST = 4.0
"""Least width of a chosen box, in largest diameters, so that no particle touches two images of
another."""
MOST_CHOSEN = 10**5
"""Largest number of particles of a chosen box; only very wide size distributions would need more.
"""


def fluid(sheet: Fluid, temperature: float) -> Fluid:
    """Returns the fluid with the density and viscosity of its liquid at a temperature in K.

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
    completed = sheet.model_copy()
    laws = {"density": water.density, "viscosity": water.viscosity}
    completed.assume(
        **{key: law(temperature) for key, law in laws.items() if key not in _stated(sheet)}
    )
    return completed


def box(recipe: Suspension) -> Box:
    """Returns a box for `CHOSEN_PARTICLES` with periodic sides, a floor and a lid.

    Without stated walls, no wall hinders the particles at the sides. A wide size distribution gets
    more particles if the largest would not fit otherwise.
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


def _stated(sheet: Fluid) -> set[str]:
    """Keys that the sheet states; a consistency stands in place of the viscosity."""
    return {"viscosity" if key == "consistency" else key for key in sheet.stated}


def _diameters(recipe: Suspension, count: int) -> np.ndarray:
    diameter = recipe.particle.diameter
    return np.full(count, diameter) if isinstance(diameter, float) else diameter.sample(count)


def notes(recipe: Suspension) -> list[str]:
    """Returns notes on the assumed properties of the liquid."""
    fluid = recipe.fluid
    if fluid.liquid is None:
        return []
    values = {"density": f"{fluid.density:.6g} kg/m^3", "viscosity": f"{fluid.viscosity:.4g} Pa s"}
    assumed = [f"{key} {value}" for key, value in values.items() if key not in _stated(fluid)]
    if not assumed:
        return []
    return [f"{fluid.liquid} at {recipe.temperature:g} K has {' and '.join(assumed)}"]
