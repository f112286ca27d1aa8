"""The search of a fit for a valley, by optax, from one start or several."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
import optax
from jax import Array

from calibrate.least_squares import levenberg
from calibrate.least_squares.evaluator import Evaluator, half_square
from calibrate.least_squares.evaluator import finite as is_finite
from calibrate.least_squares.levenberg import Point
from calibrate.least_squares.programs import Programs, over_starts

TRUSTED_FROM = 0.25
"""Ratio of the actual to the expected decrease of a Gauss-Newton step, from which on the search has
found a valley."""

HOPELESS = 1e-6
"""A start is given up at this distance, in logarithms, from its last point with a prediction."""


class Searched(NamedTuple):
    """Ends of searches, and the best points that they met."""

    ends: np.ndarray
    """Logarithms at the ends, (S, P)."""
    best: np.ndarray
    """Logarithms at the least loss of each search, (S, P); a search may leave that point."""
    least: np.ndarray
    """Least loss of each search, (S,)."""
    losses: list[float]
    """Least loss of all searches before each step."""
    runs: int
    """Number of model runs."""


def search(
    programs: Programs,
    evaluator: Evaluator,
    places: np.ndarray,
    linear: Callable,
    optimizer: optax.GradientTransformationExtraArgs,
    most_steps: int,
) -> Searched:
    """Runs optax until each search is in a valley, where Gauss-Newton steps can be trusted.

    Args:
      programs: the programs of the fit.
      evaluator: evaluates the model.
      places: logarithms at which the searches begin, (S, P).
      linear: function from these to Jacobians and residuals.
      optimizer: optax optimizer.
      most_steps: most steps.
    """
    state = jax.jit(jax.vmap(optimizer.init))(places)
    losses: list[float] = []
    runs = 0

    def loss_of(logs: Array) -> Array:
        value = programs.traceable(logs, evaluator.given)
        return 0.5 * value @ value

    def updated(logs: Array, state: Any, value: Array, jacobian: Array) -> tuple[Array, Any]:
        gradient = jacobian.T @ value
        change, state = optimizer.update(
            gradient, state, logs, value=0.5 * value @ value, grad=gradient, value_fn=loss_of
        )
        return optax.apply_updates(logs, change), state

    update = over_starts(jax.jit(updated), len(places))
    in_valley = np.zeros(len(places), bool)
    best, least = places.copy(), np.full(len(places), np.inf)
    usable = places.copy()  # last points with a prediction, or ends of Gauss-Newton steps
    for _ in range(most_steps):
        jacobian, value = linear(places)
        runs += int((~in_valley).sum())
        loss = np.array([half_square(residuals) for residuals in value])
        lower = loss < least
        best[lower], least[lower] = places[lower], loss[lower]
        losses.append(float(least.min()))
        evaluator.tell("search", losses[-1])
        finite = np.array([is_finite(*arrays) for arrays in zip(jacobian, value, strict=True)])
        lost = ~finite & ~in_valley
        for row in np.flatnonzero(finite & ~in_valley):
            here = Point(half_square(value[row]), places[row], jacobian[row], value[row])
            ahead = _trusted_step(evaluator, here)
            runs += 1
            in_valley[row] = ahead is not None
            usable[row] = ahead if in_valley[row] else places[row]
        # Without a prediction, halfway back to the last point with one.
        halfway = 0.5 * (places + usable)
        hopeless = lost & (np.abs(halfway - usable).max(axis=1) < HOPELESS)
        if (in_valley | hopeless).all():
            break
        moving = finite & ~in_valley
        moved, next_state = update(places, state, value, jacobian)
        state = jax.tree.map(partial(_select_rows, moving), next_state, state)
        places = evaluator.box.clip(
            _select_rows(moving, moved, _select_rows(lost, halfway, usable))
        )
    return Searched(usable, best, least, losses, runs)


def _select_rows(rows: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """`new` in the chosen rows, else `old`, (S, ...)."""
    return np.where(rows.reshape(-1, *[1] * (np.ndim(new) - 1)), new, old)


def _trusted_step(evaluator: Evaluator, here: Point) -> np.ndarray | None:
    """The end of a Gauss-Newton step that brings the expected decrease, else None; one model run.

    If no decrease is expected, the end is the point itself.
    """
    change, gain = levenberg.step(here, evaluator.box, levenberg.LONGEST)
    if gain < levenberg.DONE:
        return here.logs
    ahead = evaluator.at(here.logs + change)
    return ahead.logs if here.loss - ahead.loss >= TRUSTED_FROM * 0.5 * gain else None
