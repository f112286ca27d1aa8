"""Lines of the validation page: a number that is known, and the one that was computed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Row:
    """A comparison; its error is relative to `scale`, or to the reference itself."""

    case: str
    quantity: str
    reference: float
    computed: float
    unit: str
    bar: float | None
    """Largest relative error that passes; None where none is asked."""
    source: str
    """Where the reference comes from: a closed form, a measurement, another code."""
    scale: float | None = None
    """What the error is relative to where the reference may be zero, or nearly."""

    @property
    def error(self) -> float:
        """|computed - reference| over the scale; 1."""
        return abs(self.computed - self.reference) / abs(self.scale or self.reference)

    @property
    def passes(self) -> bool:
        """Whether the error keeps to the bar."""
        return self.bar is None or self.error <= self.bar


TIE = 1e-3
"""Errors that differ by less than this fraction of the bar count as equal; the first one is shown,
whatever the rounding of a machine."""


def worst(
    case: str,
    quantity: str,
    at: np.ndarray,
    reference: ArrayLike,
    computed: np.ndarray,
    *,
    name: str,
    **keywords,
) -> Row:
    """The comparison with the largest error, of many.

    Args:
      case, quantity: of all.
      at: what distinguishes them, (N,).
      reference: (N,), or one for all.
      computed: (N,).
      name: how to print what distinguishes them, as "{:.0f} deg".
      **keywords: of the row.
    """
    of_many = f"{quantity}, worst of {len(at)}" if len(at) > 1 else quantity
    rows = [
        Row(
            case,
            f"{of_many}: {name.format(where)}",
            float(known),
            float(found),
            **keywords,
        )
        for where, known, found in zip(at, *np.broadcast_arrays(reference, computed), strict=True)
    ]
    largest = max(row.error for row in rows)
    return next(row for row in rows if row.error >= largest - TIE * row.bar)
