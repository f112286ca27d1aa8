"""Values that fix the shapes of a run must be known while it is traced."""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, errors, lax
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
    """The same tree of numbers; NaN where traced, which spreads to all that depends on it.

    To be called, and computed with, under `jax.ensure_compile_time_eval`.
    """

    def number(leaf: ArrayLike) -> Array:
        value = concrete(leaf)
        return jnp.asarray(np.nan if value is None else value, float)

    return jax.tree.map(number, tree)
