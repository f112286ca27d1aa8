"""Checks of the numbers of a size distribution."""

from numbers import Real
from typing import Any

from mrjax.core.errors import InputError, shown

LEAST_DIAMETER = 1e-10
"""Diameter of an atom, m; a smaller number was given in another unit."""


def refuse_tiny(key: str, diameter: float) -> None:
    """Refuses a diameter that is smaller than an atom; m.

    Raises:
      InputError: it is smaller.
    """
    if diameter < LEAST_DIAMETER:
        raise InputError(f"{key} = {diameter:g}: smaller than an atom; give m: 4 um is 4e-6")


def is_positive(value: Any) -> bool:
    """True if a value is a positive number within the bounds of all numbers of a sheet."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and 1e-30 <= value <= 1e30  # others overflow or underflow


def positive_list(name: str, values: Any, quantity: str) -> tuple[float, ...]:
    """Checks a list of positive numbers and returns it as a tuple.

    Raises:
      InputError: the value is no list, is empty, or has an entry that is no positive number.
    """
    if not isinstance(values, list | tuple) or not values or not all(map(is_positive, values)):
        entries = list(values) if isinstance(values, tuple) else values
        raise InputError(
            f"{name} = {shown(entries)}: must be a list of {quantity}, all above zero, at most 1e30"
        )
    return tuple(float(value) for value in values)


def refuse_basis(by: Any) -> None:
    """Refuses a basis of a distribution other than "number" and "volume".

    Raises:
      InputError: the value is neither.
    """
    if by not in ("number", "volume"):
        raise InputError(f'by = {shown(by)}: must be "number" or "volume"')
