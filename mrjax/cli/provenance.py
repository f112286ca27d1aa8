"""Provenance of a result: its lab sheet, seed, precision, and versions of packages."""

import importlib.metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mrjax.recipe.recipe import Recipe

RECORDED_PACKAGES = ("mrjax", "jax", "jaxlib", "jax-md", "optax", "scipy", "numpy")
"""Packages whose versions results record."""


def versions() -> dict[str, str]:
    """Versions of the packages that made a result."""
    return {name: importlib.metadata.version(name) for name in RECORDED_PACKAGES}


def made_by(sheet: "Recipe", seed: int, dtype: str) -> dict[str, Any]:
    """Provenance of a result; `Recipe.model_validate` takes its lab sheet."""
    return {
        "recipe": sheet.name,
        "lab_sheet": sheet.model_dump(mode="json", exclude_none=True),
        "seed": seed,
        "dtype": dtype,
        "versions": versions(),
    }
