"""Evaluation of JAX functions by numpy, without compilation.

For a few numbers, XLA takes longer to compile a law than numpy to evaluate it. The law is traced,
and numpy does the traced operations one by one. A law with an operation that is not implemented
here is left to JAX.
"""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal
from jax.typing import ArrayLike


def evaluate_with_numpy(law: Callable, *arguments: Any) -> Any:
    """Evaluates a law written for JAX with numpy; returns numpy arrays.

    Within a JAX transformation, call it under `jax.ensure_compile_time_eval`.

    Args:
      law: a function written with JAX.
      arguments: trees of numbers and arrays.

    Raises:
      jax.errors.TracerArrayConversionError: an argument that the law reads is traced.
    """
    traced, shapes = jax.make_jaxpr(law, return_shape=True)(*arguments)
    try:
        with np.errstate(all="ignore"):  # no warning for infinity or NaN, as in JAX
            results = _evaluate(traced, *jax.tree.leaves(arguments))
    except _UnknownError:
        return jax.tree.map(np.asarray, law(*arguments))
    return jax.tree.unflatten(jax.tree.structure(shapes), results)


class _UnknownError(Exception):
    """An operation that is not implemented here."""


def _evaluate(closed: ClosedJaxpr, *arguments: ArrayLike) -> list[np.ndarray]:
    jaxpr: Jaxpr = closed.jaxpr
    values = dict(zip(jaxpr.constvars, closed.consts, strict=True))
    values |= zip(jaxpr.invars, arguments, strict=True)

    def value(variable: Any) -> np.ndarray:
        if isinstance(variable, Literal):
            return np.asarray(variable.val, variable.aval.dtype)  # type: ignore[attr-defined] # an array
        return np.asarray(values[variable])  # converted when it is read: the rest may be traced

    for equation in jaxpr.eqns:
        results = _apply(equation, [value(variable) for variable in equation.invars])
        values |= zip(equation.outvars, results, strict=True)
    return [value(variable) for variable in jaxpr.outvars]


ELEMENTWISE = {
    "abs": np.abs, "acosh": np.arccosh, "add": np.add, "add_any": np.add, "and": np.bitwise_and,
    "atan2": np.arctan2, "cbrt": np.cbrt, "cos": np.cos, "eq": np.equal, "exp": np.exp,
    "expm1": np.expm1, "ge": np.greater_equal, "gt": np.greater, "le": np.less_equal,
    "log": np.log, "log1p": np.log1p, "lt": np.less, "max": np.maximum,
    "min": np.minimum, "mul": np.multiply, "ne": np.not_equal, "neg": np.negative,
    "not": np.invert, "or": np.bitwise_or, "pow": np.power, "sign": np.sign,
    "sin": np.sin, "sqrt": np.sqrt, "square": np.square, "sub": np.subtract, "tanh": np.tanh,
}  # fmt: skip
REDUCTIONS = {
    "reduce_and": np.bitwise_and, "reduce_max": np.maximum, "reduce_min": np.minimum,
    "reduce_or": np.bitwise_or, "reduce_sum": np.add,
}  # fmt: skip
CALLS = {"jit": "jaxpr", "pjit": "jaxpr", "custom_jvp_call": "call_jaxpr"}
"""Parameter that holds the inner operations, by the name of a composite operation."""


def _apply(equation: JaxprEqn, arguments: list[np.ndarray]) -> list[np.ndarray]:
    name, params = equation.primitive.name, equation.params
    first = arguments[0]
    match name:
        case _ if name in ELEMENTWISE:
            return [ELEMENTWISE[name](*arguments)]
        case _ if name in REDUCTIONS:
            return [REDUCTIONS[name].reduce(first, axis=params["axes"])]
        case _ if name in CALLS:
            return _evaluate(params[CALLS[name]], *arguments)
        case "div" if first.dtype.kind == "f":
            return [np.divide(*arguments)]
        case "integer_pow" if first.dtype.kind == "f":
            return [first ** params["y"]]
        case "convert_element_type":
            return [first.astype(params["new_dtype"])]
        case "reshape":
            return [np.reshape(first, params["new_sizes"])]
        case "broadcast_in_dim" if len(arguments) == 1:
            shape = [1] * len(params["shape"])
            for axis, length in zip(params["broadcast_dimensions"], first.shape, strict=True):
                shape[axis] = length
            return [np.broadcast_to(np.reshape(first, shape), params["shape"])]
        case "select_n" if first.dtype == bool:
            _, otherwise, where = arguments
            return [np.where(first, where, otherwise)]
        case "stack":
            return [np.stack(arguments, axis=params["axis"])]
        case "scan" if params["num_consts"] + params["num_carry"] == len(arguments) and (
            params["num_carry"] == len(equation.outvars)
        ):
            fixed, carried = arguments[: params["num_consts"]], arguments[params["num_consts"] :]
            for _ in range(params["length"]):
                carried = _evaluate(params["jaxpr"], *fixed, *carried)
            return carried
    raise _UnknownError
