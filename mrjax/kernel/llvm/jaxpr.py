"""Translation of a jaxpr of scalars to LLVM instructions, on scalars or on vectors of lanes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal
from llvmlite import ir

INT, LONG, BIT, POINTER = ir.IntType(32), ir.IntType(64), ir.IntType(1), ir.PointerType()
TYPES = {
    "float32": ir.FloatType(),
    "float64": ir.DoubleType(),
    "int32": INT,
    "int64": LONG,
    "bool": BIT,
}
FREE = ("contract", "nsz", "arcp")
"""Fast-math flags that XLA uses too: fused multiply-add, no signed zeros, reciprocals."""


def _nth(value_of: Callable[[Any], ir.Value], atoms: list, place: int) -> ir.Value:
    return value_of(atoms[place])


def as_word(build: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Converts an address to an 8-byte integer; returns an 8-byte integer unchanged."""
    address = isinstance(value.type, ir.PointerType)
    return build.ptrtoint(value, LONG) if address else value


@contextmanager
def counted(build: ir.IRBuilder, begin: ir.Value, end: ir.Value) -> Iterator[ir.Value]:
    """Emits a loop whose index runs from `begin` to `end`, exclusive."""
    before = build.block
    head, body, after = (build.append_basic_block() for _ in range(3))
    build.branch(head)
    build.position_at_end(head)
    index = build.phi(LONG)
    index.add_incoming(begin, before)
    build.cbranch(build.icmp_signed("<", index, end), body, after)
    build.position_at_end(body)
    yield index
    index.add_incoming(build.add(index, LONG(1)), build.block)
    build.branch(head)
    build.position_at_end(after)


def translate(
    build: ir.IRBuilder,
    closed: ClosedJaxpr,
    read: Callable[[int], ir.Value],
    lanes: int | None,
) -> list[ir.Value]:
    """Emits a program of scalars at the position of the builder, and returns its results.

    Args:
      build: the builder.
      closed: the program.
      read: function that returns an argument by its index; it is called where the value is needed.
      lanes: number of lanes of the vectors that replace the scalars; None for scalars.
    """
    indices = {variable: i for i, variable in enumerate(closed.jaxpr.invars)}
    values = {
        variable: _constant(value, variable.aval.dtype, lanes)
        for variable, value in zip(closed.jaxpr.constvars, closed.consts, strict=True)
    }

    def value_of(atom) -> ir.Value:
        if isinstance(atom, Literal):
            return _constant(atom.val, atom.aval.dtype, lanes)  # type: ignore[attr-defined] # an array
        if atom in indices:
            return read(indices[atom])
        return values[atom]

    for equation in closed.jaxpr.eqns:
        inner = next((equation.params[k] for k in INNER if k in equation.params), None)
        if inner is not None:
            results = translate(build, inner, partial(_nth, value_of, equation.invars), lanes)
        else:
            arguments = [value_of(atom) for atom in equation.invars]
            results = [_operation(build, equation, arguments, lanes)]
        values.update(zip(equation.outvars, results, strict=True))
    return [value_of(atom) for atom in closed.jaxpr.outvars]


def _type(dtype: np.dtype, lanes: int | None) -> ir.Type:
    """LLVM type of a scalar, or of a vector with one scalar in each lane.

    Raises:
      NotImplementedError: the dtype is not in `TYPES`.
    """
    if dtype.name not in TYPES:
        raise NotImplementedError(f"{dtype.name} has no machine code here")
    kind = TYPES[dtype.name]
    return kind if lanes is None else ir.VectorType(kind, lanes)


def _constant(value: object, dtype: np.dtype, lanes: int | None) -> ir.Constant:
    """LLVM constant of a scalar, or of a vector with the same scalar in each lane.

    Raises:
      NotImplementedError: the value is an array, or its dtype is not in `TYPES`.
    """
    array = np.asarray(value)
    if array.size > 1:
        raise NotImplementedError("a table has no machine code here")
    number = _type(dtype, None)(array.item())
    return number if lanes is None else ir.Constant(_type(dtype, lanes), [number] * lanes)


INNER = ("jaxpr", "call_jaxpr")
SAME = ("broadcast_in_dim", "reshape", "squeeze", "copy", "copy_p", "stop_gradient")
ARITHMETIC = {"add": "fadd", "add_any": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
WHOLE = {"add": "add", "add_any": "add", "sub": "sub", "mul": "mul"}
ORDER = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
LOGIC = {"and": "and_", "or": "or_", "xor": "xor"}
INTRINSIC = {
    "sqrt": "llvm.sqrt",
    "abs": "llvm.fabs",
    "max": "llvm.maximum",
    "min": "llvm.minimum",
    "floor": "llvm.floor",
    "ceil": "llvm.ceil",
}
COMPOSED = ("rsqrt", "logistic", "sign", "clamp")
FUNCTIONS = {
    **{name: name for name in ("exp", "exp2", "expm1", "log", "log1p", "pow", "erf", "erfc")},
    **{name: name for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "cbrt")},
    **{name: name for name in ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "lgamma")},
    "rem": "fmod",
}
"""Functions of the C library, keyed by the JAX operation that they compute."""


def _operation(
    build: ir.IRBuilder, equation, operands: list[ir.Value], lanes: int | None
) -> ir.Value:
    """Emits one JAX operation on scalars.

    Raises:
      NotImplementedError: the operation is not among those that contact laws use.
    """
    name, result = equation.primitive.name, equation.outvars[0].aval.dtype
    dtype = equation.invars[0].aval.dtype
    real = dtype.kind == "f"
    if len(equation.outvars) > 1 or any(atom.aval.shape for atom in equation.outvars):
        raise NotImplementedError(f"{name} gives more than one number, which has no machine code")
    if name in SAME or (name == "reduce_sum" and not equation.params["axes"]):
        return operands[0]
    if name in ARITHMETIC and real:
        return getattr(build, ARITHMETIC[name])(*operands, flags=FREE)
    if name in WHOLE and not real:
        return getattr(build, WHOLE[name])(*operands)
    if name in ORDER:
        if real:
            compare = build.fcmp_unordered if name == "ne" else build.fcmp_ordered
            return compare(ORDER[name], *operands)
        return build.icmp_signed(ORDER[name], *operands)
    if name in LOGIC:
        return getattr(build, LOGIC[name])(*operands)
    if name == "not":
        return build.not_(*operands)
    if name == "is_finite":
        magnitude = build.call(_intrinsic(build.module, "llvm.fabs", dtype, lanes, 1), operands)
        return build.fcmp_ordered("<", magnitude, _constant(np.inf, dtype, lanes))
    if name == "neg" and real:
        return build.fneg(*operands)
    if name in INTRINSIC and real:
        return build.call(
            _intrinsic(build.module, INTRINSIC[name], dtype, lanes, len(operands)), operands
        )
    if name == "select_n" and len(operands) == 3:
        return build.select(operands[0], operands[2], operands[1])
    if name == "square" and real:
        return build.fmul(operands[0], operands[0], flags=FREE)
    if name == "integer_pow" and real:
        return _power(build, operands[0], equation.params["y"], _constant(1.0, dtype, lanes))
    if name in COMPOSED and real:
        return _composed(build, name, operands, dtype, lanes)
    if name in FUNCTIONS and real and all(atom.aval.dtype == dtype for atom in equation.invars):
        return _function_of_library(build, FUNCTIONS[name], operands, dtype, lanes)
    if name == "convert_element_type":
        return _converted(build, operands[0], dtype, result, _type(result, lanes))
    raise NotImplementedError(f"{name} of {dtype} has no machine code here")


def _intrinsic(
    module: ir.Module, base: str, dtype: np.dtype, lanes: int | None, arguments: int
) -> ir.Function:
    name = f"{base}.{'' if lanes is None else f'v{lanes}'}f{8 * dtype.itemsize}"
    if name in module.globals:
        return module.globals[name]
    kind = _type(dtype, lanes)
    return ir.Function(module, ir.FunctionType(kind, [kind] * arguments), name)


def _composed(
    build: ir.IRBuilder, name: str, operands: list[ir.Value], dtype: np.dtype, lanes: int | None
) -> ir.Value:
    """Emits an operation composed of others: 1/sqrt(x), 1/(1 + e^-x), the sign, or a clamp."""
    zero, unit = _constant(0.0, dtype, lanes), _constant(1.0, dtype, lanes)
    if name == "rsqrt":
        root = build.call(_intrinsic(build.module, "llvm.sqrt", dtype, lanes, 1), operands)
        return build.fdiv(unit, root)
    if name == "logistic":
        negative = [build.fneg(operands[0])]
        return build.fdiv(
            unit, build.fadd(unit, _function_of_library(build, "exp", negative, dtype, lanes))
        )
    if name == "sign":  # the sign of zero is that zero, the sign of NaN is NaN
        negative = build.select(
            build.fcmp_ordered("<", operands[0], zero), build.fneg(unit), operands[0]
        )
        return build.select(build.fcmp_ordered(">", operands[0], zero), unit, negative)
    least, value, most = operands
    above = build.call(_intrinsic(build.module, "llvm.maximum", dtype, lanes, 2), [least, value])
    return build.call(_intrinsic(build.module, "llvm.minimum", dtype, lanes, 2), [above, most])


def _function_of_library(
    build: ir.IRBuilder, name: str, operands: list[ir.Value], dtype: np.dtype, lanes: int | None
) -> ir.Value:
    """Emits calls of a C library function in double precision, lane by lane."""
    double = TYPES["float64"]
    if name not in build.module.globals:
        ir.Function(build.module, ir.FunctionType(double, [double] * len(operands)), name)
    function, single = build.module.globals[name], dtype.itemsize < 8

    def value(arguments: list[ir.Value]) -> ir.Value:
        wide = [build.fpext(number, double) if single else number for number in arguments]
        result = build.call(function, wide)
        return build.fptrunc(result, TYPES[dtype.name]) if single else result

    if lanes is None:
        return value(operands)
    whole = ir.VectorType(TYPES[dtype.name], lanes)(ir.Undefined)
    for lane in map(INT, range(lanes)):
        result = value([build.extract_element(argument, lane) for argument in operands])
        whole = build.insert_element(whole, result, lane)
    return whole


def _power(build: ir.IRBuilder, base: ir.Value, exponent: int, unit: ir.Value) -> ir.Value:
    result = unit
    for _ in range(abs(exponent)):
        result = build.fmul(result, base, flags=FREE)
    return result if exponent >= 0 else build.fdiv(unit, result, flags=FREE)


def _converted(
    build: ir.IRBuilder, value: ir.Value, old: np.dtype, new: np.dtype, kind: ir.Type
) -> ir.Value:
    if old == new:
        return value
    wider = new.itemsize > old.itemsize
    match old.kind, new.kind:
        case "f", "f":
            return (build.fpext if wider else build.fptrunc)(value, kind)
        case "b", "f":
            return build.uitofp(value, kind)
        case "i", "f":
            return build.sitofp(value, kind)
        case "b", "i":
            return build.zext(value, kind)
        case "i", "i":
            return (build.sext if wider else build.trunc)(value, kind)
        case "f", "i":
            return build.fptosi(value, kind)
    raise NotImplementedError(f"{old} to {new} has no machine code here")
