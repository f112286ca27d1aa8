"""The record of a run in pieces: rows of observables, in SI, and their arrays on disk."""

from collections.abc import Mapping
from typing import Any, TypeVar

import jax
import numpy as np

from mrjax.dem.engine import Observed

T = TypeVar("T")


class Recording:
    """Observables at the start and in every frame so far, on the host."""

    def __init__(self, at_start: Observed, order: np.ndarray | None) -> None:
        """Begins a recording.

        Args:
          at_start: observables at the start, in SI.
          order: place of every particle of the caller among those of the run, (N,); None if the
            orders are the same.
        """
        self.order = order
        self.rows = [jax.tree.map(lambda leaf: leaf[None], at_start)]
        self._stored = 0

    def add(self, rows: Observed) -> None:
        """Appends the rows of further frames, (frames, ...) in SI."""
        self.rows.append(rows)

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed of the particles at the start and in every frame so far, m/s."""
        return np.concatenate([row.speed for row in self.rows])

    def mean_height(self, weights: np.ndarray) -> np.ndarray:
        """Weighted mean of the heights at the start and in every frame so far, m.

        Args:
          weights: weight of each particle, in the order of the run, (N,); its sign may be negative.
        """
        return np.concatenate([row.heights @ weights for row in self.rows]) / len(weights)

    def whole(self) -> Observed:
        """All rows, with particles in the order of the caller."""
        whole: Observed = jax.tree.map(lambda *leaves: np.concatenate(leaves), *self.rows)
        if self.order is None:
            return whole
        trajectory = jax.tree.map(lambda leaf: leaf[:, self.order], whole.trajectory)
        return whole._replace(heights=whole.heights[:, self.order], trajectory=trajectory)

    def empty_row(self) -> Observed:
        """One row of the right shapes, whose values are not used."""
        return jax.tree.map(lambda leaf: leaf[:1], self.rows[0])

    def new_arrays(self) -> dict[str, np.ndarray]:
        """The arrays of the rows since the last call, by name; of length 0 if there are none."""
        nothing = jax.tree.map(lambda leaf: leaf[:0], self.rows[0])
        fresh = [nothing, *self.rows[self._stored :]]
        self._stored = len(self.rows)
        return named_arrays("seen", jax.tree.map(lambda *leaves: np.concatenate(leaves), *fresh))

    def restore(self, recorded: list[dict[str, np.ndarray]]) -> None:
        """Restores the rows from the arrays that all calls of `new_arrays` returned.

        Raises:
          KeyError: an array is missing.
        """
        row = self.rows[0]
        self.rows = [tree_of_arrays("seen", arrays, row) for arrays in recorded]
        self._stored = len(self.rows)


def named_arrays(name: str, tree: Any) -> dict[str, np.ndarray]:
    """The arrays of a tree by name."""
    leaves, _ = jax.tree.flatten_with_path(tree)
    return {f"{name}{jax.tree_util.keystr(path)}": np.asarray(leaf) for path, leaf in leaves}


def tree_of_arrays(name: str, arrays: Mapping[str, np.ndarray], like: T) -> T:
    """The tree whose arrays `named_arrays` named; `arrays` may hold others, too.

    Raises:
      KeyError: an array is missing.
    """
    leaves, structure = jax.tree.flatten_with_path(like)
    values = (arrays[f"{name}{jax.tree_util.keystr(path)}"] for path, _ in leaves)
    return jax.tree.unflatten(structure, values)
