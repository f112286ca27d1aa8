"""`pair_sum` sums a law of two particles over a list of pairs; its arguments are JAX pytrees.

    sums_i = sum_j law(particle_i, particle_j, pair_ij, shared, memory_ij)

The law is written for the scalars of one pair. This module flattens its pytrees into the operands
of one JAX primitive (`primitive`).
"""

from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from .loop import Kind, Operand, PairLoop
from .primitive import pair_sum_p

Tree = Any


def pair_sum(
    law: Callable[..., tuple[Tree, Tree, Tree]],
    guard: Callable[..., ArrayLike],
    first: ArrayLike,
    second: ArrayLike,
    count: ArrayLike,
    *,
    particles: Tree,
    pairs: Tree = None,
    shared: Tree = None,
    memory: Tree = None,
    lasting: Tree = False,
) -> tuple[Tree, Tree]:
    """Sums a law over pairs of particles. Works under `jit`, `grad`, `jvp` and `vmap`.

    The sum is differentiable in all pytrees of arrays. The law sees the values of one pair: an
    array (N,), (P,) or () becomes a scalar, and an array (C, N), (C, P) or (C,) becomes a tuple of
    C scalars. In the results of the law, a plain tuple is such a vector. Use lists, dictionaries,
    named tuples or dataclasses for the pytrees around it.

    Args:
      law: function of (particle, partner, pair, shared, memory) for one pair. It returns the values
        to add to the particle, the values to add to the partner (a pytree of the same structure),
        and the new memory.
      guard: function of the same arguments; the law is evaluated only where it returns True. Other
        pairs add nothing.
      first: ids of the particles, (P,).
      second: ids of their partners, (P,). An id of N or more is not a particle (a wall, for
        example): the law reads zeros for it, and nothing is added to it.
      count: number of pairs, (); entries past it are not read.
      particles: arrays (N,) or (C, N), at least one; the results have the dtype of the first.
      pairs: arrays (P,) or (C, P).
      shared: arrays () or (C,).
      memory: arrays (P,) or (C, P). The new memory is written into the same buffers. Entries past
        the last pair stay unchanged.
      lasting: True if the memory of pairs that fail the guard stays unchanged, False if it becomes
        zero; one bool, or a pytree of bools that is a prefix of `memory`.

    Returns:
      the sums for every particle, (N,) or (C, N), as a pytree with the structure that the law
      returns, and the new memory.

    Raises:
      ValueError: the pytrees that the law returns do not match each other or `memory`.

    Warns:
      UserWarning: the law has an operation that cannot be compiled, so it is evaluated with arrays
        (on a CPU; once for each operation).

    Example:
      >>> def spring(particle, partner, stiffness, shared, memory):
      ...     force = stiffness * (partner - particle)
      ...     return force, -force, memory
      >>> position, stiffness = jnp.array([0.0, 1.0, 3.0]), jnp.array([10.0, 1.0])
      >>> first, second = jnp.array([0, 1]), jnp.array([1, 2])
      >>> def forces(position):
      ...     ends = first, second, 2
      ...     trees = dict(particles=position, pairs=stiffness)
      ...     return mrjax.kernel.pair_sum(spring, lambda *_: True, *ends, **trees)[0]
      >>> forces(position)
      Array([10., -8., -2.], dtype=float64)
    """
    trees = _Trees(particles, pairs, memory, shared)
    results = _Results(trees)

    def flat_law(*scalars: Array) -> list[Array]:
        return results.flatten(*law(*trees.of_pair(scalars)))

    loop = PairLoop.traced(
        flat_law,
        lambda *scalars: [guard(*trees.of_pair(scalars))],
        trees.operands,
        results.outputs,
        trees.remembered(lasting),
    )
    ends = (jnp.asarray(ids).astype(jnp.int32) for ids in (first, second))
    arrays = pair_sum_p.bind(*ends, jnp.asarray(count, jnp.int32), *trees.arrays, loop=loop)
    return results.unflatten(arrays)


class _Trees:
    """Flattens the pytrees of a call to a list of arrays, and rebuilds the pytrees of one pair."""

    def __init__(self, particles: Tree, pairs: Tree, memory: Tree, shared: Tree) -> None:
        self.arrays: list[Array] = []
        operands: list[Operand] = []
        self.structures: list[Any] = []
        self.memory = memory
        kinds = (Kind.PARTICLE, Kind.PAIR, Kind.PAIR, Kind.SHARED)
        for kind, tree in zip(kinds, (particles, pairs, memory, shared), strict=True):
            leaves, structure = jax.tree.flatten(tree)
            self.structures.append(structure)
            for leaf in leaves:
                array = jnp.asarray(leaf)
                rows = array.shape[: array.ndim - (kind is not Kind.SHARED)]
                operands.append(Operand(kind, rows, array.dtype.name))
                self.arrays.append(array)
        if not self.structures[0].num_leaves:
            raise ValueError("particles: give one array (N,) or (C, N) at least")
        self.operands = tuple(operands)

    @property
    def dtype(self) -> DTypeLike:
        """Dtype of the results."""
        return self.arrays[0].dtype

    @property
    def first_memory(self) -> int:
        """Index of the first memory operand."""
        return self.structures[0].num_leaves + self.structures[1].num_leaves

    def remembered(self, lasting: Tree) -> tuple[tuple[int, bool], ...]:
        """Index of each memory operand, and True if it stays unchanged where the guard fails."""
        lasts = jax.tree.leaves(jax.tree.broadcast(lasting, self.memory))
        return tuple((self.first_memory + n, last) for n, last in enumerate(lasts))

    def of_pair(self, scalars: tuple[Array, ...]) -> tuple[Tree, Tree, Tree, Tree, Tree]:
        """Rebuilds particle, partner, pair, shared and memory of one pair from its scalars."""
        remaining = iter(scalars)
        particle, partner, others = [], [], []
        for operand in self.operands:
            if operand.kind is Kind.PARTICLE:
                particle.append(_next_value(operand, remaining))
                partner.append(_next_value(operand, remaining))
            else:
                others.append(_next_value(operand, remaining))
        particles, pairs, memory, shared = self.structures
        begin, end = pairs.num_leaves, pairs.num_leaves + memory.num_leaves
        return (
            particles.unflatten(particle),
            particles.unflatten(partner),
            pairs.unflatten(others[:begin]),
            shared.unflatten(others[end:]),
            memory.unflatten(others[begin:end]),
        )


class _Results:
    """Flattens the pytrees that a law returns to scalars, and rebuilds them from result arrays."""

    def __init__(self, trees: _Trees) -> None:
        self.trees = trees
        self.outputs: list[tuple[Kind, tuple[int, ...]]] = []
        """Kind and rows of each result; filled when the law is traced."""

    def flatten(self, to_particle: Tree, to_partner: Tree, memory: Tree) -> list[Array]:
        """Lists the scalars of all sums, then those of the memory.

        Each sum contributes its scalars for the particle, then those for the partner.
        """
        self.sums: Any
        self.memory: Any
        mine, self.sums = jax.tree.flatten(to_particle, is_leaf=_is_vector)
        theirs, same = jax.tree.flatten(to_partner, is_leaf=_is_vector)
        new, self.memory = jax.tree.flatten(memory, is_leaf=_is_vector)
        if self.sums != same or list(map(_rows, mine)) != list(map(_rows, theirs)):
            raise ValueError(f"the law adds {self.sums} to a particle, {same} to its partner")
        begin = self.trees.first_memory
        old = self.trees.operands[begin : begin + self.trees.structures[2].num_leaves]
        if [operand.rows for operand in old] != list(map(_rows, new)):
            raise ValueError(f"the law's new memory {self.memory} is not as the old one")
        self.outputs.clear()
        values: list[Array] = []
        for own, partner in zip(mine, theirs, strict=True):
            self.outputs.append((Kind.PARTICLE, _rows(own)))
            values += [*self._scalars(own), *self._scalars(partner)]
        for value in new:
            self.outputs.append((Kind.PAIR, _rows(value)))
            values += self._scalars(value)
        return values

    def unflatten(self, arrays: list[Array]) -> tuple[Tree, Tree]:
        """Rebuilds the pytrees of the sums and of the memory."""
        sums = self.sums.num_leaves
        return self.sums.unflatten(arrays[:sums]), self.memory.unflatten(arrays[sums:])

    def _scalars(self, value: Tree) -> list[Array]:
        parts = value if _is_vector(value) else (value,)
        return [jnp.asarray(part, self.trees.dtype) for part in parts]


def _next_value(operand: Operand, scalars: Iterator[Array]) -> Array | tuple[Array, ...]:
    """Takes the next scalar, or a tuple of C scalars if the operand has C rows."""
    if not operand.rows:
        return next(scalars)
    return tuple(next(scalars) for _ in range(operand.width))


def _is_vector(value: Tree) -> bool:
    return type(value) is tuple


def _rows(value: Tree) -> tuple[int, ...]:
    return (len(value),) if _is_vector(value) else ()
