"""The key `f_w` of a lab sheet: a number, or a closure with its coefficients."""

from typing import Any

from jax.tree_util import Partial

from mrjax.core.errors import shown, shown_key
from mrjax.laws.closures import brzinski_durian, table
from mrjax.laws.closures.table import CLOSURES
from mrjax.recipe import sheets

BRANCHED = "brzinski-durian"
"""The closure whose exponent follows from the Peclet number unless the sheet states a branch."""
AT_LEAST_ONE = ("floc_volume",)
"""Coefficients that are volumes of flocs over volumes of the solids in them."""

Factor = float | str | dict[str, float | str]


def checked(f_w: Any) -> Factor:
    """Checks the key of a sheet, and returns it with numbers as floats.

    Raises:
      ValueError: the key cannot be used; the message has the remedy.
    """
    names = ", ".join(CLOSURES)
    if isinstance(f_w, int | float):
        return sheets.above_zero("drag.f_w", f_w, f"a closure's name ({names}) or a number")
    if not isinstance(f_w, str | dict):
        raise ValueError(
            f"drag.f_w = {shown(f_w)}: must be a closure's name, a table "
            f"{{closure = name, ...}} or a number above zero"
        )
    sheet = {"closure": f_w} if isinstance(f_w, str) else f_w
    if "closure" not in sheet:
        raise ValueError(f"drag.f_w = {shown(f_w)}: names no closure; add closure = one of {names}")
    name = str(sheet["closure"])
    if name not in CLOSURES:
        hint = sheets.did_you_mean(name, CLOSURES)
        raise ValueError(
            f"drag.f_w = {shown(f_w)}: no such closure; {hint}give a number or one of {names}"
        )
    _refuse_keys(name, sheet)
    if isinstance(f_w, str):
        return f_w
    return {key: _coefficient(key, value) for key, value in f_w.items()}


def closure(f_w: Factor, peclet_number: float) -> Partial:
    """Returns a closure with the coefficients of a sheet.

    Args:
      f_w: the key of the sheet, which is not a number.
      peclet_number: of the suspension; it sets the exponent of `brzinski-durian`.
    """
    coefficients: dict[str, Any] = dict(f_w) if isinstance(f_w, dict) else {"closure": f_w}
    name = str(coefficients.pop("closure"))
    if name == BRANCHED and "exponent" not in coefficients:
        branch = coefficients.pop("branch", brzinski_durian.branch(peclet_number))
        coefficients["exponent"] = brzinski_durian.BRANCHES[branch]
    return Partial(CLOSURES[name], **coefficients)


def _refuse_keys(name: str, sheet: dict[str, Any]) -> None:
    """Refuses unknown and missing coefficients of a closure."""
    coefficients = table.coefficients(CLOSURES[name])
    valid = [*coefficients, *(["branch"] if name == BRANCHED else [])]
    for key in [key for key in sheet if key not in ("closure", *valid)]:
        raise ValueError(
            f"drag.f_w.{shown_key(key)} = {shown(sheet[key])}: {name} has no such "
            f"coefficient; known: {', '.join(valid) or 'none'}"
        )
    missing = [key for key, default in coefficients.items() if default is None and key not in sheet]
    if missing:
        keys = "".join(f", {key} = ..." for key in missing)
        raise ValueError(
            f"drag.f_w.{missing[0]} is missing: {name} has no default of it; give "
            f'{{closure = "{name}"{keys}}}'
        )
    if "branch" in sheet and "exponent" in sheet:
        raise ValueError(
            f"drag.f_w.branch = {shown(sheet['branch'])}: the branch sets the exponent; leave out "
            "one of the two"
        )


def _coefficient(key: str, value: Any) -> float | str:
    if key == "closure":
        return str(value)
    if key == "branch":
        if value not in brzinski_durian.BRANCHES:
            branches = " or ".join(f'"{branch}"' for branch in brzinski_durian.BRANCHES)
            raise ValueError(f"drag.f_w.branch = {shown(value)}: give {branches}, or leave it out")
        return str(value)
    number = sheets.above_zero(f"drag.f_w.{key}", value)
    if key in AT_LEAST_ONE and number < 1.0:
        raise ValueError(
            f"drag.f_w.{key} = {shown(value)}: flocs are no smaller than the solids in them; give "
            "at least 1"
        )
    return number
