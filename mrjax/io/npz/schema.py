"""The schema of a file: its arrays by name, with their types, shapes and bounds."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel

from mrjax.core.errors import shown

SIDE_BY_SIDE = "..."
"""First entry of a shape, which stands for the axes of several runs; all arrays have the same."""

M = TypeVar("M", bound=BaseModel)


class DamagedError(Exception):
    """A file that is not what mrjax wrote."""


@dataclass(frozen=True)
class Numbers:
    """Requirements on an array."""

    shape: tuple[int | str, ...]
    """Lengths of the axes; axes with the same name have the same length in all arrays."""
    kind: str = "float"
    """`float`, with 32 or 64 bits, the same in all arrays; or `int`, with 32 bits."""
    least: float = -math.inf
    most: float = math.inf
    below: str | None = None
    """Name of an axis; all numbers are below its length."""
    finite: bool = True
    optional: bool = False
    needs: str | None = None
    """Name of another array, without which this one is refused."""


@dataclass(frozen=True)
class Schema(Generic[M]):
    """Requirements on a file."""

    description: str
    """Words for such a file in a message, such as `a file that save_state wrote`."""
    metadata: type[M]
    arrays: Mapping[str, Numbers] | None
    """Requirements by name, or by the beginning of names that ends in `*`.

    None for arrays of any name and shape, which must not be compressed."""
    least: Mapping[str, int] = field(default_factory=dict)
    """Least length of an axis, by name; 1 by default."""

    def requirements(self, entries: Iterable[str]) -> dict[str, Numbers]:
        """Requirements on the arrays of a file, by name: those that it has or must have."""
        by_name = {name: one for name, one in (self.arrays or {}).items() if name[-1] != "*"}
        for pattern, numbers in (self.arrays or {}).items():
            if pattern[-1] == "*":
                further = [name for name in entries if name.startswith(pattern[:-1])]
                by_name |= {name: numbers for name in further if name not in by_name}
        return by_name


class Header(Protocol):
    """Shape and type of an array."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""

    @property
    def dtype(self) -> np.dtype:
        """The type of its numbers."""


def refuse_headers(entries: Mapping[str, Header], schema: Schema) -> dict[str, Any]:
    """Refuses names, types and shapes that do not fit a schema; returns the lengths of its axes."""
    if schema.arrays is None:
        return {}
    arrays = schema.requirements(entries)
    for name in entries:
        if name not in arrays:
            raise DamagedError(f"it holds {shown(name)}, which is not expected")
    lengths: dict[str, Any] = {}
    precisions = set()
    for name, numbers in arrays.items():
        if name not in entries:
            if not numbers.optional:
                raise DamagedError(f"it has no {name}")
            continue
        if numbers.needs is not None and numbers.needs not in entries:
            raise DamagedError(f"it has {name} without {numbers.needs}")
        entry = entries[name]
        kind = entry.dtype.newbyteorder("=")
        if kind not in ((np.float32, np.float64) if numbers.kind == "float" else (np.int32,)):
            raise DamagedError(f"{name} has type {kind}, but must be {numbers.kind}")
        if numbers.kind == "float":
            precisions.add(kind)
        _refuse_shape(name, entry.shape, numbers.shape, lengths)
    if len(precisions) > 1:
        raise DamagedError("its numbers have two precisions")
    for axis, length in lengths.items():
        if axis != SIDE_BY_SIDE and length < schema.least.get(axis, 1):
            raise DamagedError(f"{axis} = {length} is too few")
    return lengths


def _refuse_shape(
    name: str,
    shape: tuple[int, ...],
    expected_shape: tuple[int | str, ...],
    lengths: dict[str, Any],
) -> None:
    """Refuses a shape whose axes do not have the expected lengths.

    `lengths` has the length of every named axis of earlier arrays, and gets those of this one.
    """
    words = (
        f"{name} has shape {shown(shape)}, but must have ({', '.join(map(str, expected_shape))})"
    )
    rest = shape
    if expected_shape[:1] == (SIDE_BY_SIDE,):
        expected_shape = expected_shape[1:]
        cut = len(shape) - len(expected_shape)
        ahead, rest = shape[: max(cut, 0)], shape[max(cut, 0) :]
        if cut < 0 or 0 in ahead or lengths.setdefault(SIDE_BY_SIDE, ahead) != ahead:
            raise DamagedError(words)
    if len(rest) != len(expected_shape):
        raise DamagedError(words)
    for length, axis in zip(rest, expected_shape, strict=True):
        expected = axis if isinstance(axis, int) else lengths.setdefault(axis, length)
        if length != expected:
            raise DamagedError(words if isinstance(axis, int) else f"{words}, {axis} = {expected}")


def refuse_values(
    name: str, array: np.ndarray, numbers: Numbers, lengths: Mapping[str, Any]
) -> None:
    """Refuses numbers that are not finite or beyond their bounds."""
    if not array.size:
        return
    if numbers.finite and not np.isfinite(array).all():
        raise DamagedError(f"{name} is not finite")
    low, high = array.min(), array.max()
    most = numbers.most if numbers.below is None else lengths[numbers.below] - 1
    if low < numbers.least or high > most:
        raise DamagedError(
            f"{name} reaches from {low:.4g} to {high:.4g}, beyond {numbers.least:.4g} to {most:.4g}"
        )
