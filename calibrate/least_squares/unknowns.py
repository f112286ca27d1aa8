"""The unknowns of a fit: P positive numbers by name, and the starts of searches."""

import math
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array

from calibrate.least_squares.bounds import Bounds, log_bounds
from calibrate.least_squares.draws import SPREAD, draw
from calibrate.least_squares.priors import LogNormal, prior_arrays
from mrjax import InputError


class Unknowns(NamedTuple):
    """P positive numbers, flattened from a pytree, with bounds and priors."""

    names: tuple[str, ...]
    values: np.ndarray
    """Values at the start, (P,)."""
    structure: Any
    """Structure of the pytree."""
    shapes: tuple[tuple[int, ...], ...]
    """Shapes of its leaves."""
    box: Bounds
    """Bounds of the logarithms."""
    median: np.ndarray
    """Medians of the priors, (P,); 1 without one."""
    precision: np.ndarray
    """1 / log_standard_deviation^2 of the priors, (P,); 0 without one."""

    @property
    def with_prior(self) -> tuple[int, ...]:
        """Indices of the numbers that have a prior."""
        return tuple(int(place) for place in np.flatnonzero(self.precision))

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations of the logarithms, (P,): those of the priors, or `SPREAD`."""
        has_prior = self.precision > 0.0
        return np.where(has_prior, 1.0 / np.sqrt(np.where(has_prior, self.precision, 1.0)), SPREAD)

    def tree(self, values: Any) -> Any:
        """Values, (P,), in the pytree."""
        return tree(values, self.structure, self.shapes)

    def starts(self, number: int, seed: int) -> np.ndarray:
        """Logarithms at the starts of a number of searches, (S, P), within the bounds.

        The first is the start of the fit; the others are drawn from the priors, or about that start
        without a prior.
        """
        first = self.box.clip(np.log(self.values))
        if number == 1:
            return first[None]
        middle = np.where(self.precision > 0.0, np.log(self.median), first)
        return np.vstack([first, draw(middle, self.spread, self.box, number - 1, seed)])


def unknowns(
    start: Any, priors: dict[str, LogNormal], bounds: dict[str, tuple[float, float]]
) -> Unknowns:
    """Flattens a pytree of positive numbers into the unknowns of a fit.

    Args:
      start: a pytree of positive numbers.
      priors, bounds: priors and bounds by name.

    Raises:
      InputError: a start, prior or bound that cannot be used.
    """
    names = _names(start)
    leaves, structure = jax.tree.flatten(start)
    values = np.concatenate([np.ravel(leaf).astype(float) for leaf in leaves])
    _refuse_unusable(names, values, priors, bounds)
    shapes = tuple(np.shape(leaf) for leaf in leaves)
    return Unknowns(
        names, values, structure, shapes, log_bounds(names, bounds), *prior_arrays(names, priors)
    )


def tree(values: Array, structure: Any, shapes: tuple[tuple[int, ...], ...]) -> Any:
    """Values, (P,), in a pytree."""
    sizes = [math.prod(shape) for shape in shapes]
    leaves = [
        values[end - size : end].reshape(shape)
        for end, size, shape in zip(np.cumsum(sizes), sizes, shapes, strict=True)
    ]
    return jax.tree.unflatten(structure, leaves)


def _names(start: Any) -> tuple[str, ...]:
    """`f_w` for a leaf start["f_w"], `f_w[1]` for its second element if it is an array."""
    names = []
    for path, leaf in jax.tree.leaves_with_path(start):
        label = jax.tree_util.keystr(path, simple=True, separator=".") or "theta"
        indices = np.ndindex(np.shape(leaf))
        names += [f"{label}[{','.join(map(str, index))}]" if index else label for index in indices]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"start: two of its parameters are called {name!r}, one by a key with a dot or "
                "brackets in it; give them names of their own"
            )
    if not names:
        raise InputError("start: has no parameters; give at least one positive number")
    return tuple(names)


def _refuse_unusable(
    names: tuple[str, ...],
    values: np.ndarray,
    priors: dict[str, LogNormal],
    bounds: dict[str, tuple[float, float]],
) -> None:
    for name, value in zip(names, values, strict=True):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"start of {name} = {value}: must be a positive number")
    for kind, table in (("prior", priors), ("bounds", bounds)):
        for name in table:
            if name not in names:
                raise InputError(
                    f"{kind} for {name!r}: no such parameter; the start has {', '.join(names)}"
                )
    for name, prior in priors.items():
        if not (0 < prior.median < np.inf and 0 < prior.log_standard_deviation < np.inf):
            raise InputError(f"prior of {name} = {prior}: both numbers must be positive")
    start = dict(zip(names, values, strict=True))
    for name, (lower, upper) in bounds.items():
        if not 0 <= lower < upper:
            raise InputError(
                f"bounds of {name} = ({lower:g}, {upper:g}): must be two numbers from 0 on, the "
                "lower first"
            )
        if not lower * (1.0 - 1e-9) <= start[name] <= upper * (1.0 + 1e-9):  # but for rounding
            raise InputError(
                f"start of {name} = {start[name]:g}: must be within its bounds, {lower:g} to "
                f"{upper:g}"
            )
