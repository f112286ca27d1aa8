"""Checks of the numbers of a size distribution."""

from numbers import Real
from typing import Any

from mrjax.core.errors import InputError, shown

LEAST_DIAMETER = 1e-10
"""Diameter of an atom, m: what is smaller was given in another unit."""


def refuse_tiny(key: str, diameter: float) -> None:
    """Passes a diameter in m that a particle may have.

    Raises:
      InputError: it is smaller than an atom.
    """
    if diameter < LEAST_DIAMETER:
        raise InputError(f"{key} = {diameter:g}: smaller than an atom; give m: 4 um is 4e-6")


def is_positive(value: Any) -> bool:
    """True if a value is a number above zero that can be computed with."""
    number = isinstance(value, Real) and not isinstance(value, bool)
    return number and 1e-30 <= value <= 1e30  # what follows from others is not finite


def positive_list(name: str, values: Any, what: str) -> tuple[float, ...]:
    """Positive numbers of a list.

    Raises:
      InputError: it is no list, is empty, or something in it is no positive number.
    """
    if not isinstance(values, list | tuple) or not values or not all(map(is_positive, values)):
        given = list(values) if isinstance(values, tuple) else values
        raise InputError(
            f"{name} = {shown(given)}: must be a list of {what}, all above zero, at most 1e30"
        )
    return tuple(float(value) for value in values)


def refuse_basis(by: Any) -> None:
    """Passes what fractions may be of.

    Raises:
      InputError: it is neither number nor volume.
    """
    if by not in ("number", "volume"):
        raise InputError(f'by = {shown(by)}: must be "number" or "volume"')
