"""Plausibility of a lab sheet: numbers in wrong units, and suspensions that cannot exist."""

import math

from mrjax.core.box import AXES
from mrjax.core.errors import shown
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.laws.closures.table import CLOSURES, valid_range
from mrjax.laws.hindrance import LARGEST_FRACTION
from mrjax.recipe.suspension import MOST_PARTICLES, Suspension
from mrjax.recipe.tables import LARGEST_FACTOR, LEAST_FACTOR

RANDOM_CLOSE_PACKING = 0.64
"""Volume fraction above which equal spheres cannot be dispersed (Desmond & Weeks, 0903.0864)."""

LEAST_DENSITY, LEAST_MODULUS, LEAST_TEMPERATURE = 10.0, 1e3, 100.0
"""Bounds in kg/m^3, Pa and K; a smaller number was given in another unit."""
LARGEST_DIAMETER, LARGEST_BOX = 0.1, 1e3
"""Bounds in m; a larger number was given in another unit."""

UNITS = {"concentration": " kg/m^3, which are g/L", "solids_ratio": " kg per kg of fluid"}
"""Units of the keys of the composition in messages."""
NEUTRAL = 1e-9
"""Relative difference of densities that counts as equal."""


def refuse_implausible(recipe: Suspension) -> None:
    """Refuses a suspension that cannot exist.

    Raises:
      ValueError: there is a fault; the message has the key, its value, the fault and the remedy.
    """
    _refuse_units(recipe)
    _refuse_coating(recipe)
    _refuse_bare(recipe)
    _refuse_wall(recipe)
    _refuse_neutral(recipe)
    _refuse_packing(recipe)
    _refuse_closure(recipe)
    _refuse_factors(recipe)


def notes(recipe: Suspension) -> list[str]:
    """Returns notes on inconsistent values that do not prevent a simulation."""
    weight, stated = recipe.composition.particle, recipe.composition.coating
    if not recipe.coating or weight is None:
        return []
    layer = recipe.coating.density * (recipe.radius_factor**3 - 1.0)
    needed = weight * layer / recipe.particle.density
    if needed <= stated * (1 + 1e-9):
        return []
    largest = (1.0 + stated / weight * recipe.particle.density / recipe.coating.density) ** (1 / 3)
    return [
        f"a coating of radius_factor {recipe.radius_factor:g} takes {needed:.2%} of the weight, "
        f"the composition holds {stated:.2%}, enough for {largest:.3f}"
    ]


def _refuse_units(recipe: Suspension) -> None:
    solids = {"particle": recipe.particle, "coating": recipe.coating, "wall": recipe.wall}
    materials = {name: table for name, table in solids.items() if table}
    for name, table in {**materials, "fluid": recipe.fluid}.items():
        density = getattr(table, "density", LEAST_DENSITY)
        if density < LEAST_DENSITY:
            raise ValueError(
                f"{name}.density = {density}: no solid or liquid is so light; give kg/m^3: "
                "7.47 g/cm^3 is 7470"
            )
    for name, table in materials.items():
        if table.elastic_modulus is not None and table.elastic_modulus < LEAST_MODULUS:
            raise ValueError(
                f"{name}.elastic_modulus = {table.elastic_modulus}: no solid is so soft; give "
                "Pa: 211 GPa is 211e9"
            )
    if recipe.temperature < LEAST_TEMPERATURE:
        raise ValueError(
            f"temperature = {recipe.temperature}: no suspension is so cold; give K: 20 degrees "
            "Celsius are 293.15"
        )
    diameter = recipe.particle.diameter
    typical = diameter if isinstance(diameter, float) else diameter.mean_cube ** (1 / 3)
    if typical > LARGEST_DIAMETER:
        raise ValueError(
            f"particle.diameter = {shown(diameter)}: too large for a suspension; give m: 4 "
            "um is 4e-6"
        )


def _refuse_coating(recipe: Suspension) -> None:
    composition = recipe.composition
    if recipe.radius_factor > 1 and composition.by_weight and composition.coating == 0:
        raise ValueError(
            "composition.coating is missing or 0, though [coating] has radius_factor = "
            f"{recipe.radius_factor}; give its weight fraction, or remove [coating]"
        )
    if composition.coating > 0 and not recipe.coating:
        raise ValueError(
            f"composition.coating = {composition.coating}: there is no table [coating]; "
            "add one, or set the fraction to 0"
        )


def _refuse_bare(recipe: Suspension) -> None:
    """Refuses to assume the layer of a bare surface on coated particles."""
    attraction = recipe.attraction
    if recipe.coating and attraction and "layer_thickness" not in attraction.stated:
        raise ValueError(
            "attraction.layer_thickness is missing, though there is a table [coating]: the default "
            f"of {attraction.layer_thickness:g} is for a bare surface; give that of one layer in m"
        )


def _refuse_wall(recipe: Suspension) -> None:
    for key in ("hamaker", "layer_thickness"):
        if recipe.wall and not recipe.attraction and getattr(recipe.wall, key) is not None:
            raise ValueError(
                f"wall.{key} = {getattr(recipe.wall, key)}: there is no table [attraction]; add "
                "one, or remove the key"
            )


def _refuse_packing(recipe: Suspension) -> None:
    limit = RANDOM_CLOSE_PACKING
    if recipe.volume_fraction >= limit:
        key = recipe.composition.key
        most = recipe.composition.stating(limit, recipe.phases)
        raise ValueError(
            f"composition.{key} = {getattr(recipe.composition, key)}: a volume fraction of "
            f"{recipe.volume_fraction:.3f} is denser than random close packing ({limit}); give "
            f"less than {most:.4g}{UNITS.get(key, '')}"
        )
    if recipe.coated_volume_fraction >= limit:
        most = (limit / recipe.volume_fraction) ** (1 / 3)
        raise ValueError(
            f"coating.radius_factor = {recipe.radius_factor}: the coated particles would take a "
            f"volume fraction of {recipe.coated_volume_fraction:.3f}, denser than random close "
            f"packing ({limit}); give less than {most:.3f}"
        )


def _refuse_neutral(recipe: Suspension) -> None:
    """Refuses particles of the density of the fluid, which neither settle nor cream."""
    if math.isclose(recipe.apparent_density, recipe.fluid.density, rel_tol=NEUTRAL):
        coated = " with their coating" if recipe.coating else ""
        raise ValueError(
            f"fluid.density = {recipe.fluid.density}: the particles, at "
            f"{recipe.apparent_density:.5g} kg/m^3{coated}, would neither sink nor rise; give "
            "another fluid or particle"
        )


def _refuse_closure(recipe: Suspension) -> None:
    sheet = recipe.drag.f_w
    name = sheet.get("closure") if isinstance(sheet, dict) else sheet
    if recipe.drag.local and (not isinstance(name, str) or name == "haberman-sayre"):
        raise ValueError(
            "drag.local = true: needs a closure that holds in the bed, not f_w = "
            f"{shown(name)}; give one of "
            + ", ".join(closure for closure in CLOSURES if closure != "haberman-sayre")
        )
    holds = valid_range(recipe.closure)
    fault = holds.fault(recipe.coated_volume_fraction) if holds else None
    if fault:
        raise ValueError(
            f"drag.f_w = {shown(name)}: not at {recipe.coated_volume_fraction:.4f}, it {fault}; "
            "give other coefficients, another closure or a number"
        )


def _refuse_factors(recipe: Suspension) -> None:
    factors = {"f_w": [recipe.f_w], "f_s": [recipe.f_s]}
    if recipe.hindrance and valid_range(recipe.hindrance) is None:
        factors["f_w"].append(float(evaluate_with_numpy(recipe.hindrance, LARGEST_FRACTION)))
    for name, values in factors.items():
        for value in values:
            if not LEAST_FACTOR <= value <= LARGEST_FACTOR:
                raise ValueError(
                    f"drag.{name} = {shown(getattr(recipe.drag, name))}: a factor of "
                    f"{value:.3g}; give one between {LEAST_FACTOR:g} and {LARGEST_FACTOR:g}"
                )


def refuse_box(recipe: Suspension) -> None:
    """Refuses a stated box into which its particles do not fit.

    A box with no particles, or with too many to simulate, passes: its particles are never used.

    Raises:
      ValueError: the box is too large or too narrow.
    """
    if max(recipe.box.size) > LARGEST_BOX:
        raise ValueError(
            f"box.size = {shown(list(recipe.box.size))}: too large for a suspension; give m: "
            "25 um is 25e-6"
        )
    size = list(recipe.box.size)
    if not 1 <= recipe.particle_count <= MOST_PARTICLES:
        return  # its particles are never simulated
    diameter = recipe.largest_diameter
    for axis, length, periodic in zip(AXES, recipe.box.size, recipe.box.periodic, strict=True):
        if periodic and length < 2.0 * diameter:
            raise ValueError(
                f"box.size = {size}: periodic along {axis} but narrower than two particles of "
                f"{diameter:.4g} m: one would touch two images of another; give a wider box, "
                "or walls"
            )
        if length <= diameter:
            raise ValueError(
                f"box.size = {size}: not larger along {axis} than a particle of "
                f"{diameter:.4g} m; give a larger box"
            )
