"""The search of a fit: optax looks for the valley, from one start or several."""

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
"""Part of the decrease that a Gauss-Newton step promises which it must bring for the search to have
found the valley."""

HOPELESS = 1e-6
"""Distance in logarithms to where a prediction was possible at which a start is given up."""


class Searched(NamedTuple):
    """Where searches end, and what they met on their way."""

    ends: np.ndarray
    """Logarithms, (S, P)."""
    best: np.ndarray
    """Logarithms of the least loss of each, (S, P): a search may leave it."""
    least: np.ndarray
    """Half the sum of squares there, (S,)."""
    losses: list[float]
    """The best of all before each step."""
    runs: int
    """Runs of the model."""


def search(
    programs: Programs,
    evaluator: Evaluator,
    places: np.ndarray,
    linear: Callable,
    optimizer: optax.GradientTransformationExtraArgs,
    most_steps: int,
) -> Searched:
    """Optax over logarithms until each is in a valley, where Gauss-Newton steps are to be trusted.

    Args:
      programs: those of the fit.
      evaluator: what asks the model.
      places: logarithms at which the searches begin, (S, P).
      linear: Jacobian and residuals of all of them.
      optimizer: one step of each search.
      most_steps: at most.
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
    usable = places.copy()  # where something could be predicted last, or Gauss-Newton leads
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
            ahead = _trusted(evaluator, here)
            runs += 1
            in_valley[row] = ahead is not None
            usable[row] = ahead if in_valley[row] else places[row]
        # From where nothing can be predicted, halfway back to where it could.
        halfway = 0.5 * (places + usable)
        hopeless = lost & (np.abs(halfway - usable).max(axis=1) < HOPELESS)
        if (in_valley | hopeless).all():
            break
        moving = finite & ~in_valley
        moved, next_state = update(places, state, value, jacobian)
        state = jax.tree.map(partial(_where, moving), next_state, state)
        places = evaluator.box.clip(_where(moving, moved, _where(lost, halfway, usable)))
    return Searched(usable, best, least, losses, runs)


def _where(rows: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """New where a row is chosen, (S, ...)."""
    return np.where(rows.reshape(-1, *[1] * (np.ndim(new) - 1)), new, old)


def _trusted(evaluator: Evaluator, here: Point) -> np.ndarray | None:
    """The end of a Gauss-Newton step that brings the decrease it promises, else None; one run.

    Nowhere, where it promises nothing.
    """
    change, gain = levenberg.step(here, evaluator.box, levenberg.LONGEST)
    if gain < levenberg.DONE:
        return here.logs
    ahead = evaluator.at(here.logs + change)
    return ahead.logs if here.loss - ahead.loss >= TRUSTED_FROM * 0.5 * gain else None
