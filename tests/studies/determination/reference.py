"""An independent answer: dense grids of predictions, and many starts, finished by scipy.

Knows the residuals and the priors of a problem, and nothing of how `calibrate` fits.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from calibrate.problem.problem import Problem

WIDE = 5.0
"""Half-width of the grid, in standard deviations of the priors."""
DENSE, OF_PARTICLES = {2: 161, 3: 41}, 21
"""Values of each parameter in the grid, by how many there are; of a model that takes long."""
DISTANCES = np.array([0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.6])
"""From the optimum of the data, in standard deviations of the prior, at which a value is held; an
interval that is wider has no end here."""
FINISHED = 2
"""Best places of the grid, beside a held value, that are finished by scipy."""
STARTS, FINISHED_STARTS = 200, 8
"""Draws from the priors, which join the grid, and the best of all that are finished."""


class Reference(NamedTuple):
    """What is asked of a problem many times."""

    problem: Problem
    names: tuple[str, ...]
    middle: np.ndarray
    """Logarithms of the medians, (P,)."""
    width: np.ndarray
    """Of the priors, (P,)."""
    lower: np.ndarray
    """Bounds of the logarithms, (P,)."""
    upper: np.ndarray
    predict: Callable
    """From logarithms, (P,), to predictions, (M,)."""
    slopes: Callable
    """To their derivatives, (M, P)."""
    grid: np.ndarray
    """Places all over the priors, (G, P)."""
    predicted: np.ndarray
    """Predictions there, (G, M)."""

    def data_errors(self, data: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Half the intervals of the data alone in which chi-squared rises by less than one.

        Returns: these, (P,), and the optimum of the data, (P,).
        """
        square = np.sum(((self.predicted - data) / self.problem.errors) ** 2, axis=-1)
        square = np.where(np.isfinite(square), square, np.inf)
        everything = list(range(self.width.size))
        starts = self.grid[np.argsort(square)[: 2 * FINISHED]]
        ends = [self._descend(start, everything, data, self.without) for start in starts]
        best = min(ends, key=lambda end: end[0])
        errors = [self._data_error(place, square, best, data) for place in everything]
        return np.array(errors), best[1]

    @property
    def without(self) -> np.ndarray:
        """Widths of no priors, (P,)."""
        return np.zeros(self.width.size)

    def _data_error(
        self, place: int, square: np.ndarray, best: tuple[float, np.ndarray], data: np.ndarray
    ) -> float:
        """Half the interval of one value about the optimum of the data."""
        loss, optimum = best
        others = [other for other in range(self.width.size) if other != place]
        values = np.unique(self.grid[:, place])
        spacing = (values[-1] - values[0]) / (values.size - 1)
        ends = []
        for way in (-1.0, 1.0):
            last, near = optimum, (0.0, 0.0)
            end = np.inf
            for distance in DISTANCES * self.width[place]:
                held = optimum[place] + way * distance
                if not self.lower[place] < held < self.upper[place]:
                    break
                beside = np.flatnonzero(np.abs(self.grid[:, place] - held) <= spacing)
                chosen = beside[np.argsort(square[beside])[:FINISHED]]
                starts = [last, *self.grid[chosen[np.isfinite(square[chosen])]]]
                found = []
                for start in starts:
                    start = start.copy()
                    start[place] = held
                    found.append(self._descend(start, others, data, self.without))
                least, last = min(found, key=lambda one: one[0])
                root = max(least - loss, 0.0) ** 0.5
                if root >= 1.0:
                    share = (1.0 - near[1]) / (root - near[1])
                    end = near[0] + share * (distance - near[0])
                    break
                near = distance, root
            ends.append(end)
            if not np.isfinite(end):
                break
        return 0.5 * sum(ends)

    def best(self, data: np.ndarray, truth: np.ndarray, random: np.random.Generator) -> float:
        """Least chi-squared with priors of the grid and of draws, and from the truth."""
        everything = list(range(len(self.names)))
        drawn = self.middle + self.width * random.standard_normal((STARTS, self.width.size))
        drawn = np.clip(drawn, self.lower, self.upper)
        places = np.vstack([self.grid, drawn])
        predicted = np.vstack([self.predicted, [self.predict(one) for one in drawn]])
        square = np.sum(((predicted - data) / self.problem.errors) ** 2, axis=-1)
        square += np.sum(((places - self.middle) / self.width) ** 2, axis=-1)
        order = np.argsort(np.where(np.isfinite(square), square, np.inf))
        starts = [truth, *places[order[: FINISHED_STARTS // 2]]]
        starts += list(drawn[: FINISHED_STARTS // 2])  # from anywhere, too
        return min(self._descend(one, everything, data, self.width)[0] for one in starts)

    def objective(self, logs: np.ndarray, data: np.ndarray) -> float:
        """Chi-squared with priors."""
        residuals = self._residuals(logs, data, self.width)
        return float(residuals @ residuals)

    def _residuals(self, logs: np.ndarray, data: np.ndarray, width: np.ndarray) -> np.ndarray:
        of_data = (np.asarray(self.predict(logs)) - data) / self.problem.errors
        of_data = np.where(np.isfinite(of_data), of_data, 1e6)
        with_prior = width > 0.0
        return np.concatenate([of_data, ((logs - self.middle)[with_prior] / width[with_prior])])

    def _descend(
        self, start: np.ndarray, free: list[int], data: np.ndarray, width: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Least sum of squares from a start, of what is free; widths of 0 are no priors."""
        with_prior = np.flatnonzero(width > 0.0)

        def whole(some: np.ndarray) -> np.ndarray:
            logs = start.copy()
            logs[free] = np.clip(some, self.lower[free], self.upper[free])
            return logs

        def slopes(some: np.ndarray) -> np.ndarray:
            of_data = np.asarray(self.slopes(whole(some))) / self.problem.errors[:, None]
            of_data = np.where(np.isfinite(of_data), of_data, 0.0)
            of_priors = np.zeros((with_prior.size, start.size))
            of_priors[np.arange(with_prior.size), with_prior] = 1.0 / width[with_prior]
            return np.vstack([of_data, of_priors])[:, free]

        def residuals(some: np.ndarray) -> np.ndarray:
            return self._residuals(whole(some), data, width)

        enough = data.size + with_prior.size >= len(free)
        method = "lm" if enough else "trf"  # MINPACK's, which knows no bounds, and is fast
        end = least_squares(residuals, start[free], slopes, method=method, max_nfev=25)
        return 2.0 * float(end.cost), whole(end.x)


def reference(problem: Problem) -> Reference:
    """The grids of a problem."""
    names = tuple(problem.start)
    priors = [problem.priors[name] for name in names]
    middle = np.log([one.median for one in priors])
    width = np.array([one.log_standard_deviation for one in priors])
    lower, upper = np.log([problem.bounds[name] for name in names]).T

    def predicted(logs: jax.Array) -> jax.Array:
        return problem.predict(dict(zip(names, jnp.exp(logs), strict=True)))

    predict, slopes = jax.jit(predicted), jax.jit(jax.jacfwd(predicted))
    number = DENSE[len(names)] if problem.everywhere else OF_PARTICLES
    at_once = jax.jit(lambda places: jax.lax.map(predicted, places, batch_size=256))
    low = np.maximum(middle - WIDE * width, lower + 1e-6)
    high = np.minimum(middle + WIDE * width, upper - 1e-6)
    axes = [np.linspace(low[place], high[place], number) for place in range(len(names))]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(names))
    predictions = np.asarray(at_once(grid))
    return Reference(
        problem,
        names,
        middle,
        width,
        lower,
        upper,
        predict,
        slopes,
        grid,
        predictions,
    )
