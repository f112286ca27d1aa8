"""Keys that a simulation of particles needs, and those that it cannot take.

It needs moduli and a box that holds some particles, and a Newtonian fluid.

The drag, the velocity and the column of a suspension do not need them.
"""

from mrjax.core.errors import InputError
from mrjax.recipe.materials import MATERIALS
from mrjax.recipe.suspension import MOST_PARTICLES, Suspension
from mrjax.recipe.tables import MODULI, Coating, Particle


def missing(recipe: Suspension) -> str | None:
    """Returns a message on a key that a simulation of particles lacks; None if it lacks none."""
    fluid = recipe.fluid
    for key in ("yield_stress", "flow_index", "yield_growth"):
        if getattr(fluid, key) not in (None, 1.0 if key == "flow_index" else 0.0):
            return (
                f"fluid.{key} = {getattr(fluid, key)}: particles in contact are simulated in a "
                "Newtonian fluid only; use mrjax.column, or fit with the models column or "
                "closed-form"
            )
    table, surface = _surface(recipe)
    for key in MODULI:
        if getattr(surface, key) is None:
            materials = " or ".join(f'"{name}"' for name in MATERIALS)
            return (
                f"{table}.{key} is missing, which particles in contact need; give "
                f"{type(surface).model_fields[key].description}, or {table}.material = {materials}"
            )
    count, size = recipe.particle_count, list(recipe.box.size)
    if count > MOST_PARTICLES:
        return (
            f"box.size = {size}: holds {count:.3g} particles, more than can be run; give a smaller "
            "box, in m: 25 um is 25e-6"
        )
    if count < 1:
        return (
            f"box.size = {size}: holds {recipe.volume_fraction:.3g} of its volume "
            "in particles, less than one particle; give a larger box, or none to have one chosen"
        )
    return None


def refuse_missing(recipe: Suspension) -> None:
    """Refuses a recipe that lacks a key for a simulation of particles.

    Raises:
      InputError: a key is missing, or the box does not hold a suitable number of particles.
    """
    if line := missing(recipe):
        raise InputError(f"recipe {recipe.name!r}: {line}")


def notes(recipe: Suspension) -> list[str]:
    """Returns notes on the assumptions for particles in contact."""
    table, surface = _surface(recipe)
    lines = []
    assumed = [key for key in MODULI if surface.material and key not in surface.stated]
    if surface.material and assumed:
        values = " and ".join(f"{table}.{key} = {getattr(surface, key):.3g}" for key in assumed)
        lines.append(
            f"{values}: assumed for a {surface.material}, "
            f"values of {MATERIALS[surface.material].example}"
        )
    attraction, wall = recipe.attraction, recipe.wall
    if attraction and attraction.hamaker and (wall is None or wall.hamaker is None):
        lines.append(
            "the walls attract particles as strongly as particles attract each other, and some "
            "stay at the sides and the lid; wall.hamaker = 0 lets them fall"
        )
    if "box" not in recipe.stated:
        size = " x ".join(f"{1e6 * length:.4g}" for length in recipe.box.size)
        lines.append(
            f"no box is given: one of {size} um is chosen for {recipe.particle_count} particles, "
            "periodic at its sides"
        )
    return lines


def _surface(recipe: Suspension) -> tuple[str, Particle | Coating]:
    """Returns the name and the table of the outer material of a particle."""
    return ("coating", recipe.coating) if recipe.coating else ("particle", recipe.particle)
