"""Runs of the model for a posterior, stored in pieces, with a time estimate and a progress bar."""

import sys
import time
from collections.abc import Callable
from typing import Self

import jax
import numpy as np
from tqdm import tqdm

from calibrate.inference.density import Density
from calibrate.least_squares.interruptible import wait_for
from mrjax.core.units import time_in_words
from mrjax.io.checkpoint import Checkpoint, digest

PIECE = 50
"""Runs that are stored together."""


class ModelRuns:
    """Log-densities at many points, with one run of the model for each.

    The runs follow one another. Mapping them would compile the model again, and would not be faster
    for a column.

    Args:
      density: density of the posterior.
      work: checkpoint that stores every fifty runs; None without one.
      progress: whether to show a progress bar, on standard error.
      expected: expected number of runs.
    """

    def __init__(
        self, density: Density, work: Checkpoint | None, progress: bool, expected: int
    ) -> None:
        self._density, self._work, self._progress = density, work, progress
        self._expected = expected
        self._timed: float | None = None
        self._bar = tqdm(desc="posterior", unit=" runs", disable=not progress, leave=False)

    def __call__(self, logs: np.ndarray) -> np.ndarray:
        """Log-densities, (N,), at logarithms of values, (N, P); not finite without a prediction."""
        pieces = [self._piece(logs[first : first + PIECE]) for first in range(0, len(logs), PIECE)]
        return np.concatenate([np.zeros(0), *pieces])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def _piece(self, logs: np.ndarray) -> np.ndarray:
        label = f"densities-{digest(logs)}"
        if self._work is not None and (stored := self._work.load(label)) is not None:
            self._bar.update(len(logs))
            return stored[0]["densities"]
        residuals = np.stack([self._run(place) for place in logs])
        densities = np.asarray(self._density.log_density(logs, residuals))
        if self._work is not None:
            self._work.save(label, {"densities": densities})
        return densities

    def _run(self, logs: np.ndarray) -> np.ndarray:
        if self._timed is None:
            self._residuals(logs)  # the first call also compiles
            began = time.perf_counter()
            self._residuals(logs)
            self._timed = time.perf_counter() - began
            say_estimate(
                f"{self._expected} model runs", self._expected, self._timed, self._progress
            )
        self._bar.update()
        return self._residuals(logs)

    def _residuals(self, logs: np.ndarray) -> np.ndarray:
        residuals = self._density.everything(logs, self._density.given)
        # Residuals that JAX does not trace are available at once.
        return np.asarray(wait_for(residuals) if isinstance(residuals, jax.Array) else residuals)


def say_estimate(calls: str, number: int, seconds_each: float, progress: bool) -> None:
    """Prints the estimated time of a number of calls on standard error, if progress is shown.

    Args:
      calls: number and kind of the calls, in words.
      number: number of calls.
      seconds_each: time of one call, s.
      progress: whether to print the estimate.
    """
    if progress:
        each, total = time_in_words(seconds_each), time_in_words(number * seconds_each)
        line = f"posterior: about {calls} of {each}, {total}"
        tqdm.write(line, file=sys.stderr)


def seconds_of(function: Callable, *arguments: object) -> float:
    """Time that a compiled function takes, s."""
    began = time.perf_counter()
    jax.block_until_ready(function(*arguments))
    return time.perf_counter() - began
