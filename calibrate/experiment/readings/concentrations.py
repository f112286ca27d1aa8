"""Kinds of concentration: their names in headers, and their conversion to volume fractions.

All are concentrations of the particles without their coating. The coating stays on its particles:
each has as much of it in a diluted suspension.
"""

import re
from typing import NamedTuple

from pydantic import AfterValidator, ValidationInfo

from calibrate.experiment.readings import vocabulary
from calibrate.experiment.velocity_units import plain
from mrjax import InputError, Recipe
from mrjax.core.errors import shown
from mrjax.recipe.composition import Composition
from mrjax.recipe.plausibility import RANDOM_CLOSE_PACKING


class Kind(NamedTuple):
    """A kind of concentration, and its unit."""

    way: str
    """Key of the composition that states it."""
    factor: float
    """Factor from a number to the value of that key."""
    said: str
    """Format of a number in words."""
    inverse: bool = False
    """True if the number is one over that of the key."""


KINDS = {
    "volume fraction": Kind("volume_fraction", 1.0, "volume fraction {:.4g}"),
    "volume percent": Kind("volume_fraction", 1e-2, "{:.4g} % by volume"),
    "weight fraction": Kind("particle", 1.0, "weight fraction {:.4g}"),
    "weight percent": Kind("particle", 1e-2, "{:.4g} % by weight"),
    "kg/m3": Kind("concentration", 1.0, "{:.4g} kg/m3"),
    "g/L": Kind("concentration", 1.0, "{:.4g} g/L"),
    "g/mL": Kind("concentration", 1e3, "{:.4g} g/mL"),
    "mg/L": Kind("concentration", 1e-3, "{:.4g} mg/L"),
    "solids ratio": Kind("solids_ratio", 1.0, "{:.4g} kg of solid per kg of liquid"),
    "liquid ratio": Kind("solids_ratio", 1.0, "{:.4g} kg of liquid per kg of solid", inverse=True),
}
"""The kinds by their names."""

_TOKENS = re.compile(r"%|/|[^\W\d_]+")
_DENSITIES = {
    "kg/m3": r"kg\s*(?:/|\s*per\s+)\s*m\^?3|kg[\s.·*]*m\s*\^?-3",
    "g/mL": r"g\s*(?:/|\s*per\s+)\s*(?:ml|cm\^?3|cc)|g[\s.·*]*(?:ml\s*\^?-1|cm\s*\^?-3)",
    "g/L": r"(?:g\s*(?:/|\s*per\s+)\s*(?:l|dm\^?3|litre|liter)|g[\s.·*]*l\s*\^?-1)",
    "mg/L": r"mg\s*(?:/|\s*per\s+)\s*(?:l|litre|liter)|mg[\s.·*]*l\s*\^?-1|ppm",
}
_DENSITY = {
    name: re.compile(rf"(?<![^\W\d_])(?:{pattern})(?![\w^])")
    for name, pattern in _DENSITIES.items()
}


def kind_of(text: str) -> str | None:
    """The kind of concentration that a header or a stated word names; None if it names none.

    `phi`, `volume fraction`, `vol%`, `solids (wt %)`, `c (g/L)`, `water_kg_per_kg_solid`.
    """
    whole = plain(text).replace("v/v", " volume fraction ").replace("w/w", " weight fraction ")
    for name, pattern in _DENSITY.items():
        if pattern.search(whole):
            return name
    tokens = _TOKENS.findall(whole)
    words = set(tokens)
    liquid = next((place for place, token in enumerate(tokens) if token in vocabulary.LIQUID), None)
    solid = next((place for place, token in enumerate(tokens) if token in vocabulary.SOLID), None)
    if liquid is not None and solid is not None and words & vocabulary.OVER:
        return "liquid ratio" if liquid < solid else "solids ratio"
    if "ratio" in words and (liquid is None) != (solid is None):
        return "solids ratio" if liquid is None else "liquid ratio"
    by_volume, by_weight = words & vocabulary.BY_VOLUME, words & vocabulary.BY_WEIGHT
    if bool(by_volume) == bool(by_weight):
        return None
    basis = "volume" if by_volume else "weight"
    if words & vocabulary.PERCENT:
        return f"{basis} percent"
    return f"{basis} fraction" if words & vocabulary.FRACTION else None


def names_a_concentration(text: str) -> bool:
    """True if a header names a concentration of any kind."""
    return kind_of(text) is not None or bool(
        set(_TOKENS.findall(plain(text))) & vocabulary.CONCENTRATION
    )


def alike(kind: str, other: str) -> bool:
    """True if two kinds have the same numbers, as g/L and kg/m3 do."""
    first, second = KINDS[kind], KINDS[other]
    return first[:2] + first[3:] == second[:2] + second[3:]


def kind_as_stated(kind: str | None, stated: str | None, column: str, at: str) -> str:
    """The kind of a column of concentrations: that of its header, or as stated.

    Args:
      kind: kind that the header names; None if it names none.
      stated: kind that the experiment file states; None if it states none.
      column: name of the column.
      at: place of the header, for messages.

    Raises:
      InputError: header and experiment file contradict each other, or neither names a kind.
    """
    if kind and stated and not alike(kind, stated):
        raise InputError(
            f"{at}: column {shown(column)} is of {kind}, and concentration = {shown(stated)} is "
            "stated; mend the header, or take concentration away"
        )
    if not (kind or stated):
        raise InputError(
            f"{at}: column {shown(column)} does not say what its concentrations are; state "
            f"concentration, one of {', '.join(KINDS)}"
        )
    return str(stated or kind)


def said(kind: str, value: float) -> str:
    """A concentration in words."""
    return KINDS[kind].said.format(value)


def volume_fraction(kind: str, value: float, recipe: Recipe) -> float:
    """Volume fraction of the uncoated particles at a concentration; 1.

    Args:
      kind: one of `KINDS`.
      value: above zero.
      recipe: recipe, with the densities and the amount of coating.

    Raises:
      InputError: a concentration that no suspension of these particles has.
    """
    fraction = _fraction(kind, value, recipe)
    if fraction is None or fraction * recipe.radius_factor**3 > RANDOM_CLOSE_PACKING:
        fraction_text = "" if fraction is None else f", a volume fraction of {fraction:.3g},"
        raise InputError(
            f"{said(kind, value)}{fraction_text} is denser than particles can be dispersed, "
            f"{RANDOM_CLOSE_PACKING} by volume; mend it, or state concentration if it is not the "
            f"{kind}"
        )
    return fraction


def local_fraction(kind: str, value: float, recipe: Recipe) -> float:
    """Volume fraction of the uncoated particles in clear fluid, a suspension or a bed; 1.

    Args:
      kind: one of `KINDS`.
      value: zero or above.
      recipe: recipe, with the densities and the amount of coating.

    Raises:
      InputError: more than solids alone.
    """
    if value == 0.0 and not KINDS[kind].inverse:
        return 0.0
    fraction = _fraction(kind, value, recipe) if value else None
    if fraction is None or fraction * recipe.radius_factor**3 >= 1.0:
        raise InputError(
            f"{said(kind, value)} is as much as solids alone, or more; mend it, or state "
            f"concentration if it is not the {kind}"
        )
    return fraction


def _fraction(kind: str, value: float, recipe: Recipe) -> float | None:
    """Volume fraction of the uncoated particles; None where nothing has that concentration."""
    way, factor, _, inverse = KINDS[kind]
    number = factor / value if inverse else factor * value
    stated = _by_weight(number, recipe) if way == "particle" else {way: number}
    possible = way not in ("particle", "volume_fraction") or number < 1.0
    if not possible or min(stated.values()) < 0.0:
        return None
    return Composition.model_construct(None, **stated).fraction(recipe.phases)


def _by_weight(particle: float, recipe: Recipe) -> dict[str, float]:
    """Weight fractions of particles, their coating and fluid; negative if no fluid is left."""
    composition, phases = recipe.composition, recipe.phases
    coating = phases.layer * (phases.coating or 0.0) / phases.particle
    if composition.particle is not None:
        coating = composition.coating / composition.particle
    return {
        "particle": particle,
        "fluid": 1.0 - particle * (1.0 + coating),
        "coating": particle * coating,
    }


def _checked(word: str, field: ValidationInfo) -> str:
    kind = next((name for name in KINDS if plain(name) == plain(word)), None) or kind_of(word)
    if kind is None:
        raise ValueError(f"{field.field_name} = {shown(word)}: must be one of {', '.join(KINDS)}")
    return kind


OF_CONCENTRATION = AfterValidator(_checked)
"""A validator for a field that names a kind of concentration; gives its standard name."""
