"""The JAX primitive of a loop over pairs, with its rules for differentiation, `vmap` and lowering.

On a CPU the primitive runs a compiled loop (`llvm.codegen`), on other devices it runs gathers and
scatters (`arrays`).
"""

import warnings
from functools import cache, partial

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.core import ShapedArray
from jax.extend.core import Literal, Primitive
from jax.interpreters import ad, batching, mlir, partial_eval

from .arrays import evaluate_with_arrays
from .llvm import codegen
from .llvm.chunks import room_for_sums
from .loop import PairLoop

AT_ONCE = 4
"""Largest number of tangent directions that one loop evaluates in a single pass."""

pair_sum_p = Primitive("pair_sum")
pair_sum_p.multiple_results = True


@partial(jax.jit, static_argnames="loop")
def _alone(*operands: Array, loop: PairLoop) -> list[Array]:
    return pair_sum_p.bind(*operands, loop=loop)


pair_sum_p.def_impl(_alone)


@pair_sum_p.def_abstract_eval
def _shapes(first, second, count, *leaves, loop: PairLoop):
    particles = loop.particles([leaf.shape for leaf in leaves])
    return [ShapedArray(leaf.shape(particles, first.shape[0]), leaf.dtype) for leaf in loop.outputs]


def _jvp(primals, tangents, *, loop: PairLoop):
    live = tuple(i for i, t in enumerate(tangents[3:]) if not isinstance(t, ad.Zero))
    zeros = [ad.Zero(aval) for aval in _shapes(*primals, loop=loop)]
    tangent, changed = loop.tangent(live) if live else (None, ())
    if not changed:
        return pair_sum_p.bind(*primals, loop=loop), zeros
    operands = *primals, *(tangents[3 + i] for i in live)
    both = with_change_p.bind(*operands, loop=loop, change=tangent)
    values, changes = both[: len(zeros)], both[len(zeros) :]
    for index, change in zip(changed, changes, strict=True):
        zeros[index] = change
    return values, zeros


def _transpose(cotangents, *operands, loop: PairLoop):
    if not loop.linear:
        raise NotImplementedError("this law of pairs is not known to be linear")
    fixed, linear = operands[: -loop.linear], operands[-loop.linear :]
    live = tuple(i for i, t in enumerate(cotangents) if not isinstance(t, ad.Zero))
    nothing = [None] * len(fixed)
    if not live:
        return nothing + [ad.Zero(operand.aval) for operand in linear]
    back = pair_sum_p.bind(*fixed, *(cotangents[i] for i in live), loop=loop.transposed(live))
    return nothing + back


def _batched(operands, axes, *, loop: PairLoop):
    operands, batched = _in_front(operands, axes)
    together = _together(operands, batched, loop)
    if together is not None:
        operands, loop = together
        results = pair_sum_p.bind(*operands, loop=loop)
    else:
        results = lax.map(
            lambda members: pair_sum_p.bind(*_filled(operands, batched, members), loop=loop),
            [operand for operand, has_axis in zip(operands, batched, strict=True) if has_axis],
        )
    return results, [0] * len(results)


def _in_front(operands, axes) -> tuple[list, list[bool]]:
    """Moves the batch axis of each batched operand to the front.

    Returns:
      the operands, and for each operand True if it is batched.
    """
    batched = [axis is not batching.not_mapped for axis in axes]
    moved = [
        jnp.moveaxis(operand, axis, 0) if has_axis else operand
        for operand, axis, has_axis in zip(operands, axes, batched, strict=True)
    ]
    return moved, batched


def _together(operands: list, batched: list[bool], loop: PairLoop) -> tuple[list, PairLoop] | None:
    """Builds one loop for all members of a batch, and its operands.

    Returns:
      the operands and the loop; None if the members differ in more than the linear inputs, or if
      there are more than `AT_ONCE` of them.
    """
    fixed = len(operands) - loop.linear
    size = len(operands[batched.index(True)])
    if any(batched[:fixed]) or size > AT_ONCE:
        return None
    operands, batched = list(operands), list(batched)
    for index in (3 + alias.input for alias in loop.in_place):
        if not batched[index]:
            operands[index] = jnp.broadcast_to(operands[index], (size, *operands[index].shape))
            batched[index] = True
    return operands, loop.repeated(size, tuple(batched[fixed:]))


def _filled(operands: list, batched: list[bool], members: list) -> list:
    """Operands of one member of a batch: its own batched arrays and the shared arrays."""
    own = iter(members)
    return [
        next(own) if has_axis else operand
        for operand, has_axis in zip(operands, batched, strict=True)
    ]


with_change_p = Primitive("pair_sum_with_change")
"""Primitive that evaluates a loop and its tangent together, for forward mode.

This is cheaper than one after the other. Under partial evaluation, the step of reverse mode that
separates known values from those linear in the tangents, it splits into its two loops.
"""
with_change_p.multiple_results = True


@partial(jax.jit, static_argnames=("loop", "change"))
def _both_alone(*operands: Array, loop: PairLoop, change: PairLoop) -> list[Array]:
    return with_change_p.bind(*operands, loop=loop, change=change)


with_change_p.def_impl(_both_alone)


@with_change_p.def_abstract_eval
def _both_shapes(*operands, loop: PairLoop, change: PairLoop):
    return _shapes(*operands, loop=loop) + _shapes(*operands, loop=change)


def _both_in_arrays(*operands, loop: PairLoop, change: PairLoop) -> list[Array]:
    alone = evaluate_with_arrays(loop, *operands[: -change.linear])
    return alone + evaluate_with_arrays(change, *operands)


def _both_jvp(primals, tangents, *, loop: PairLoop, change: PairLoop):
    loop_jvp = _jvp(primals[: -change.linear], tangents[: -change.linear], loop=loop)
    change_jvp = _jvp(primals, tangents, loop=change)
    return tuple([*first, *second] for first, second in zip(loop_jvp, change_jvp, strict=True))


def _both_batched(operands, axes, *, loop: PairLoop, change: PairLoop):
    operands, batched = _in_front(operands, axes)
    alone, count = operands[: -change.linear], len(loop.outputs)
    together = _together(operands, batched, change)
    if together is not None:
        operands, change = together
        results = with_change_p.bind(*operands, loop=loop, change=change)
        return results, [batching.not_mapped] * count + [0] * (len(results) - count)
    axes = [0 if has_axis else batching.not_mapped for has_axis in batched]
    if any(batched[: -change.linear]):
        values, value_axes = _batched(alone, axes[: -change.linear], loop=loop)
    else:
        values, value_axes = pair_sum_p.bind(*alone, loop=loop), [batching.not_mapped] * count
    changes, change_axes = _batched(operands, axes, loop=change)
    return [*values, *changes], [*value_axes, *change_axes]


def _both_split(trace, *tracers, loop: PairLoop, change: PairLoop):
    """Partial evaluation: runs the loop if its operands are known; the tangent is transposed later.

    The tangent loop is pruned first, so that arrays it does not read are not stored as residuals.
    """
    values = trace.process_primitive(pair_sum_p, tracers[: -change.linear], {"loop": loop})
    change, inputs = change.pruned()
    tracers = (*tracers[:3], *(tracers[3 + n] for n in inputs))
    return [*values, *trace.process_primitive(pair_sum_p, tracers, {"loop": change})]


def _both_remembered(saveable, unknown, present, equation):
    """Partial evaluation under `jax.checkpoint`: the loop runs now, both run when recomputed."""
    loop, change = equation.params["loop"], equation.params["change"]
    count, known_part = len(loop.outputs), None
    is_unknown = [any(unknown)] * len(equation.outvars)
    if not any(unknown):
        known_part = equation
    elif not any(unknown[: -change.linear]):
        known_part = equation.replace(
            primitive=pair_sum_p,
            params={"loop": loop},
            invars=equation.invars[: -change.linear],
            outvars=equation.outvars[:count],
        )
        is_unknown[:count] = [False] * count
    residuals = [
        operand
        for operand, is_present in zip(equation.invars, present, strict=True)
        if not is_present and not isinstance(operand, Literal)
    ]
    return known_part, equation, is_unknown, [True] * len(is_unknown), residuals


_in_arrays = mlir.lower_fun(
    lambda *operands, loop: evaluate_with_arrays(loop, *operands), multiple_results=True
)


def _compiled(context, *operands, loop: PairLoop):
    shapes = [operand.shape for operand in context.avals_in]
    particles, (room,) = loop.particles(shapes[3:]), shapes[0]
    try:
        name = codegen.registered(loop, particles, room)
    except NotImplementedError as missing:
        _warn_once(str(missing))
        return _in_arrays(context, *operands, loop=loop)
    lower = jax.ffi.ffi_lowering(
        name,
        operand_output_aliases={3 + alias.input: alias.output for alias in loop.in_place},
    )
    chunks = codegen.chunk_count(room)
    if chunks == 1:
        return lower(context, *operands)
    chunk_sums = ShapedArray(
        (chunks, room_for_sums(loop.outputs, particles)), loop.outputs[0].dtype
    )
    *results, _ = lower(context.replace(avals_out=[*context.avals_out, chunk_sums]), *operands)
    return results


@cache
def _warn_once(missing: str) -> None:
    """Warns that a law is evaluated with arrays, once for each operation without machine code."""
    warnings.warn(
        f"{missing}: the law of pairs is evaluated with arrays, which takes longer", stacklevel=2
    )


ad.primitive_jvps[pair_sum_p] = _jvp
ad.primitive_transposes[pair_sum_p] = _transpose
batching.primitive_batchers[pair_sum_p] = _batched
mlir.register_lowering(pair_sum_p, _in_arrays)
mlir.register_lowering(pair_sum_p, _compiled, platform="cpu")

ad.primitive_jvps[with_change_p] = _both_jvp
batching.primitive_batchers[with_change_p] = _both_batched
partial_eval.custom_partial_eval_rules[with_change_p] = _both_split
partial_eval.partial_eval_jaxpr_custom_rules[with_change_p] = _both_remembered
mlir.register_lowering(with_change_p, mlir.lower_fun(_both_in_arrays, multiple_results=True))
mlir.register_lowering(
    with_change_p,
    lambda context, *operands, loop, change: _compiled(
        context, *operands, loop=loop.with_change(change)
    ),
    platform="cpu",
)
