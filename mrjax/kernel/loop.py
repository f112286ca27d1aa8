"""A loop over pairs as a value: a scalar law, and where its arguments come from and results go.

A derivative of such a loop, forwards or backwards, is such a loop again: what is read from a
particle forwards is added to it backwards, and what is read by all pairs is summed over them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from math import prod
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal, jaxpr_as_fun
from jax.interpreters import partial_eval


class Kind(Enum):
    """To whom an array belongs, and so what a pair reads of it and adds to it."""

    PARTICLE = "particle"  # (..., N): that of the first and, unless it is a wall, of the second
    PAIR = "pair"  # (..., P): its own
    SHARED = "shared"  # (...): the same for every pair; of results the sum over the pairs


@dataclass(frozen=True)
class Operand:
    """An array that a loop reads or writes."""

    kind: Kind
    rows: tuple[int, ...]  # (C,) of an array (C, N), (C, P) or (C,); () of (N,), (P,) or ()
    dtype: str

    @property
    def width(self) -> int:
        """Numbers for one particle or pair."""
        return prod(self.rows)

    def shape(self, particles: int, pairs: int) -> tuple[int, ...]:
        """Shape of the array, for N particles and room for P pairs."""
        own = {Kind.PARTICLE: (particles,), Kind.PAIR: (pairs,), Kind.SHARED: ()}[self.kind]
        return self.rows + own


class Alias(NamedTuple):
    """An output for pairs that stands where an input did: places without a pair are left alone."""

    given: int  # of the inputs
    taken: int  # of the outputs
    lasting: bool  # whether pairs apart keep what they had; else they have zeros


Slot = tuple[int, int, bool]
"""Of a scalar: index of the leaf, row, and whether it belongs to the second of the pair."""


def slots(leaves: tuple[Operand, ...]) -> list[Slot]:
    """Slots of the scalars of one pair, in order: every operand's rows, first and then second."""
    return [
        (index, row, of_second)
        for index, leaf in enumerate(leaves)
        for of_second in ((False, True) if leaf.kind is Kind.PARTICLE else (False,))
        for row in range(leaf.width)
    ]


@dataclass(frozen=True, eq=False, repr=False)
class PairLoop:
    """A scalar law for every pair that passes the guard; others add nothing, and have zeros.

    All outputs are of one dtype. What takes an input's place keeps it where no pair is listed.
    """

    law: ClosedJaxpr  # the scalars of `inputs` to those of `outputs`
    guard: ClosedJaxpr  # as many of the first scalars of `inputs` as it has, to a truth
    inputs: tuple[Operand, ...]
    outputs: tuple[Operand, ...]
    linear: int = 0  # of so many inputs, the last, the outputs are a linear function
    in_place: tuple[Alias, ...] = ()

    @staticmethod
    def traced(
        law: Callable,
        guard: Callable,
        inputs: tuple[Operand, ...],
        results: list[tuple[Kind, tuple[int, ...]]],
        memory: tuple[tuple[int, bool], ...] = (),
    ) -> "PairLoop":
        """Traces functions of scalars to lists of them.

        Args:
          law, guard: the functions.
          inputs: where their arguments come from.
          results: kind and rows of the outputs, known when `law` has been traced.
          memory: inputs whose place the outputs for pairs take, in order, and whether pairs that
            the guard leaves out keep what they had.
        """
        scalars = [jax.ShapeDtypeStruct((), inputs[n].dtype) for n, _, _ in slots(inputs)]
        traced = jax.make_jaxpr(law)(*scalars)
        dtype = traced.out_avals[0].dtype.name
        outputs = tuple(Operand(kind, rows, dtype) for kind, rows in results)
        guarded = jax.make_jaxpr(guard)(*scalars)
        sums = sum(kind is Kind.PARTICLE for kind, _ in results)
        in_place = tuple(
            Alias(given, sums + number, lasting) for number, (given, lasting) in enumerate(memory)
        )
        return PairLoop(traced, guarded, inputs, outputs, in_place=in_place)

    @property
    def changes(self) -> tuple[Operand, ...]:
        """The inputs that the outputs are linear in."""
        return self.inputs[len(self.inputs) - self.linear :]

    def lanes(self, size: int) -> int:
        """Pairs that fit into a vector of so many bytes."""
        return size // max(np.dtype(leaf.dtype).itemsize for leaf in self.outputs)

    def particles(self, shapes: list[tuple[int, ...]]) -> int:
        """N, from the shapes of the inputs."""
        return next(
            shape[-1]
            for shape, leaf in zip(shapes, self.inputs, strict=True)
            if leaf.kind is Kind.PARTICLE
        )

    @cached_property
    def _content(self) -> tuple:
        programs = (self.law, self.guard)
        return (
            *(str(of.jaxpr) for of in programs),
            *(_constants(of) for of in programs),
            self.inputs,
            self.outputs,
            self.linear,
            self.in_place,
        )

    def __eq__(self, other: object) -> bool:
        """True if both do the same, so that the program of one serves the other."""
        return isinstance(other, PairLoop) and self._content == other._content

    def __hash__(self) -> int:
        """Hash of what it does."""
        return hash(self._content)

    @cached_property
    def scalars(self) -> list[jax.ShapeDtypeStruct]:
        """Types of the law's arguments."""
        return [jax.ShapeDtypeStruct((), self.inputs[n].dtype) for n, _, _ in slots(self.inputs)]

    def tangent(self, live: tuple[int, ...]) -> tuple["PairLoop", tuple[int, ...]]:
        """Forwards: the inputs, and changes of those `live`, to the changes of the outputs.

        Returns:
          The loop, linear in the changes, and the indices of the outputs that change at all.
        """
        law = jaxpr_as_fun(self.law)
        varied = [i for i, (n, _, _) in enumerate(slots(self.inputs)) if n in live]
        count = len(self.scalars)

        def changes(*scalars):
            at, by = list(scalars[:count]), scalars[count:]

            def of_varied(*values):
                full = list(at)
                for index, value in zip(varied, values, strict=True):
                    full[index] = value
                return law(*full)

            return jax.jvp(of_varied, [at[i] for i in varied], list(by))[1]

        traced = _traced(changes, self.scalars + [self.scalars[i] for i in varied])
        moved = _dependent(traced, count)
        outputs = slots(self.outputs)
        some = sorted(
            {n for (n, _, _), of in zip(outputs, moved, strict=True) if of}
            | {of.taken for of in self.in_place if of.given in live}
        )
        kept = [i for i, (n, _, _) in enumerate(outputs) if n in some]

        def those_that_change(*scalars):
            values = jaxpr_as_fun(traced)(*scalars)
            return [values[i] for i in kept]

        loop = PairLoop(
            _traced(those_that_change, traced.in_avals),
            self.guard,
            self.inputs + tuple(self.inputs[n] for n in live),
            tuple(self.outputs[n] for n in some),
            len(live),
            tuple(
                Alias(len(self.inputs) + live.index(given), some.index(taken), lasting)
                for given, taken, lasting in self.in_place
                if given in live
            ),
        )
        return loop, tuple(some)

    def with_change(self, change: "PairLoop") -> "PairLoop":
        """This and its `tangent`, repeated or not, as one loop, for the operands of the tangent.

        Both read and work out much that is the same, which is then done once.
        """
        own, other, count = jaxpr_as_fun(self.law), jaxpr_as_fun(change.law), len(self.scalars)

        def both(*scalars):
            return [*own(*scalars[:count]), *other(*scalars)]

        return PairLoop(
            _traced(both, change.scalars),
            self.guard,
            change.inputs,
            self.outputs + change.outputs,
            in_place=self.in_place
            + tuple(of._replace(taken=len(self.outputs) + of.taken) for of in change.in_place),
        )

    def transposed(self, live: tuple[int, ...]) -> "PairLoop":
        """Backwards: cotangents of the outputs `live` to those of the linear inputs."""
        law = jaxpr_as_fun(self.law)
        fixed, linear = self.inputs[: -self.linear], self.changes
        count = len(slots(fixed))
        seen = [i for i, (n, _, _) in enumerate(slots(self.outputs)) if n in live]
        given = tuple(self.outputs[n] for n in live)

        def backwards(*scalars):
            def forwards(*changes):
                values = law(*scalars[:count], *changes)
                return [values[i] for i in seen]

            return jax.linear_transpose(forwards, *self.scalars[count:])(list(scalars[count:]))

        kinds = self.scalars[:count] + [
            jax.ShapeDtypeStruct((), given[n].dtype) for n, _, _ in slots(given)
        ]
        back = tuple(
            Alias(len(fixed) + live.index(taken), given - len(fixed), lasting)
            for given, taken, lasting in self.in_place
            if taken in live
        )
        traced = _traced(backwards, kinds)
        return PairLoop(traced, self.guard, fixed + given, linear, len(given), back)

    def repeated(self, times: int, several: tuple[bool, ...]) -> "PairLoop":
        """For so many sets of linear inputs at once: their rows, and the outputs', set after set.

        Args:
          times: T, of an input (C, N) to (T, C, N).
          several: for each linear input whether there are many, or one that serves all; there must
            be many of what is replaced.
        """
        law = jaxpr_as_fun(self.law)
        fixed, linear = self.inputs[: -self.linear], self.changes
        count = len(slots(fixed))

        def many(leaf: Operand) -> Operand:
            return Operand(leaf.kind, (times, *leaf.rows), leaf.dtype)

        wide = tuple(many(leaf) if of else leaf for leaf, of in zip(linear, several, strict=True))
        outputs = tuple(many(leaf) for leaf in self.outputs)
        where_in = {place: i for i, place in enumerate(slots(wide))}
        where_out = {place: i for i, place in enumerate(slots(self.outputs))}

        def each(*scalars):
            results = []
            for t in range(times):
                changes = [
                    scalars[count + where_in[n, row + several[n] * t * linear[n].width, second]]
                    for n, row, second in slots(linear)
                ]
                results.append(law(*scalars[:count], *changes))
            return [
                results[row // self.outputs[n].width][
                    where_out[n, row % self.outputs[n].width, second]
                ]
                for n, row, second in slots(outputs)
            ]

        kinds = self.scalars[:count] + [
            jax.ShapeDtypeStruct((), wide[n].dtype) for n, _, _ in slots(wide)
        ]
        traced = _traced(each, kinds)
        return PairLoop(traced, self.guard, fixed + wide, outputs, self.linear, self.in_place)

    def pruned(self) -> tuple["PairLoop", tuple[int, ...]]:
        """The same without the inputs that it does not read, and the indices of those that stay."""
        given = slots(self.inputs)
        stay = {given[scalar][0] for of in (self.law, self.guard) for scalar in _read(of)}
        stay |= {of.given for of in self.in_place}
        stay |= set(range(len(self.inputs) - self.linear, len(self.inputs)))
        left = sorted(stay)
        inputs = tuple(self.inputs[n] for n in left)

        def of_less(program: ClosedJaxpr) -> ClosedJaxpr:
            of_all = given[: len(program.jaxpr.invars)]
            kinds = [jax.ShapeDtypeStruct((), self.inputs[n].dtype) for n, _, _ in of_all]

            def evaluated(*scalars):
                some = iter(scalars)
                full = [
                    next(some) if n in stay else jnp.zeros((), kind.dtype)
                    for (n, _, _), kind in zip(of_all, kinds, strict=True)
                ]
                return jaxpr_as_fun(program)(*full)

            kept = zip(of_all, kinds, strict=True)
            return _traced(evaluated, [kind for (n, _, _), kind in kept if n in stay])

        in_place = tuple(of._replace(given=left.index(of.given)) for of in self.in_place)
        loop = PairLoop(
            of_less(self.law),
            of_less(self.guard),
            inputs,
            self.outputs,
            self.linear,
            in_place,
        )
        return loop, tuple(left)


def _constants(program: ClosedJaxpr) -> tuple[bytes, ...]:
    """All digits of the constants of a program and of those inside it."""
    inner = [
        value
        for equation in program.jaxpr.eqns
        for value in equation.params.values()
        if isinstance(value, ClosedJaxpr)
    ]
    own = tuple(np.asarray(constant).tobytes() for constant in program.consts)
    return sum(map(_constants, inner), own)


def _traced(function, scalars: list[jax.ShapeDtypeStruct]) -> ClosedJaxpr:
    return jax.make_jaxpr(function)(*scalars)


def _read(closed: ClosedJaxpr) -> list[int]:
    """The arguments on which a result depends, by number."""
    every = [True] * len(closed.jaxpr.outvars)
    _, read = partial_eval.dce_jaxpr(closed.jaxpr, every)
    return [number for number, of in enumerate(read) if of]


def _dependent(closed: ClosedJaxpr, count: int) -> list[bool]:
    """Which results depend on arguments after the first `count`, or might, through a call."""
    moved = set(closed.jaxpr.invars[count:])
    for equation in closed.jaxpr.eqns:
        if any(not isinstance(v, Literal) and v in moved for v in equation.invars):
            moved.update(equation.outvars)
    return [not isinstance(v, Literal) and v in moved for v in closed.jaxpr.outvars]
