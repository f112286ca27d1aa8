"""Profile likelihoods: how the best fit worsens as one value is held away from its own.

The other values follow. Unlike an error bar from the curvature at the optimum this sees a valley
that bends, or ends in nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.fit import Fit
from calibrate.identify import identify, information
from mrjax.permissive import permissive

LEVELS = {"68 %": 1.0, "95 %": 3.841459}
"""Increase of chi-squared at the ends of an interval, by its coverage."""
REACH, POINTS = 4.0, 9
"""Of a profile, in standard errors to either side; its number of points."""
GAUSS_NEWTON_STEPS = 3
"""From where a straight valley leads, which is near."""


@dataclass(frozen=True)
class Profile:
    """Of one fitted value."""

    name: str
    values: np.ndarray
    """Where it was held, (K,)."""
    increase: np.ndarray
    """Of chi-squared, priors included, over that of the fit; (K,)."""
    intervals: dict[str, tuple[float, float]]
    """By coverage; an end that lies beyond the profile is 0 or infinite."""


def profiles(fit: Fit) -> tuple[Profile, ...]:
    """A profile of every value that has an error bar.

    Args:
      fit: converged.
    """
    errors = identify(fit).standard_errors
    found = []
    for place, (name, value) in enumerate(zip(fit.names, fit.values, strict=True)):
        if np.isfinite(errors[name]):
            found.append(_profile(fit, place, name, errors[name] / value))
    return tuple(found)


def _profile(fit: Fit, place: int, name: str, error: float) -> Profile:
    best = jnp.log(jnp.asarray(fit.values))
    curved = information(fit)
    free = tuple(other for other in range(best.size) if other != place)
    # Where a straight valley leads.
    along = np.zeros(best.size)
    along[place] = 1.0
    within = curved[np.ix_(free, free)]
    along[list(free)] = -np.linalg.pinv(within, hermitian=True) @ curved[list(free), place]
    with permissive():
        lowest = float(jnp.sum(fit.everything(best, fit.given) ** 2))
        offsets = jnp.linspace(-REACH * error, REACH * error, POINTS)
        starts = best + offsets[:, None] * jnp.asarray(along)
        increase = np.asarray(_held(fit.everything, free, starts, fit.given)) - lowest
    values = fit.values[place] * np.exp(np.asarray(offsets))
    intervals = {coverage: _interval(values, increase, level) for coverage, level in LEVELS.items()}
    return Profile(name, values, increase, intervals)


@partial(jax.jit, static_argnames=("everything", "free"))
def _held(everything: Callable, free: tuple[int, ...], starts: Array, given: Any) -> Array:
    """Least chi-squared from each of the starts, (K, P), where only the free ones follow; (K,)."""
    places = np.array(free, int)

    def lowest(start: Array) -> Array:
        def residuals(logs: Array) -> Array:
            return everything(start.at[places].set(logs), given)

        def with_value(logs: Array) -> tuple[Array, Array]:
            value = residuals(logs)
            return value, value

        def improved(_, reached: tuple[Array, Array]) -> tuple[Array, Array]:
            logs, least = reached
            jacobian, value = jax.jacfwd(with_value, has_aux=True)(logs)
            step, *_ = jnp.linalg.lstsq(jacobian, -value)
            return logs + step, jnp.minimum(least, value @ value)

        reached = start[places], jnp.asarray(jnp.inf, start.dtype)
        if free:
            reached = jax.lax.fori_loop(0, GAUSS_NEWTON_STEPS, improved, reached)
        return jnp.minimum(reached[1], jnp.sum(residuals(reached[0]) ** 2))

    return jax.lax.map(lowest, starts)


def _interval(values: np.ndarray, increase: np.ndarray, level: float) -> tuple[float, float]:
    """Where the increase reaches a level on either side of its least."""
    middle = len(values) // 2

    def crossing(way: int, beyond: float) -> float:
        for place in range(middle, len(values) - 1 if way > 0 else 0, way):
            near, far = increase[place], increase[place + way]
            if near < level <= far:
                # Between points a parabola about the optimum: straight in the root.
                share = (np.sqrt(level) - np.sqrt(max(near, 0.0))) / (
                    np.sqrt(far) - np.sqrt(max(near, 0.0))
                )
                logs = np.log(values)
                return float(np.exp(logs[place] + share * (logs[place + way] - logs[place])))
        return beyond

    return crossing(-1, 0.0), crossing(1, np.inf)
