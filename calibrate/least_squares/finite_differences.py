"""Residuals that JAX cannot trace: they are called with numbers, and slopes are differences.

A slope over a step h in the logarithm has two errors: eps / h for rounding or noise eps of the
residuals, and h^2 / 6 times their third derivative, since differences are central. If h is not
stated, slopes are computed with several trial steps. The step that is used lies between the two
whose slopes differ least.
"""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from numpy.typing import ArrayLike

from calibrate.least_squares.interruptible import raise_if_stopped
from calibrate.least_squares.programs import Given, Programs, pseudo_huber
from calibrate.least_squares.unknowns import Unknowns
from mrjax import InputError

SMALLEST = float(np.finfo(float).eps ** (1.0 / 3.0))
"""Step in the logarithm for residuals that are exact to rounding."""
FACTOR = 16.0
"""Ratio of a trial step to the one before."""
TRIED = SMALLEST * FACTOR ** np.arange(5)
"""Trial steps: from 6e-6 to 0.4, a factor of 1.5."""
UNRELIABLE = 0.1
"""Largest relative change of slopes with the step."""
UNKNOWN = 10.0
"""Standard error of a logarithm above which its slopes are too small to matter."""


class Slopes(NamedTuple):
    """Slopes by differences: their steps, and how far they are to be trusted."""

    steps: np.ndarray
    """Step in each logarithm, (P,)."""
    size: np.ndarray
    """Norm of the slopes of all residuals at the end of a fit, (P,)."""
    uncertainty: np.ndarray
    """Norm of their change with steps twice as long, (P,)."""
    calls: int
    """Number of calls of the residuals."""
    failures: int
    """Number of calls that raised, or gave numbers that are not finite."""

    @property
    def unreliable(self) -> np.ndarray:
        """True for values whose slopes could be noise, and are large enough to matter, (P,)."""
        return (self.uncertainty > UNRELIABLE * self.size) & (self.size > 1.0 / UNKNOWN)


class FiniteDifferences:
    """Residuals in standard deviations and their Jacobian, without tracing.

    Args:
      residuals: as for `fit`, called with numbers.
      unknown: the fitted values.
      robust: as for `fit`.
      step: step in each logarithm; None to choose it.
    """

    def __init__(
        self,
        residuals: Callable[..., Any],
        unknown: Unknowns,
        robust: float | None,
        step: float | None,
    ) -> None:
        self._residuals, self._unknown, self._robust = residuals, unknown, robust
        self._held = np.array(unknown.with_prior, int)
        self._count: int | None = None
        self.steps = np.full(unknown.values.size, np.nan if step is None else step)
        """Step in each logarithm, (P,); NaN until it is chosen."""
        self._calls = self._failures = 0

    @property
    def programs(self) -> Programs:
        """The programs of a fit."""
        return Programs(self.everything, self.everything, self.linearised, traced=False)

    def everything(self, logs: ArrayLike, given: Given) -> Any:
        """Residuals and priors, (M + K,), at logarithms, (P,); NaN if the call fails."""
        if isinstance(logs, jax.core.Tracer):
            raise InputError(
                "these residuals are called with numbers, not traced, so that JAX has no gradient "
                "of them; leave out what needs one"
            )
        logs = np.asarray(logs, float)
        priors = given.weight * (logs[self._held] - given.median)
        return np.concatenate([self._measurement_residuals(logs, given), priors])

    def linearised(self, logs: ArrayLike, given: Given) -> Any:
        """Jacobian, (M + K, P), and residuals with priors, (M + K,)."""
        logs = np.asarray(logs, float)
        self.choose_steps(logs, given)  # at the first call
        value = self.everything(logs, given)
        of_priors = np.zeros((self._held.size, logs.size))
        of_priors[np.arange(self._held.size), self._held] = given.weight
        here = value[: value.size - self._held.size]
        return np.vstack([self._slopes(logs, given, here, self.steps), of_priors]), value

    def choose_steps(self, logs: np.ndarray, given: Given) -> None:
        """Chooses the steps that are not stated, by slopes at logarithms, (P,)."""
        if np.isfinite(self.steps).all():
            return
        here = self._measurement_residuals(logs, given)
        if not np.isfinite(here).all():
            return
        slopes = [self._slopes(logs, given, here, np.full(logs.size, step)) for step in TRIED]
        change = np.array([_norms(after - before) for before, after in itertools.pairwise(slopes)])
        # Residuals that are rounded coarsely do not change at all over small steps.
        flat = np.array([_norms(slope) == 0.0 for slope in slopes])
        change[flat[:-1] & flat[1:]] = np.inf
        best = np.argmin(np.where(np.isnan(change), np.inf, change), axis=0)
        best = np.where(flat.all(axis=0), 0, best)
        self.steps = np.where(np.isnan(self.steps), TRIED[best] * FACTOR**0.5, self.steps)

    def slopes_at(self, logs: np.ndarray, given: Given) -> Slopes:
        """The record of slopes at the end of a fit, at logarithms, (P,)."""
        here = self._measurement_residuals(logs, given)
        once, twice = (self._slopes(logs, given, here, size * self.steps) for size in (1.0, 2.0))
        return Slopes(self.steps, _norms(once), _norms(twice - once), self._calls, self._failures)

    def _slopes(
        self, logs: np.ndarray, given: Given, here: np.ndarray, steps: np.ndarray
    ) -> np.ndarray:
        """Derivatives of residuals, (M, P); one-sided if the call on the other side fails.

        Args:
          logs, given: logarithms, (P,), and the arguments beside them.
          here: residuals there, (M,).
          steps: step in each logarithm, (P,).
        """
        columns = np.full((here.size, logs.size), np.nan)
        if not np.isfinite(here).all():
            return columns
        for place, step in enumerate(steps):
            values, ends = [], []
            for way in (-1.0, 1.0):
                end = logs.copy()
                end[place] += way * step
                end = self._unknown.box.clip(end)
                value = self._measurement_residuals(end, given)
                failed = not np.isfinite(value).all()
                values.append(here if failed else value)
                ends.append(logs[place] if failed else end[place])
            if ends[0] < ends[1]:
                columns[:, place] = (values[1] - values[0]) / (ends[1] - ends[0])
        return columns

    def _measurement_residuals(self, logs: np.ndarray, given: Given) -> np.ndarray:
        """Residuals of the measurements, (M,); NaN if the call fails.

        Raises:
          InputError: the first call fails, or the residuals are no vector of constant size.
        """
        raise_if_stopped()
        try:
            vector = self._call(logs, given)
        except Exception as error:
            self._failures += 1
            if self._count is None:
                raise InputError(
                    f"residuals: raise {type(error).__name__} at the start: {error}; give a start "
                    "where they do not"
                ) from error
            return np.full(self._count, np.nan)
        if self._count is None:
            self._count = vector.size
        if vector.shape != (self._count,) or not vector.size:
            raise InputError(
                f"residuals: have shape {vector.shape}; give a vector of at least one, as long at "
                "all values, (prediction - measurement) / standard deviation of each measurement"
            )
        self._failures += not np.isfinite(vector).all()
        return vector

    def _call(self, logs: np.ndarray, given: Given) -> np.ndarray:
        self._calls += 1
        with np.errstate(all="ignore"):
            theta = jax.tree.map(_number, self._unknown.tree(np.exp(logs)))
            data = () if given.data is None else (given.data,)
            vector = np.atleast_1d(np.asarray(self._residuals(theta, *data), float))
            if self._robust is not None:
                vector = np.asarray(pseudo_huber(vector, self._robust))
        return vector


def _number(leaf: np.ndarray) -> Any:
    """The number in an array without axes; other arrays as they are."""
    return leaf[()]


def _norms(columns: np.ndarray) -> np.ndarray:
    """Euclidean norm of each column, (P,)."""
    return np.asarray(np.linalg.norm(columns, axis=0))
