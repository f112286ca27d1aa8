"""Levenberg and Marquardt's method within bounds, by shortest steps.

Least |r(x)|^2 by steps d that minimise |r + J d| within a ball about x, whose radius follows from
how well the last step kept what it promised (More 1978). Of all such steps the shortest is taken:
a direction along which J does not change is one of which the data say nothing, and x stays where
it is along it. MINPACK takes any of them, and runs along what nothing bounds.
"""

from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from calibrate.least_squares.bounds import Bounds as Bounds

LONGEST = 10.0
"""A step at first; in logarithms, a factor of 22,000."""
ACCEPTED, POOR, GOOD = 1e-4, 0.25, 0.75
"""Of the decrease that a step promised: from where it is taken, below where the next is shorter,
and above where it may be longer."""
DONE = 1e-8
"""Promised decrease of the sum of squares after which there is nothing more to do: 1e-4 standard
deviations, and far less behind a step that is taken."""
SHORT = 0.1
"""A step that is still taken for so little: a longer one would run along what nothing bounds."""


class Point(NamedTuple):
    """Residuals where they were asked for."""

    loss: float
    """Half the sum of squares, infinite where it is not a number."""
    logs: np.ndarray
    """(P,)."""
    jacobian: np.ndarray
    """(M, P)."""
    value: np.ndarray
    """(M,)."""

    @property
    def finite(self) -> bool:
        """True if residuals and slopes are numbers."""
        return bool(np.isfinite(self.jacobian).all() and np.isfinite(self.value).all())


def step(point: Point, box: Bounds, radius: float = np.inf) -> tuple[np.ndarray, float]:
    """The shortest step within a radius and the bounds, (P,), and what it promises.

    Returns: the step, and the decrease of the sum of squares where residuals are straight.
    """
    if not point.finite:
        return np.zeros(point.logs.size), np.inf
    jacobian, value = point.jacobian, point.value
    change = np.zeros(point.logs.size)
    free = np.ones(change.size, bool)
    for _ in range(change.size):
        change[free] = _shortest(
            jacobian[:, free], value + jacobian[:, ~free] @ change[~free], radius
        )
        inside = box.clip(point.logs + change) - point.logs
        beyond = free & (inside != change)
        if not beyond.any():
            break
        # What would leave the bounds ends on them; the rest follows.
        change = inside
        free &= ~beyond
    change = box.clip(point.logs + change) - point.logs
    predicted_change = jacobian @ change
    return change, float(-predicted_change @ (2.0 * value + predicted_change))


def _shortest(jacobian: np.ndarray, value: np.ndarray, radius: float) -> np.ndarray:
    """The step to the least |r + J d| with |d| within the radius, (P,)."""
    left, size, right = np.linalg.svd(jacobian, full_matrices=False)
    if not size.any():
        return np.zeros(jacobian.shape[1])
    seen = size > resolved(jacobian) * size[0]
    # Over the largest, so that squares of small slopes are numbers.
    left, right, coordinates = left[:, seen], right[seen], -left[:, seen].T @ (value / size[0])
    size = size[seen] / size[0]

    def damped(damping: float) -> np.ndarray:
        return size * coordinates / (size**2 + damping)

    def beyond(damping: float) -> float:
        return float(np.linalg.norm(damped(damping))) - radius

    if beyond(0.0) <= 0.0:
        return right.T @ damped(0.0)
    # Twice what is enough, which rounding would leave a little too long.
    most = 2.0 * float(np.linalg.norm(size * coordinates)) / radius
    least = float(np.finfo(float).tiny)
    return right.T @ damped(brentq(beyond, 0.0, most, xtol=least, rtol=1e-3))


def resolved(jacobian: ArrayLike) -> float:
    """Part of the largest singular value below which one is rounding."""
    return max(1e-10, 10.0 * float(np.finfo(np.asarray(jacobian).dtype).eps))


def descent(first: Point, box: Bounds, most_steps: int) -> Generator[np.ndarray, Point, Point]:
    """Yields where it asks, (P,), is sent the point there, and returns the least near the first.

    Args:
      first: where to begin, within the bounds.
      box: the bounds.
      most_steps: points to ask for at most.
    """
    here, radius = first, LONGEST
    for _ in range(most_steps):
        if not here.finite:
            break
        change, promised = step(here, box, radius)
        length = float(np.linalg.norm(change))
        if not change.any() or (abs(promised) < DONE and length > SHORT):
            break
        there = yield here.logs + change
        share = 0.0  # of the promise that is kept
        if there.finite and promised > 0.0:
            share = 2.0 * (here.loss - there.loss) / promised
        if share > ACCEPTED:
            here = there
        if abs(promised) < DONE:
            break
        if share < POOR:
            radius = 0.25 * length
        elif share > GOOD:
            radius = max(radius, 2.0 * length)
    return here


def minimise(
    at: Callable[[list[np.ndarray]], list[Point]],
    first: list[Point],
    box: Bounds,
    most_steps: int,
) -> tuple[list[Point], int]:
    """The least sums of squares near first points, side by side, and the points evaluated.

    Args:
      at: residuals and slopes at some places.
      first, box, most_steps: as for `descent`, of each.
    """
    paths = [descent(start, box, most_steps) for start in first]
    ends, evaluated = list(first), 0
    replies: dict[int, Point | None] = dict.fromkeys(range(len(paths)))
    while replies:
        requests = {}
        for place, reply in replies.items():
            path = paths[place]
            try:
                requests[place] = next(path) if reply is None else path.send(reply)
            except StopIteration as end:
                ends[place] = end.value
        points = at(list(requests.values())) if requests else []
        replies = dict(zip(requests, points, strict=True))
        evaluated += len(points)
    return ends, evaluated
