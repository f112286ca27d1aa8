"""Profile likelihoods: the rise of chi-squared while one value is held and the others are refitted.

Unlike a standard error from the curvature at the optimum, a profile shows a valley that bends, or
that has no end.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm, t
from tqdm import tqdm

from calibrate.inference.curvature import information, standard_errors
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from mrjax.core.promotion import relaxed_promotion
from mrjax.core.text import in_terminal

LEVELS = {"68 %": 1.0, "95 %": 3.841459}
"""Increase of chi-squared at the ends of an interval, by its coverage, of errors as stated."""
REACH, POINTS = 4.0, 9
"""Half width of a profile, in standard errors, and its number of points."""
GAUSS_NEWTON_STEPS = 2
"""Gauss-Newton steps at each point; few suffice, since they start in a straight valley."""


def levels(degrees_of_freedom: float = np.inf) -> dict[str, float]:
    """Increase of chi-squared at the ends of an interval, by its coverage.

    For stated errors it is that of `LEVELS`. For estimated errors it is the square of Student's t:
    their own uncertainty makes intervals wider.

    Args:
      degrees_of_freedom: those of the estimated errors; infinite if errors are stated.
    """
    if not np.isfinite(degrees_of_freedom):
        return LEVELS
    tails = {coverage: norm.cdf(level**0.5) for coverage, level in LEVELS.items()}
    return {name: float(t.ppf(tail, degrees_of_freedom) ** 2) for name, tail in tails.items()}


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of one fitted value."""

    name: str
    values: np.ndarray
    """Values at which the parameter was held, (K,)."""
    increase: np.ndarray
    """Increase of chi-squared, priors included, over that of the fit; (K,)."""
    intervals: dict[str, tuple[float, float]]
    """Intervals by coverage; an end beyond the profile is 0 or infinite."""
    levels: dict[str, float] = field(default_factory=lambda: LEVELS)
    """Increase of chi-squared at the ends of the intervals, by coverage."""


def profiles(
    fit: Fit, progress: bool = False, degrees_of_freedom: float = np.inf
) -> tuple[Profile, ...]:
    """Profiles of all values with a finite standard error.

    Args:
      fit: a converged fit.
      progress: whether to show a progress bar, on standard error.
      degrees_of_freedom: those of estimated errors; infinite if errors are stated.
    """
    level_of = levels(degrees_of_freedom)
    errors = standard_errors(fit)
    bounded = [place for place, name in enumerate(fit.names) if np.isfinite(errors[name])]
    total = len(bounded) * (1 + POINTS)
    shown = tqdm(desc="profiles", total=total, disable=not progress, leave=False)
    with stoppable(), shown as bar:
        return tuple(
            _profile(fit, place, errors[fit.names[place]] / fit.values[place], level_of, bar)
            for place in bounded
        )


def _profile(fit: Fit, place: int, error: float, level_of: dict[str, float], bar: tqdm) -> Profile:
    name = fit.names[place]
    best = np.log(fit.values)
    curved = information(fit)
    free = np.array([other for other in range(best.size) if other != place], int)
    # The direction of a straight valley.
    tangent = np.zeros(best.size)
    tangent[place] = 1.0
    within = curved[np.ix_(free, free)]
    tangent[free] = -np.linalg.pinv(within, hermitian=True) @ curved[free, place]
    reach = (
        REACH * error * max((level_of[coverage] / LEVELS[coverage]) ** 0.5 for coverage in level_of)
    )
    offsets = np.linspace(-reach, reach, POINTS)
    with relaxed_promotion():
        bar.set_postfix_str(in_terminal(name))
        lowest = _least_chi_squared(fit, free, best, steps=0)
        increase = np.empty(POINTS)
        for number, offset in enumerate(offsets):
            bar.update()
            logs = fit.box.clip(best + offset * tangent)
            logs[place] = best[place] + offset
            increase[number] = _least_chi_squared(fit, free, logs, GAUSS_NEWTON_STEPS)
        bar.update()
    increase -= lowest
    values = fit.values[place] * np.exp(offsets)
    intervals = {
        coverage: _interval(values, increase, level) for coverage, level in level_of.items()
    }
    return Profile(name, values, increase, intervals, level_of)


def _least_chi_squared(fit: Fit, free: np.ndarray, logs: np.ndarray, steps: int) -> float:
    """The least chi-squared near logarithms, (P,), of which only the free ones change.

    Every step is one call of a program that the fit has compiled.
    """
    least = np.inf
    for _ in range(steps + 1):
        jacobian, value = map(np.asarray, fit.linearised(logs, fit.given))
        least = min(least, float(value @ value))
        if not np.isfinite(jacobian).all() or not free.size:
            break
        step, *_ = np.linalg.lstsq(jacobian[:, free], -value, rcond=None)
        logs = logs.copy()
        logs[free] += step
        logs[free] = fit.box.clip(logs)[free]
    return least


def _interval(values: np.ndarray, increase: np.ndarray, level: float) -> tuple[float, float]:
    """The two values at which the increase reaches a level."""
    middle = len(values) // 2

    def crossing(step: int, beyond: float) -> float:
        for place in range(middle, len(values) - 1 if step > 0 else 0, step):
            near, far = increase[place], increase[place + step]
            if near < level <= far:
                # Between points chi-squared is a parabola about the optimum: its root is linear.
                share = (np.sqrt(level) - np.sqrt(max(near, 0.0))) / (
                    np.sqrt(far) - np.sqrt(max(near, 0.0))
                )
                logs = np.log(values)
                return float(np.exp(logs[place] + share * (logs[place + step] - logs[place])))
        return beyond

    return crossing(-1, 0.0), crossing(1, np.inf)
