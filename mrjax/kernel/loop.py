"""`PairLoop`, the description of a loop over pairs: a scalar law, its inputs and its outputs.

The derivative of a loop, in forward or reverse mode, is again a loop. A value that is read from a
particle in forward mode becomes a value that is added to the particle in reverse mode. A value that
all pairs share becomes a sum over the pairs.
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
    """Kind of an array: it determines which entries a pair reads, and which entries it adds to."""

    PARTICLE = "particle"  # (..., N): entries of the first and, unless a wall, the second particle
    PAIR = "pair"  # (..., P): entry of the pair itself
    SHARED = "shared"  # (...): same value for every pair; as an output, the sum over all pairs


@dataclass(frozen=True)
class Operand:
    """An array that a loop reads or writes."""

    kind: Kind
    rows: tuple[int, ...]  # (C,) of an array (C, N), (C, P) or (C,); () of (N,), (P,) or ()
    dtype: str

    @property
    def width(self) -> int:
        """Number of values per particle or per pair."""
        return prod(self.rows)

    def shape(self, particles: int, pairs: int) -> tuple[int, ...]:
        """Shape of the array for N particles and a pair list of capacity P."""
        own = {Kind.PARTICLE: (particles,), Kind.PAIR: (pairs,), Kind.SHARED: ()}[self.kind]
        return self.rows + own


class Alias(NamedTuple):
    """A per-pair output that reuses an input's buffer; entries past the list stay unchanged."""

    input: int  # index of the input
    output: int  # index of the output
    lasting: bool  # True if pairs that fail the guard keep their old value; otherwise it becomes 0


Slot = tuple[int, int, bool]
"""Origin of a scalar: index of its operand, row, and True if it belongs to the second particle."""


def slots(leaves: tuple[Operand, ...]) -> list[Slot]:
    """Lists the slots of the scalars of one pair: operand by operand, first before second particle.

    Each operand contributes all its rows for the first particle, then all its rows for the second.
    """
    return [
        (index, row, of_second)
        for index, leaf in enumerate(leaves)
        for of_second in ((False, True) if leaf.kind is Kind.PARTICLE else (False,))
        for row in range(leaf.width)
    ]


@dataclass(frozen=True, eq=False, repr=False)
class PairLoop:
    """A scalar law that is evaluated for every listed pair that passes a guard.

    Pairs that fail the guard add nothing to the sums, and their per-pair outputs are zero unless
    an alias is lasting. All outputs have the same dtype. An output that reuses the buffer of an
    input leaves the entries past the end of the list unchanged.
    """

    law: ClosedJaxpr  # maps the scalars of `inputs` to the scalars of `outputs`
    guard: ClosedJaxpr  # maps the leading scalars of `inputs`, as many as it takes, to a bool
    inputs: tuple[Operand, ...]
    outputs: tuple[Operand, ...]
    linear: int = 0  # number of trailing inputs in which the outputs are linear
    in_place: tuple[Alias, ...] = ()

    @staticmethod
    def traced(
        law: Callable,
        guard: Callable,
        inputs: tuple[Operand, ...],
        results: list[tuple[Kind, tuple[int, ...]]],
        memory: tuple[tuple[int, bool], ...] = (),
    ) -> "PairLoop":
        """Builds a loop by tracing a law and a guard, functions from scalars to a list of scalars.

        Args:
          law, guard: the functions.
          inputs: operands that supply the arguments of both functions.
          results: kind and rows of the outputs; the list is filled while `law` is traced.
          memory: for each per-pair output, in order, the index of the input whose buffer it reuses,
            and True if pairs that fail the guard keep their old value.
        """
        scalars = [jax.ShapeDtypeStruct((), inputs[n].dtype) for n, _, _ in slots(inputs)]
        traced = jax.make_jaxpr(law)(*scalars)
        dtype = traced.out_avals[0].dtype.name
        outputs = tuple(Operand(kind, rows, dtype) for kind, rows in results)
        guarded = jax.make_jaxpr(guard)(*scalars)
        sums = sum(kind is Kind.PARTICLE for kind, _ in results)
        in_place = tuple(
            Alias(index, sums + number, lasting) for number, (index, lasting) in enumerate(memory)
        )
        return PairLoop(traced, guarded, inputs, outputs, in_place=in_place)

    @property
    def changes(self) -> tuple[Operand, ...]:
        """Inputs in which the outputs are linear."""
        return self.inputs[len(self.inputs) - self.linear :]

    def lanes(self, size: int) -> int:
        """Number of pairs that fit into a vector of `size` bytes."""
        return size // max(np.dtype(leaf.dtype).itemsize for leaf in self.outputs)

    def particles(self, shapes: list[tuple[int, ...]]) -> int:
        """Number of particles N, read from the shapes of the inputs."""
        return next(
            shape[-1]
            for shape, leaf in zip(shapes, self.inputs, strict=True)
            if leaf.kind is Kind.PARTICLE
        )

    @cached_property
    def _content(self) -> tuple:
        programs = (self.law, self.guard)
        return (
            *(str(program.jaxpr) for program in programs),
            *(_constants(program) for program in programs),
            self.inputs,
            self.outputs,
            self.linear,
            self.in_place,
        )

    def __eq__(self, other: object) -> bool:
        """True if both loops have the same content, so that compiled code can be shared."""
        return isinstance(other, PairLoop) and self._content == other._content

    def __hash__(self) -> int:
        """Hash of the content, consistent with equality."""
        return hash(self._content)

    @cached_property
    def scalars(self) -> list[jax.ShapeDtypeStruct]:
        """Shapes and dtypes of the law's arguments."""
        return [jax.ShapeDtypeStruct((), self.inputs[n].dtype) for n, _, _ in slots(self.inputs)]

    def tangent(self, live: tuple[int, ...]) -> tuple["PairLoop", tuple[int, ...]]:
        """Builds the loop of the forward-mode derivative (Jacobian-vector product).

        Args:
          live: indices of the inputs that have a tangent.

        Returns:
          A loop from the inputs and the tangents of the live inputs to the tangents of the outputs,
          linear in the tangents; and the indices of the outputs with a tangent that can be nonzero.
        """
        law = jaxpr_as_fun(self.law)
        varied = [i for i, (n, _, _) in enumerate(slots(self.inputs)) if n in live]
        count = len(self.scalars)

        def changes(*scalars):
            primals, tangents = list(scalars[:count]), scalars[count:]

            def law_of_varied(*values):
                full = list(primals)
                for index, value in zip(varied, values, strict=True):
                    full[index] = value
                return law(*full)

            return jax.jvp(law_of_varied, [primals[i] for i in varied], list(tangents))[1]

        traced = _traced(changes, self.scalars + [self.scalars[i] for i in varied])
        dependent = _dependent(traced, count)
        outputs = slots(self.outputs)
        changed = sorted(
            {n for (n, _, _), depends in zip(outputs, dependent, strict=True) if depends}
            | {alias.output for alias in self.in_place if alias.input in live}
        )
        places = [i for i, (n, _, _) in enumerate(outputs) if n in changed]

        def changed_scalars(*scalars):
            values = jaxpr_as_fun(traced)(*scalars)
            return [values[i] for i in places]

        loop = PairLoop(
            _traced(changed_scalars, traced.in_avals),
            self.guard,
            self.inputs + tuple(self.inputs[n] for n in live),
            tuple(self.outputs[n] for n in changed),
            len(live),
            tuple(
                Alias(len(self.inputs) + live.index(source), changed.index(target), lasting)
                for source, target, lasting in self.in_place
                if source in live
            ),
        )
        return loop, tuple(changed)

    def with_change(self, change: "PairLoop") -> "PairLoop":
        """Fuses this loop and its tangent loop, so that common reads and operations are done once.

        Args:
          change: the loop of `tangent`, possibly `repeated`; the fused loop takes its operands.
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
            + tuple(
                alias._replace(output=len(self.outputs) + alias.output) for alias in change.in_place
            ),
        )

    def transposed(self, live: tuple[int, ...]) -> "PairLoop":
        """Builds the transposed loop, which maps cotangents of outputs to those of linear inputs.

        Args:
          live: indices of the outputs that have a cotangent.
        """
        law = jaxpr_as_fun(self.law)
        fixed, linear = self.inputs[: -self.linear], self.changes
        count = len(slots(fixed))
        places = [i for i, (n, _, _) in enumerate(slots(self.outputs)) if n in live]
        cotangents = tuple(self.outputs[n] for n in live)

        def backwards(*scalars):
            def forwards(*changes):
                values = law(*scalars[:count], *changes)
                return [values[i] for i in places]

            return jax.linear_transpose(forwards, *self.scalars[count:])(list(scalars[count:]))

        kinds = self.scalars[:count] + [
            jax.ShapeDtypeStruct((), cotangents[n].dtype) for n, _, _ in slots(cotangents)
        ]
        in_place = tuple(
            Alias(len(fixed) + live.index(target), source - len(fixed), lasting)
            for source, target, lasting in self.in_place
            if target in live
        )
        traced = _traced(backwards, kinds)
        return PairLoop(traced, self.guard, fixed + cotangents, linear, len(cotangents), in_place)

    def repeated(self, times: int, batched: tuple[bool, ...]) -> "PairLoop":
        """Builds a loop that evaluates T sets of linear inputs in one pass over the pairs.

        Outputs, and those linear inputs that differ between the sets, gain a leading axis of
        length T.

        Args:
          times: number T of sets; an input (C, N) becomes (T, C, N).
          batched: for each linear input, True if each set has its own array, False if all sets
            share one. It must be True for inputs whose buffer an output reuses.
        """
        law = jaxpr_as_fun(self.law)
        fixed, linear = self.inputs[: -self.linear], self.changes
        count = len(slots(fixed))

        def many(leaf: Operand) -> Operand:
            return Operand(leaf.kind, (times, *leaf.rows), leaf.dtype)

        wide = tuple(
            many(leaf) if has_axis else leaf for leaf, has_axis in zip(linear, batched, strict=True)
        )
        outputs = tuple(many(leaf) for leaf in self.outputs)
        where_in = {place: i for i, place in enumerate(slots(wide))}
        where_out = {place: i for i, place in enumerate(slots(self.outputs))}

        def each(*scalars):
            results = []
            for t in range(times):
                changes = [
                    scalars[count + where_in[n, row + batched[n] * t * linear[n].width, second]]
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
        """Returns this loop without its unused inputs, and the indices of the inputs that remain.

        Inputs in which it is linear, and those whose buffer an output reuses, always remain.
        """
        places = slots(self.inputs)
        used = {
            places[scalar][0] for program in (self.law, self.guard) for scalar in _read(program)
        }
        used |= {alias.input for alias in self.in_place}
        used |= set(range(len(self.inputs) - self.linear, len(self.inputs)))
        remaining = sorted(used)
        inputs = tuple(self.inputs[n] for n in remaining)

        def without_unused(program: ClosedJaxpr) -> ClosedJaxpr:
            own = places[: len(program.jaxpr.invars)]
            kinds = [jax.ShapeDtypeStruct((), self.inputs[n].dtype) for n, _, _ in own]

            def evaluated(*scalars):
                arguments = iter(scalars)
                full = [
                    next(arguments) if n in used else jnp.zeros((), kind.dtype)
                    for (n, _, _), kind in zip(own, kinds, strict=True)
                ]
                return jaxpr_as_fun(program)(*full)

            pairs = zip(own, kinds, strict=True)
            return _traced(evaluated, [kind for (n, _, _), kind in pairs if n in used])

        in_place = tuple(
            alias._replace(input=remaining.index(alias.input)) for alias in self.in_place
        )
        loop = PairLoop(
            without_unused(self.law),
            without_unused(self.guard),
            inputs,
            self.outputs,
            self.linear,
            in_place,
        )
        return loop, tuple(remaining)


def _constants(program: ClosedJaxpr) -> tuple[bytes, ...]:
    """Bytes of the constants of a program and of the programs that it calls."""
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
    """Indices of the arguments on which any result depends."""
    every = [True] * len(closed.jaxpr.outvars)
    _, read = partial_eval.dce_jaxpr(closed.jaxpr, every)
    return [number for number, is_read in enumerate(read) if is_read]


def _dependent(closed: ClosedJaxpr, count: int) -> list[bool]:
    """True for each result that may depend on an argument after the first `count`.

    A call inside the program counts as if all its results depended on all its arguments.
    """
    dependent = set(closed.jaxpr.invars[count:])
    for equation in closed.jaxpr.eqns:
        if any(not isinstance(v, Literal) and v in dependent for v in equation.invars):
            dependent.update(equation.outvars)
    return [not isinstance(v, Literal) and v in dependent for v in closed.jaxpr.outvars]
