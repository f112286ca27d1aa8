"""Optima: which ends of searches are different ones, and which is told of each."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from calibrate.least_squares import levenberg
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.finish import CONVERGED_BELOW, is_settled
from calibrate.least_squares.levenberg import Point

APART = 1.0
"""Distance between the residuals of two optima, from which they are different; standard
deviations."""
NEAR = 0.5
"""Distance in logarithms up to which like residuals are of one optimum."""
RIDGE = 0.5
"""Least rise of the loss halfway between two optima: chi-squared by one."""


class Optimum(NamedTuple):
    """A least of the sum of squares, priors included."""

    values: np.ndarray
    """(P,)."""
    loss: float
    """Half the sum of squares, priors included."""
    chi_squared: float
    """Sum of squares of the residuals of the measurements, without the priors."""
    finished: bool = True
    """False for one of the cheap model of a search alone."""


def optimum(end: Point, count: int, finished: bool = True) -> Optimum:
    """The optimum at an end, whose first `count` residuals are of measurements."""
    of_data = end.value[:count]
    with np.errstate(over="ignore"):
        return Optimum(np.exp(end.logs), end.loss, float(of_data @ of_data), finished)


def distinct(
    ends: Iterable[Point], start: np.ndarray, box: Bounds, at: Callable[[np.ndarray], Point]
) -> list[Point]:
    """The different optima among the ends of searches, best first.

    The best is always among them, others if they have settled and are no plateau, where less is
    seen than from the best. Of ends in one valley that are as good, the one nearest to the start.

    Args:
      ends: of searches.
      start: logarithms, (P,).
      box: the bounds.
      at: residuals at other logarithms.
    """
    valleys: list[list[Point]] = []
    for end in sorted(ends, key=lambda end: end.loss):
        if valleys and not _as_certain(end, valleys[0][0], box):
            continue
        for valley in valleys:
            if _same(end, valley[0], at):
                valley.append(end)
                break
        else:
            valleys.append([end])

    def nearest(valley: list[Point]) -> Point:
        as_good = [end for end in valley if end.loss <= valley[0].loss + 0.5 * CONVERGED_BELOW]
        return min(as_good or valley, key=lambda end: float(np.linalg.norm(end.logs - start)))

    return [nearest(valley) for valley in valleys]


def with_others(optima: Sequence[Optimum], others: Iterable[Optimum]) -> tuple[Optimum, ...]:
    """Optima and those of others that are not near one and as good, the first in its place."""

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
    """True for an end that is an optimum, too."""
    return end.finite and is_settled(end, box) and _rank(end) >= _rank(best)


def _rank(end: Point) -> int:
    """Directions of which residuals or priors tell."""
    if not end.finite:
        return 0
    size = np.linalg.svd(end.jacobian, compute_uv=False)
    return int(np.sum(size > levenberg.resolved(end.jacobian) * size[0]))


def _same(first: Point, second: Point, at: Callable[[np.ndarray], Point]) -> bool:
    """True if two ends predict the same, and no ridge is between them."""
    if np.linalg.norm(first.value - second.value) > APART:
        return False
    if np.linalg.norm(first.logs - second.logs) < NEAR:
        return True
    return at(0.5 * (first.logs + second.logs)).loss < max(first.loss, second.loss) + RIDGE
