"""Levenberg and Marquardt's method within bounds, with the shortest steps.

It minimises |r(x)|^2 by steps d that minimise |r + J d| within a ball about x. The radius of the
ball follows from the ratio of the actual to the expected decrease of the last step (More 1978). Of
all such steps the shortest is taken. So x does not move along a direction on which r does not
depend. MINPACK takes any of these steps, and runs off along such directions.
"""

from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from calibrate.least_squares.bounds import Bounds as Bounds

LONGEST = 10.0
"""Largest first step, in logarithms: a factor of 22,000."""
ACCEPTED, POOR, GOOD = 1e-4, 0.25, 0.75
"""Ratios of the actual to the expected decrease of a step: above the first it is accepted, below
the second the next step is shorter, above the third it may be longer."""
DONE = 1e-8
"""Expected decrease of the sum of squares at which the descent ends: 1e-4 standard deviations, and
far less after the last step."""
SHORT = 0.1
"""Longest step that is taken for so little; a longer one would run off along a free direction."""


class Point(NamedTuple):
    """Residuals and slopes at a point."""

    loss: float
    """Half the sum of squares; infinite if it is not a number."""
    logs: np.ndarray
    """Logarithms of the values, (P,)."""
    jacobian: np.ndarray
    """Slopes of the residuals, (M, P)."""
    value: np.ndarray
    """Residuals, (M,)."""

    @property
    def finite(self) -> bool:
        """True if residuals and slopes are numbers."""
        return bool(np.isfinite(self.jacobian).all() and np.isfinite(self.value).all())


def step(point: Point, box: Bounds, radius: float = np.inf) -> tuple[np.ndarray, float]:
    """The shortest Gauss-Newton step within a radius and the bounds.

    Returns:
      the step, (P,), and the decrease of the sum of squares that it brings if residuals are linear.
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
        # Coordinates that would leave the bounds end on them; the others follow.
        change = inside
        free &= ~beyond
    change = box.clip(point.logs + change) - point.logs
    predicted_change = jacobian @ change
    return change, float(-predicted_change @ (2.0 * value + predicted_change))


def _shortest(jacobian: np.ndarray, value: np.ndarray, radius: float) -> np.ndarray:
    """The shortest step d, (P,), that minimises |r + J d| within a radius."""
    left, size, right = np.linalg.svd(jacobian, full_matrices=False)
    if not size.any():
        return np.zeros(jacobian.shape[1])
    seen = size > resolved(jacobian) * size[0]
    # Scaled by the largest one, so that squares of small slopes do not vanish.
    left, right, coordinates = left[:, seen], right[seen], -left[:, seen].T @ (value / size[0])
    size = size[seen] / size[0]

    def damped(damping: float) -> np.ndarray:
        return size * coordinates / (size**2 + damping)

    def beyond(damping: float) -> float:
        return float(np.linalg.norm(damped(damping))) - radius

    if beyond(0.0) <= 0.0:
        return right.T @ damped(0.0)
    # Twice the damping that is enough: rounding could leave the step a little too long.
    most = 2.0 * float(np.linalg.norm(size * coordinates)) / radius
    least = float(np.finfo(float).tiny)
    return right.T @ damped(brentq(beyond, 0.0, most, xtol=least, rtol=1e-3))


def resolved(jacobian: ArrayLike) -> float:
    """Share of the largest singular value below which another one is rounding."""
    return max(1e-10, 10.0 * float(np.finfo(np.asarray(jacobian).dtype).eps))


def descent(
    first: Point,
    box: Bounds,
    most_steps: int,
    done: float = DONE,
    longest: float = LONGEST,
) -> Generator[np.ndarray, Point, Point]:
    """Minimises as a generator: yields logarithms, is sent the point there, returns the end.

    Args:
      first: first point, within the bounds.
      box: bounds of the logarithms.
      most_steps: most points to evaluate.
      done: expected decrease of the sum of squares at which the descent ends.
      longest: largest first step, in logarithms.
    """
    here, radius = first, longest
    for _ in range(most_steps):
        if not here.finite:
            break
        change, expected = step(here, box, radius)
        length = float(np.linalg.norm(change))
        if not change.any() or (abs(expected) < done and length > SHORT):
            break
        there = yield here.logs + change
        share = 0.0  # of the expected decrease
        if there.finite and expected > 0.0:
            share = 2.0 * (here.loss - there.loss) / expected
        if share > ACCEPTED:
            here = there
        if abs(expected) < done:
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
    done: float = DONE,
    longest: float = LONGEST,
) -> tuple[list[Point], int]:
    """Minimises from several points, side by side; gives the ends and the number of evaluations.

    Args:
      at: function that gives residuals and slopes at several logarithms.
      first, box, most_steps, done, longest: as for `descent`, of each.
    """
    paths = [descent(start, box, most_steps, done, longest) for start in first]
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
