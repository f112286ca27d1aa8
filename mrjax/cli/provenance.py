"""Provenance of a result: its lab sheet, seed, precision, and versions of packages."""

from typing import TYPE_CHECKING, Any

from mrjax.io.versions import versions

if TYPE_CHECKING:
    from mrjax.recipe.recipe import Recipe


def made_by(sheet: "Recipe", seed: int, dtype: str) -> dict[str, Any]:
    """Returns the provenance of a result; `Recipe.model_validate` reads its lab sheet."""
    return {
        "recipe": sheet.name,
        "lab_sheet": sheet.model_dump(mode="json", exclude_none=True),
        "seed": seed,
        "dtype": dtype,
        "versions": versions(),
    }
