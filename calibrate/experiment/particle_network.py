"""The compression of a bed from the particles of its recipe: `compression = "particles"`."""

import mrjax
from mrjax import Recipe

_known: dict[str, dict[str, float]] = {}


def compression(recipe: Recipe) -> dict[str, float]:
    """The law of a bed of these particles, by the names of parameters of a tube.

    It is simulated by `mrjax.compressive_yield` with its defaults, which takes a minute or two,
    once for each recipe in a process.

    Args:
      recipe: lab sheet with `[attraction]`.

    Raises:
      InputError: the recipe has no attraction, or the box cannot be compressed.
      SimulationError: the box does not come to rest.
    """
    key = recipe.model_dump_json()
    if key not in _known:
        law = mrjax.compressive_yield(recipe).compression
        _known[key] = {
            "compression.gel_fraction": float(law.gel_fraction),
            "compression.stress": float(law.stress),
            "compression.exponent": float(law.exponent),
        }
    return _known[key]
