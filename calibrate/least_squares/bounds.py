"""Bounds of the fitted values, in logarithms."""

from typing import NamedTuple

import numpy as np


class Bounds(NamedTuple):
    """Bounds of each coordinate, (P,)."""

    lower: np.ndarray
    """Lower bounds, (P,); -inf without one."""
    upper: np.ndarray
    """Upper bounds, (P,); inf without one."""

    def clip(self, logs: np.ndarray) -> np.ndarray:
        """The nearest logarithms within the bounds."""
        return np.clip(logs, self.lower, self.upper)


def log_bounds(names: tuple[str, ...], bounds: dict[str, tuple[float, float]]) -> Bounds:
    """Bounds of the logarithms, (P,)."""
    ends = np.array([bounds.get(name, (0.0, np.inf)) for name in names], float)
    with np.errstate(divide="ignore"):
        return Bounds(*np.log(ends.T))
