"""A few numbers from a law of JAX by numpy: XLA takes longer to compile a law than it is worth.

The law, written once, is traced, and the operations of what was traced are done one by one. A law
with one that is not known here is left to JAX.
"""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal
from jax.typing import ArrayLike


def evaluate_with_numpy(law: Callable, *arguments: Any) -> Any:
    """Evaluates a law of JAX with numpy; returns numpy arrays.

    Args:
      law: a function of JAX.
      arguments: trees of numbers and arrays; under a trace to be called under
        `jax.ensure_compile_time_eval`.

    Raises:
      jax.errors.TracerArrayConversionError: an argument that the law reads is traced.
    """
    traced, shapes = jax.make_jaxpr(law, return_shape=True)(*arguments)
    try:
        with np.errstate(all="ignore"):  # infinite or not a number without a word, as in JAX
            found = _evaluated(traced, *jax.tree.leaves(arguments))
    except _UnknownError:
        return jax.tree.map(np.asarray, law(*arguments))
    return jax.tree.unflatten(jax.tree.structure(shapes), found)


class _UnknownError(Exception):
    """An operation that is none of those below."""


def _evaluated(closed: ClosedJaxpr, *arguments: ArrayLike) -> list[np.ndarray]:
    jaxpr: Jaxpr = closed.jaxpr
    values = dict(zip(jaxpr.constvars, closed.consts, strict=True))
    values |= zip(jaxpr.invars, arguments, strict=True)

    def value(variable: Any) -> np.ndarray:
        if isinstance(variable, Literal):
            return np.asarray(variable.val, variable.aval.dtype)  # type: ignore[attr-defined] # an array
        return np.asarray(values[variable])  # what nothing reads may be traced

    for equation in jaxpr.eqns:
        results = _done(equation, [value(variable) for variable in equation.invars])
        values |= zip(equation.outvars, results, strict=True)
    return [value(variable) for variable in jaxpr.outvars]


ELEMENTWISE = {
    "abs": np.abs, "acosh": np.arccosh, "add": np.add, "add_any": np.add, "and": np.bitwise_and,
    "atan2": np.arctan2, "cbrt": np.cbrt, "eq": np.equal, "exp": np.exp, "ge": np.greater_equal,
    "gt": np.greater, "le": np.less_equal, "log": np.log, "lt": np.less, "max": np.maximum,
    "min": np.minimum, "mul": np.multiply, "ne": np.not_equal, "neg": np.negative,
    "not": np.invert, "or": np.bitwise_or, "pow": np.power, "sqrt": np.sqrt, "sub": np.subtract,
}  # fmt: skip
REDUCTIONS = {
    "reduce_and": np.bitwise_and, "reduce_max": np.maximum, "reduce_min": np.minimum,
    "reduce_or": np.bitwise_or, "reduce_sum": np.add,
}  # fmt: skip
CALLS = {"jit": "jaxpr", "pjit": "jaxpr", "custom_jvp_call": "call_jaxpr"}
"""What holds the operations of one that stands for several."""


def _done(equation: JaxprEqn, arguments: list[np.ndarray]) -> list[np.ndarray]:
    name, given = equation.primitive.name, equation.params
    first = arguments[0]
    match name:
        case _ if name in ELEMENTWISE:
            return [ELEMENTWISE[name](*arguments)]
        case _ if name in REDUCTIONS:
            return [REDUCTIONS[name].reduce(first, axis=given["axes"])]
        case _ if name in CALLS:
            return _evaluated(given[CALLS[name]], *arguments)
        case "div" if first.dtype.kind == "f":
            return [np.divide(*arguments)]
        case "integer_pow" if first.dtype.kind == "f":
            return [first ** given["y"]]
        case "convert_element_type":
            return [first.astype(given["new_dtype"])]
        case "reshape":
            return [np.reshape(first, given["new_sizes"])]
        case "broadcast_in_dim" if len(arguments) == 1:
            shape = [1] * len(given["shape"])
            for axis, length in zip(given["broadcast_dimensions"], first.shape, strict=True):
                shape[axis] = length
            return [np.broadcast_to(np.reshape(first, shape), given["shape"])]
        case "select_n" if first.dtype == bool:
            _, otherwise, where = arguments
            return [np.where(first, where, otherwise)]
        case "stack":
            return [np.stack(arguments, axis=given["axis"])]
        case "scan" if given["num_consts"] + given["num_carry"] == len(arguments) and (
            given["num_carry"] == len(equation.outvars)
        ):
            fixed, carried = arguments[: given["num_consts"]], arguments[given["num_consts"] :]
            for _ in range(given["length"]):
                carried = _evaluated(given["jaxpr"], *fixed, *carried)
            return carried
    raise _UnknownError
