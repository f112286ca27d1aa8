"""Notes on Brownian motion: weight against thermal energy."""

from mrjax.laws.dimensionless import LEAST_PECLET
from mrjax.recipe.suspension import Suspension


def notes(recipe: Suspension) -> list[str]:
    """Returns a note on the Peclet number and on what it means; none without gravity.

    Args:
      recipe: the lab sheet.
    """
    peclet = recipe.peclet_number
    if not peclet:
        return []
    number = (
        f"the Peclet number (net weight times radius over thermal energy, at "
        f"{recipe.temperature:g} K) is {peclet:.2g}"
    )
    if recipe.brownian_motion:
        height = 1e6 * recipe.largest_diameter / 2.0 / peclet
        return [
            f"{number}, and Brownian motion is on: above its bed the suspension thins by a factor "
            f"of e within about {height:.2g} um"
        ]
    if peclet >= LEAST_PECLET:
        return [f"{number}: Brownian motion, which is off, hardly matters"]
    return [
        f"{number}, and Brownian motion is off, though it keeps such particles from packing: "
        "[brownian] on = true"
    ]
