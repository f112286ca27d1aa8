"""Evaluation of a loop over pairs by gathers and scatters of whole arrays, for GPUs and tests."""

import jax
import jax.numpy as jnp
from jax.extend.core import jaxpr_as_fun

from .loop import Kind, PairLoop, Slot, slots


def evaluate_with_arrays(loop: PairLoop, first, second, count, *leaves):
    """Evaluates a loop over pairs with array operations, in place of compiled machine code.

    Args:
      loop: the loop.
      first: ids of the particles, (P,).
      second: ids of their partners, (P,); ids from N on are walls.
      count: number of listed pairs, ().
      leaves: the arrays of `loop.inputs`, in their order.

    Returns:
      the arrays of `loop.outputs`, in their order.
    """
    particles = loop.particles([leaf.shape for leaf in leaves])
    wall, is_pair = second >= particles, jnp.arange(len(first), dtype=count.dtype) < count

    def gathered(place: Slot):
        n, row, of_second = place
        leaf = loop.inputs[n]
        array = leaves[n].reshape(leaf.width, *leaves[n].shape[len(leaf.rows) :])[row]
        if leaf.kind is Kind.SHARED:
            return jnp.broadcast_to(array, first.shape)
        if leaf.kind is Kind.PAIR:
            return array
        return jnp.where(wall, 0, array[second]) if of_second else array[first]

    scalars = [gathered(place) for place in slots(loop.inputs)]
    guards = scalars[: len(loop.guard.jaxpr.invars)]
    size = len(first)  # vmap cannot infer it from a guard without arguments
    (touching,) = jax.vmap(jaxpr_as_fun(loop.guard), axis_size=size)(*guards)
    values = jax.vmap(jaxpr_as_fun(loop.law), axis_size=size)(*scalars)
    shapes = [leaf.shape(particles, len(first)) for leaf in loop.outputs]
    results = [
        jnp.zeros((leaf.width, *shape[len(leaf.rows) :]), leaf.dtype)
        for shape, leaf in zip(shapes, loop.outputs, strict=True)
    ]
    for source, target, lasting in loop.in_place:
        before = leaves[source].reshape(results[target].shape)
        results[target] = before if lasting else jnp.where(is_pair, 0, before)
    for (n, row, of_second), value in zip(slots(loop.outputs), values, strict=True):
        elsewhere = results[n][row] if loop.outputs[n].kind is Kind.PAIR else 0
        value = jnp.where(touching & is_pair, value, elsewhere)
        kind = loop.outputs[n].kind
        if kind is Kind.SHARED:
            results[n] = results[n].at[row].set(jnp.sum(value))
        elif kind is Kind.PAIR:
            results[n] = results[n].at[row].set(value)
        else:
            ids = jnp.where(wall, particles, second) if of_second else first
            results[n] = results[n].at[row, ids].add(value, mode="drop")
    return [result.reshape(shape) for result, shape in zip(results, shapes, strict=True)]
