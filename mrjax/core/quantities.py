"""Fields of records that are physical quantities: each with its unit, and so its dimension.

A law is written in any coherent system of units. A record of quantities is given in SI, and turned
into the reduced units of a run by the dimensions of its fields.
"""

import dataclasses
import re
from dataclasses import field
from typing import Any, TypeVar

from mrjax.core.units import Units

T = TypeVar("T")
Dimension = tuple[int, int, int]
"""Exponents of kg, m and s. Ampere and kelvin have none: each is a unit of its own."""

UNITS: dict[str, Dimension] = {
    "1": (0, 0, 0),
    "rad": (0, 0, 0),
    "A": (0, 0, 0),
    "K": (0, 0, 0),
    "kg": (1, 0, 0),
    "m": (0, 1, 0),
    "s": (0, 0, 1),
    "Hz": (0, 0, -1),
    "N": (1, 1, -2),
    "Pa": (1, -1, -2),
    "J": (1, 2, -2),
    "W": (1, 2, -3),
    "T": (1, 0, -2),
}
"""Units that `quantity` reads, beside their products, quotients and powers."""


def dimension(unit: str) -> Dimension:
    """The dimension of a unit such as `kg/m^3`, `Pa s` or `N m^2/s`.

    Raises:
      ValueError: an unknown unit.
    """
    total = [0, 0, 0]
    for factor in re.finditer(r"(/?)\s*([^\s/^]+)(?:\^(-?\d+))?", unit):
        divides, name, power = factor.groups()
        if name not in UNITS:
            raise ValueError(f"unit {name!r} of {unit!r}: give one of {', '.join(UNITS)}")
        exponent = int(power or 1) * (-1 if divides else 1)
        exponents = zip(total, UNITS[name], strict=True)
        total = [earlier + exponent * own for earlier, own in exponents]
    mass, length, time = total
    return mass, length, time


def quantity(unit: str, about: str = "", **keywords: Any) -> Any:
    """A field of a force: a number in this unit, which can be differentiated and fitted.

    Args:
      unit: in SI, a product or quotient of kg, m, s, A, K, N, Pa, J, W, T, Hz, rad and 1.
      about: what it is.
      keywords: of `dataclasses.field`: `default=0.0`, say.

    Raises:
      ValueError: an unknown unit.

    Example:
      >>> class Drift(mrjax.BodyForce):
      ...     size: float = mrjax.quantity("N", "along x, of every particle")
    """
    return field(metadata={"unit": unit, "about": about, "dimension": dimension(unit)}, **keywords)


def reduced(record: T, units: Units) -> T:
    """A record of quantities in reduced units; its other fields stay as they are.

    Args:
      record: a dataclass, in SI.
      units: the reduced ones.
    """

    def value(field: dataclasses.Field) -> Any:
        leaf, exponents = getattr(record, field.name), field.metadata.get("dimension")
        return leaf if leaf is None or exponents is None else leaf * (1.0 / units.scale(exponents))

    fields = dataclasses.fields(record)  # type: ignore[arg-type] # a dataclass
    return dataclasses.replace(record, **{one.name: value(one) for one in fields})  # type: ignore[type-var]
