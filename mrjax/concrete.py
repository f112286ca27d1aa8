"""Values that fix the shapes of a run must be known while it is traced."""

from typing import TypeVar

import jax
import numpy as np
from jax import errors, lax
from jax.typing import ArrayLike

Tree = TypeVar("Tree")


def concrete(value: ArrayLike) -> np.ndarray | None:
    """The value as a numpy array, also under `grad` and `jvp`; None under `jit` or `vmap` over it.

    Dropping the derivative uncovers the value that a differentiated call carries.
    """
    try:
        return np.asarray(lax.stop_gradient(value) if isinstance(value, jax.core.Tracer) else value)
    except (errors.TracerArrayConversionError, errors.ConcretizationTypeError):
        return None


def known(tree: Tree) -> Tree:
    """The same tree with numbers for leaves: NaN, which spreads to what depends on it, if traced."""

    def number(leaf: ArrayLike) -> np.ndarray:
        value = concrete(leaf)
        return np.asarray(np.nan) if value is None else value

    return jax.tree.map(number, tree)
