"""Concrete values of arguments that may be JAX tracers."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import errors, lax
from jax.typing import ArrayLike

Tree = TypeVar("Tree")

TRACED = (errors.TracerArrayConversionError, errors.ConcretizationTypeError)
"""Errors of JAX where a number is wanted of a traced value."""


def value_or_none(value: ArrayLike) -> np.ndarray | None:
    """The value as a numpy array, also under `grad` and `jvp`; None under `jit` or `vmap` over it.

    Dropping the derivative uncovers the value that a differentiated call carries.
    """
    try:
        return np.asarray(lax.stop_gradient(value) if isinstance(value, jax.core.Tracer) else value)
    except TRACED:
        return None


def is_concrete(tree: Any) -> bool:
    """True if no value is traced, and results computed with them are not either."""
    leaves = jax.tree.leaves(tree)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)
    # Under a trace of jit constants become traced values, too.
    return not traced and not isinstance(jnp.zeros(()) + 0.0, jax.core.Tracer)


def drop_tracers(tree: Tree) -> Tree:
    """The same tree of numbers, without what differentiates them; traced ones stay as they are."""

    def number(leaf: ArrayLike) -> ArrayLike:
        value = value_or_none(leaf)
        return leaf if value is None else jnp.asarray(value, float)

    with jax.ensure_compile_time_eval():
        return jax.tree.map(number, tree)


def evaluated_or_none(law: Callable, *arguments: Any) -> Any:
    """Evaluates a law; numpy arrays, or None where the result depends on a traced value.

    Args:
      law: of JAX or numpy.
      arguments: as `drop_tracers` gives them. Those that the law does not read may be traced.
    """
    try:
        with jax.ensure_compile_time_eval():
            return jax.tree.map(np.asarray, law(*arguments))
    except TRACED:
        return None
