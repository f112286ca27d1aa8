"""The different optima among the ends of searches."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from calibrate.least_squares import levenberg
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.finish import CONVERGED_BELOW, is_settled
from calibrate.least_squares.levenberg import Point

APART = 1.0
"""Least distance between the residuals of two different optima, in standard deviations."""
NEAR = 0.5
"""Distance in logarithms below which two ends of like residuals are one optimum."""
RIDGE = 0.5
"""Least rise of the loss halfway between two different optima: one in chi-squared."""


class Optimum(NamedTuple):
    """A local minimum of the sum of squares, priors included."""

    values: np.ndarray
    """The values, (P,)."""
    loss: float
    """Half the sum of squares, priors included."""
    chi_squared: float
    """Sum of squares of the residuals of the measurements, without the priors."""
    finished: bool = True
    """False for an optimum of the cheap model alone."""


def optimum(end: Point, count: int, finished: bool = True) -> Optimum:
    """The optimum at an end; its first `count` residuals are those of measurements."""
    of_data = end.value[:count]
    with np.errstate(over="ignore"):
        return Optimum(np.exp(end.logs), end.loss, float(of_data @ of_data), finished)


def distinct(
    ends: Iterable[Point], start: np.ndarray, box: Bounds, at: Callable[[np.ndarray], Point]
) -> list[Point]:
    """The different optima among the ends of searches, best first.

    The best end is always among them. Another end is, if it has settled and is no plateau, where
    fewer directions are determined than at the best end. Of equally good ends in one valley the
    nearest to the start is taken.

    Args:
      ends: ends of searches.
      start: logarithms at the start, (P,).
      box: bounds of the logarithms.
      at: function that gives residuals at other logarithms.
    """
    valleys: list[list[Point]] = []
    for end in sorted(ends, key=lambda end: end.loss):
        if valleys and not _as_certain(end, valleys[0][0], box):
            continue
        for valley in valleys:
            if _same_optimum(end, valley[0], at):
                valley.append(end)
                break
        else:
            valleys.append([end])

    def nearest(valley: list[Point]) -> Point:
        as_good = [end for end in valley if end.loss <= valley[0].loss + 0.5 * CONVERGED_BELOW]
        return min(as_good or valley, key=lambda end: float(np.linalg.norm(end.logs - start)))

    return [nearest(valley) for valley in valleys]


def with_others(optima: Sequence[Optimum], others: Iterable[Optimum]) -> tuple[Optimum, ...]:
    """Optima with others added, unless these are near one and as good; the first stays first."""

    def known_already(other: Optimum) -> bool:
        return any(
            np.linalg.norm(np.log(other.values / listed.values)) < NEAR
            and abs(other.loss - listed.loss) < RIDGE
            for listed in all_optima
        )

    all_optima = list(optima)
    for other in others:
        if not known_already(other):
            all_optima.append(other)
    return (*all_optima[:1], *sorted(all_optima[1:], key=lambda listed: listed.loss))


def _as_certain(end: Point, best: Point, box: Bounds) -> bool:
    """True for a settled end that determines as many directions as the best."""
    return end.finite and is_settled(end, box) and _rank(end) >= _rank(best)


def _rank(end: Point) -> int:
    """Number of directions that residuals or priors determine."""
    if not end.finite:
        return 0
    size = np.linalg.svd(end.jacobian, compute_uv=False)
    return int(np.sum(size > levenberg.resolved(end.jacobian) * size[0]))


def _same_optimum(first: Point, second: Point, at: Callable[[np.ndarray], Point]) -> bool:
    """True if two ends predict the same, and no ridge is between them."""
    if np.linalg.norm(first.value - second.value) > APART:
        return False
    if np.linalg.norm(first.logs - second.logs) < NEAR:
        return True
    return at(0.5 * (first.logs + second.logs)).loss < max(first.loss, second.loss) + RIDGE
