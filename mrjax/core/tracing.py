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
"""Errors that JAX raises if a traced value is used as a number."""


def value_or_none(value: ArrayLike) -> np.ndarray | None:
    """Returns the value as a numpy array, also under `grad` and `jvp`.

    The value is None under `jit` or `vmap` over it. A differentiated call carries the value
    together with its derivative; the derivative is dropped.
    """
    try:
        return np.asarray(lax.stop_gradient(value) if isinstance(value, jax.core.Tracer) else value)
    except TRACED:
        return None


def is_concrete(tree: Any) -> bool:
    """True if no value is traced and results computed from the values are not traced either."""
    leaves = jax.tree.leaves(tree)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)
    # Within jit, constants become traced values, too.
    return not traced and not isinstance(jnp.zeros(()) + 0.0, jax.core.Tracer)


def drop_tracers(tree: Tree) -> Tree:
    """Returns the tree with plain numbers in place of differentiated ones.

    Values whose number is unknown (under `jit` or `vmap`) stay as they are.
    """

    def number(leaf: ArrayLike) -> ArrayLike:
        value = value_or_none(leaf)
        return leaf if value is None else jnp.asarray(value, float)

    with jax.ensure_compile_time_eval():
        return jax.tree.map(number, tree)


def evaluated_or_none(law: Callable, *arguments: Any) -> Any:
    """Evaluates a law to numpy arrays; returns None if the result depends on a traced value.

    Args:
      law: a function written with JAX or numpy.
      arguments: its arguments, from `drop_tracers`. Arguments that the law does not read may be
        traced.
    """
    try:
        with jax.ensure_compile_time_eval():
            return jax.tree.map(np.asarray, law(*arguments))
    except TRACED:
        return None
