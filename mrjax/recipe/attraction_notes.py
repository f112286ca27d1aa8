"""Notes on the attraction of particles: pull-off force over net weight."""

import numpy as np

from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import dimensionless, particle
from mrjax.laws.attraction import BARE_LAYER

TYPICAL_HAMAKER = 1e-19
"""Hamaker constant of metals and oxides across oil or water, J: an order of magnitude."""
LAYERS = {"bare surfaces": BARE_LAYER, "oleic acid": 2e-9, "guar gum": 200e-9}
"""Thickness of typical layers on one surface, m."""
WEAK, STICKY, SATURATED = 0.1, 1.0, 10.0
"""Bond numbers below which attraction does not matter, from which particles stick to each other,
and from which beds hardly become looser."""


def notes(
    parameters: Parameters,
    hamaker: float | None = None,
    layer_thickness: float | None = None,
) -> list[str]:
    """Returns notes on the attraction of particles; none without gravity.

    Args:
      parameters: particles and fluid, leaves () or (N,).
      hamaker: Hamaker constant, J; None if the sheet states none.
      layer_thickness: thickness of the layer on one surface, m; None if the sheet states none,
        for bare surfaces.
    """
    if not np.any(evaluate_with_numpy(particle.net_weight, parameters)):
        return []
    if hamaker is None:
        return [_typical(parameters)]
    return [_stated(parameters, hamaker, layer_thickness)]


def _typical(parameters: Parameters) -> str:
    """A note on the attraction that typical surfaces would have."""
    bonds = ", ".join(
        f"{_range(_bonds(parameters, TYPICAL_HAMAKER, layer))} with "
        + (name if layer == BARE_LAYER else f"layers of {1e9 * layer:g} nm ({name})")
        for name, layer in LAYERS.items()
    )
    thickest = _layer_of_bond_one(parameters, TYPICAL_HAMAKER)
    return (
        f"with a Hamaker constant of {TYPICAL_HAMAKER:g} J, that of metals in oil to an order of "
        f"magnitude, the granular Bond number (pull-off force over net weight) is {bonds}; below a "
        f"layer of {1e9 * thickest:.2g} nm on each surface it is above 1, and particles stick to "
        "each other"
    )


def _stated(parameters: Parameters, hamaker: float, layer_thickness: float | None) -> str:
    """A note on the attraction of a sheet."""
    layer = BARE_LAYER if layer_thickness is None else layer_thickness
    assumed = ", assumed for bare surfaces" if layer_thickness is None else ""
    bonds = _bonds(parameters, hamaker, layer)
    largest = float(bonds.max())
    if largest < WEAK:
        effect = "attraction hardly matters"
    elif largest < STICKY:
        effect = "attraction is weaker than gravity; it may slow the rearrangement of a bed"
    elif largest < SATURATED:
        effect = "particles stick to each other, and the bed is looser the larger it is"
    else:
        effect = (
            f"particles stick to each other; from {SATURATED:g} on a bed hardly becomes looser, so "
            f"that a run with {SATURATED:g} gives nearly the same bed"
        )
    return (
        f"the granular Bond number (pull-off force over net weight) is {_range(bonds)}, with a "
        f"Hamaker constant of {hamaker:.3g} J and layers of {1e9 * layer:.3g} nm{assumed}: {effect}"
    )


def _bonds(parameters: Parameters, hamaker: float, layer: float) -> np.ndarray:
    """Returns the granular Bond numbers of all particles, () or (N,)."""
    return np.asarray(
        evaluate_with_numpy(dimensionless.granular_bond_number, parameters, hamaker, 2.0 * layer)
    )


def _layer_of_bond_one(parameters: Parameters, hamaker: float) -> float:
    """Returns the thickness of a layer at which the largest Bond number is 1; m."""
    return BARE_LAYER * float(np.sqrt(_bonds(parameters, hamaker, BARE_LAYER).max()))


def _range(bonds: np.ndarray) -> str:
    """Returns the least and the largest Bond number in words."""
    least, largest = f"{bonds.min():.2g}", f"{bonds.max():.2g}"
    return least if least == largest else f"{least} to {largest}"
