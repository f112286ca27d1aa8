"""The input of a forward model: a recipe with fitted values in place of its own."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import jax
import jax.numpy as jnp
from jax import Array
from jax.tree_util import Partial
from jax.typing import ArrayLike

from mrjax import InputError, Parameters, Recipe
from mrjax.continuum.compression import Compression, densest_bed, full_of_flocs
from mrjax.laws.closures import table
from mrjax.laws.hindrance import Hindrance
from mrjax.recipe.sheets import did_you_mean

BED = "bed_fraction"
CLOSURE = "f_w."
"""Prefix of the name of a coefficient of the closure: `f_w.exponent`."""
FLOC_VOLUME = "floc_volume"
COMPRESSION = ("compression.gel_fraction", "compression.stress", "compression.exponent")
"""The coefficients of a yielding bed."""
SPREAD = "geometric_standard_deviation"
"""The spread of the diameters about that of a recipe of one size."""
TILT = "tilt"
LARGEST_TILT = 60.0
"""Tilt of a tube, degrees, up to which its rate of settling is known."""
TUBE = (*COMPRESSION, "delay", TILT)
"""Quantities of a tube beside the volume fraction of its bed."""
FACTORS = ("f_w", "f_s", "f_v", "f_r")
"""The leaves that are fitted most often."""
LEAVES = tuple(leaf.name for leaf in fields(Parameters))


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Suspension:
    """A dispersed suspension, with the volume fraction of its bed at rest."""

    parameters: Parameters
    """Parameters; a closure gives f_w at the volume fraction of the suspension."""
    volume_fraction: Array
    """Volume fraction of the coated particles when dispersed, ()."""
    bed_fraction: ArrayLike | None
    """Volume fraction of the coated particles in the bed at rest, (); None if unknown."""
    hindrance: Hindrance | None
    """Function from volume fraction to f_w, for local drag; None without local drag."""
    closure: Hindrance | None = None
    """Function from volume fraction to f_w; None if f_w is a number."""
    compression: Compression | None = None
    """Effective solid stress of the bed; None for a rigid bed."""
    delay: ArrayLike | None = None
    """Time scale of aggregation at the start, s, (); None without a delay."""
    tilt: ArrayLike | None = None
    """Angle of the tube from the vertical, degrees, (); None for an upright tube."""
    spread: ArrayLike | None = None
    """Geometric standard deviation of the diameters, log-normal by volume, about the median of the
    recipe; 1, (). None for the sizes of the recipe."""

    def at(self, volume_fraction: ArrayLike) -> "Suspension":
        """The same particles in another amount of fluid.

        Args:
          volume_fraction: of the uncoated particles, ().
        """
        fraction = jnp.asarray(volume_fraction, float) * self.parameters.f_r**3
        if self.closure is None:
            return replace(self, volume_fraction=fraction)
        parameters = self.parameters.replace(f_w=self.closure(fraction))
        return replace(self, parameters=parameters, volume_fraction=fraction)


def suspension(
    recipe: Recipe, bed_fraction: ArrayLike | None, changes: Mapping[str, ArrayLike]
) -> Suspension:
    """The suspension of a recipe with some quantities changed.

    Args:
      recipe: the lab sheet.
      bed_fraction: volume fraction of the bed at rest, unless it is changed.
      changes: new values by name: a leaf of `Parameters`, a coefficient of the recipe's closure of
        f_w (`f_w.exponent`), `bed_fraction`, `SPREAD`, or a quantity of the tube (`TUBE`).
    """
    leaves = {name: value for name, value in changes.items() if name in LEAVES}
    coefficients = {
        name.removeprefix(CLOSURE): value
        for name, value in changes.items()
        if name.startswith(CLOSURE)
    }
    parameters = recipe.parameters().replace(**leaves)
    fraction = recipe.volume_fraction * jnp.asarray(parameters.f_r, float) ** 3
    closure = recipe.closure
    if closure is not None:
        closure = Partial(closure.func, **{**closure.keywords, **coefficients})
        if "f_w" not in leaves:
            parameters = parameters.replace(f_w=closure(fraction))
    compression = None
    if all(name in changes for name in COMPRESSION):
        compression = Compression(
            **{name.removeprefix("compression."): changes[name] for name in COMPRESSION}
        )
    bed = changes.get(BED, bed_fraction)
    if bed is None and compression is not None:
        bed = densest_bed(closure)
    if BED in changes and FLOC_VOLUME in coefficients:
        # A fit of both stays where the closure holds: flocs fill the bed, and no bed is denser.
        bed = jnp.minimum(bed, full_of_flocs(coefficients[FLOC_VOLUME]))
    return Suspension(
        parameters,
        fraction,
        bed,
        closure if recipe.drag.local else None,
        closure,
        compression,
        changes.get("delay"),
        changes.get(TILT),
        changes.get(SPREAD),
    )


def refuse_unknown(name: str, recipe: Recipe, parameters: Parameters) -> None:
    """Refuses a name that is no quantity of the recipe, or one with several values.

    Args:
      name: name of the quantity.
      recipe, parameters: the lab sheet, and its parameters.

    Raises:
      InputError: the name cannot be used; the message has the known names.
    """
    if name == BED or name in TUBE:
        return
    if name == SPREAD:
        if jnp.ndim(parameters.radius):
            raise InputError(
                f"the recipe {recipe.name} states its sizes; give [particle] one diameter, the "
                "median, to fit their spread"
            )
        return
    if name.startswith(CLOSURE):
        known = _coefficients(recipe)
        if not known:
            raise InputError(
                f"f_w of the recipe {recipe.name} is a number, without coefficients; name a "
                "closure in [drag]"
            )
        if name not in known:
            raise InputError(f"its closure has no such coefficient; known: {', '.join(known)}")
        return
    if name not in LEAVES:
        known = [*FACTORS, BED, *TUBE, SPREAD, *_coefficients(recipe)]
        raise InputError(
            f"no such quantity; {did_you_mean(name, [*known, *LEAVES])}known: {', '.join(known)}, "
            "and the other leaves of mrjax.Parameters"
        )
    if getattr(parameters, name) is None:
        raise InputError(
            f"the recipe {recipe.name} has no {name}; state it in [fluid], and a consistency in "
            "place of the viscosity for a flow_index"
        )
    if jnp.ndim(getattr(parameters, name)):
        raise InputError(
            f"the recipe {recipe.name} has more than one value of it, for sizes or surfaces; fit "
            "another"
        )
    if name == "f_w" and recipe.drag.local:
        raise InputError(
            f"the recipe {recipe.name} has local drag, where f_w is a function; fit a coefficient: "
            f"{', '.join(_coefficients(recipe))}"
        )


def _coefficients(recipe: Recipe) -> list[str]:
    if recipe.closure is None:
        return []
    return [CLOSURE + name for name in table.coefficients(recipe.closure.func)]
