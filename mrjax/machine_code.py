"""A law of pairs as machine code: one loop over the pairs, from the law's own JAX program.

XLA splits a contact law into some thirty passes over all pairs. Here LLVM compiles the same program
into the body of one loop: it looks at every pair, collects those that touch, and takes them through
the law a few at a time, in the lanes of the processor's vectors. XLA calls it through its foreign
function interface.
"""

import ctypes
import hashlib
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal
from llvmlite import binding, ir

from mrjax.loop import Kind, Leaf, Loop, Place, places

INT, LONG, BIT, POINTER = ir.IntType(32), ir.IntType(64), ir.IntType(1), ir.PointerType()
TYPES = {
    "float32": ir.FloatType(),
    "float64": ir.DoubleType(),
    "int32": INT,
    "int64": LONG,
    "bool": BIT,
}
FREE = ("contract", "nsz", "arcp")
"""Liberties with rounding that XLA takes too: a b + c in one operation, reciprocals."""

# Where XLA's C interface keeps what is read here, in bytes (xla/ffi/api/c_api.h).
EXTENSION, ARGUMENTS, RESULTS = 8, 72, 112
METADATA, MAJOR, MINOR = 24, 24, 28
DATA, DIMENSIONS = 24, 40
MAJOR_VERSION = 0

VECTOR = 32
"""Bytes of a vector in which pairs are taken together: four in double precision."""

_engines: dict[str, binding.ExecutionEngine] = {}  # each owns the code of a name
_lock = Lock()


@cache
def registered(loop: Loop) -> str:
    """The name under which XLA finds the compiled loop: the same in every process.

    Raises:
      NotImplementedError: the law has an operation that is not translated here.
    """
    module = _module(loop)
    name = "mrjax_" + hashlib.sha256(str(module).encode()).hexdigest()[:32]
    with _lock:
        if name not in _engines:
            _engines[name] = engine = _compiled(str(module))
            address = ctypes.c_void_p(engine.get_function_address("handler"))
            jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(address), platform="cpu")
    return name


@cache
def _machine() -> binding.TargetMachine:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=binding.get_host_cpu_features().flatten(),
        opt=3,
        jit=True,
    )


def _compiled(source: str) -> binding.ExecutionEngine:
    module = binding.parse_assembly(source)
    module.verify()
    builder = binding.create_pass_builder(
        _machine(), binding.create_pipeline_tuning_options(speed_level=3)
    )
    builder.getModulePassManager().run(module, builder)
    engine = binding.create_mcjit_compiler(module, _machine())
    engine.finalize_object()
    return engine


@cache
def _minor_version() -> int:
    header = Path(jax.ffi.include_dir()) / "xla" / "ffi" / "api" / "c_api.h"
    text = header.read_text()
    version = {
        part: int(re.search(rf"#define XLA_FFI_API_{part} (\d+)", text)[1])
        for part in ("MAJOR", "MINOR")
    }
    if version["MAJOR"] != MAJOR_VERSION:
        raise NotImplementedError(f"XLA's foreign function interface {version} is not known here")
    return version["MINOR"]


def _module(loop: Loop) -> ir.Module:
    """Three functions: the law for some pairs, the loop, and the handler that XLA calls."""
    module = ir.Module("pairs")
    operands = 3 + len(loop.inputs)
    pointers = [POINTER] * (operands + len(loop.outputs))
    shared = {at for given, taken in loop.in_place for at in (3 + given, operands + taken)}

    def function(name: str, *more: ir.Type) -> ir.Function:
        kind = ir.FunctionType(ir.VoidType(), [*pointers, LONG, LONG, *more])
        made = ir.Function(module, kind, name)
        made.linkage = "internal"
        for index, argument in enumerate(made.args[: len(pointers)]):
            if index not in shared:
                argument.add_attribute("noalias")
        return made

    law, body = function("law", POINTER, LONG), function("loop")
    _Body(loop, law).law(*law.args[-2:])
    _Body(loop, body).all_pairs(law)

    handler = ir.Function(module, ir.FunctionType(POINTER, [POINTER]), "handler")
    build = ir.IRBuilder(handler.append_basic_block())
    (frame,) = handler.args

    def at(base: ir.Value, offset: int, kind: ir.Type = POINTER) -> ir.Value:
        return build.load(_moved(build, base, offset), typ=kind)

    # XLA first asks, by the only extension there is, for the version that this was written for.
    extension = at(frame, EXTENSION)
    with build.if_then(build.icmp_unsigned("!=", extension, ir.Constant(POINTER, None))):
        metadata = at(extension, METADATA)
        build.store(INT(MAJOR_VERSION), _moved(build, metadata, MAJOR))
        build.store(INT(_minor_version()), _moved(build, metadata, MINOR))
        build.ret(ir.Constant(POINTER, None))
    arguments, results = at(frame, ARGUMENTS), at(frame, RESULTS)
    buffers = [at(arguments, 8 * i) for i in range(operands)]
    buffers += [at(results, 8 * i) for i in range(len(loop.outputs))]

    def length(buffer: ir.Value, leaf: Leaf) -> ir.Value:
        return at(at(buffer, DIMENSIONS), 0 if leaf.rows is None else 8, LONG)

    of_particles = next(
        (buffer, leaf)
        for buffer, leaf in zip(buffers[3:], loop.inputs + loop.outputs, strict=True)
        if leaf.kind is Kind.PARTICLE
    )
    room = at(at(buffers[0], DIMENSIONS), 0, LONG)
    data = [at(buffer, DATA) for buffer in buffers]
    build.call(body, [*data, length(*of_particles), room])
    build.ret(ir.Constant(POINTER, None))
    return module


def _moved(build: ir.IRBuilder, base: ir.Value, offset: int) -> ir.Value:
    return build.gep(base, [LONG(offset)], source_etype=ir.IntType(8))


class _Body:
    """Code that reads and writes the arrays of a call, in a function that is given them."""

    def __init__(self, loop: Loop, function: ir.Function):
        self.loop, self.arguments = loop, function.args[: 5 + len(loop.inputs + loop.outputs)]
        *pointers, self.particles, self.room = self.arguments
        self.first, self.second, self.count = pointers[:3]
        self.inputs = pointers[3 : 3 + len(loop.inputs)]
        self.outputs = pointers[3 + len(loop.inputs) :]
        self.build = ir.IRBuilder(function.append_basic_block())

    def all_pairs(self, law: ir.Function) -> None:
        """Every listed pair looked at, and those that touch handed on."""
        build, loop = self.build, self.loop
        for pointer, leaf in zip(self.outputs, loop.outputs, strict=True):
            if leaf.kind is Kind.PARTICLE:
                self.clear(pointer, leaf, LONG(0), self.particles)
            elif leaf.kind is Kind.ALL:
                self.clear(pointer, leaf, LONG(0), LONG(1))
        lanes = loop.lanes(VECTOR)
        found, met = (build.bitcast(build.alloca(LONG, size), POINTER) for size in (lanes, 1))
        build.store(LONG(0), met)
        listed = build.sext(build.load(self.count, typ=INT), LONG)
        last = build.select(build.icmp_signed("<", listed, self.room), listed, self.room)
        with _counted(build, LONG(0), last) as pair:
            (touching,) = _translated(build, loop.touching, _Reader(self, pair), None)
            with build.if_else(touching) as (near, apart):
                with near:
                    so_far = build.load(met, typ=LONG)
                    build.store(pair, build.gep(found, [so_far], source_etype=LONG))
                    more = build.add(so_far, LONG(1))
                    build.store(more, met)
                    with build.if_then(build.icmp_signed("==", more, LONG(lanes))):
                        build.call(law, [*self.arguments, found, more])
                        build.store(LONG(0), met)
                with apart:
                    for place in places(loop.outputs):
                        leaf = loop.outputs[place[0]]
                        if leaf.kind is Kind.PAIR:
                            at = self.place(self.outputs[place[0]], leaf, place[1], pair)
                            build.store(TYPES[leaf.dtype](0.0), at)
        left = build.load(met, typ=LONG)
        with build.if_then(build.icmp_signed(">", left, LONG(0))):
            first = build.load(found, typ=LONG)
            with _counted(build, left, LONG(lanes)) as lane:  # pairs to fill the vector up
                build.store(first, build.gep(found, [lane], source_etype=LONG))
            build.call(law, [*self.arguments, found, left])
        for pointer, leaf in zip(self.outputs, loop.outputs, strict=True):
            if leaf.kind is Kind.PAIR:
                self.clear(pointer, leaf, last, self.room)
        build.ret_void()

    def law(self, found: ir.Value, count: ir.Value) -> None:
        """The law for as many pairs as there are lanes, of which the first `count` are new."""
        build, loop = self.build, self.loop
        lanes = loop.lanes(VECTOR)
        pairs = [
            build.load(build.gep(found, [LONG(lane)], source_etype=LONG), typ=LONG)
            for lane in range(lanes)
        ]
        readers = [_Reader(self, pair) for pair in pairs]

        @cache
        def read(scalar: int) -> ir.Value:
            whole = ir.VectorType(readers[0].type_of(scalar), lanes)(ir.Undefined)
            for lane, reader in enumerate(readers):
                whole = build.insert_element(whole, reader(scalar), INT(lane))
            return whole

        values = _translated(build, loop.law, read, lanes)
        results = list(zip(places(loop.outputs), values, strict=True))
        for lane, (pair, reader) in enumerate(zip(pairs, readers, strict=True)):
            with build.if_then(build.icmp_signed("<", LONG(lane), count)):
                targets = [self.target(place, pair, reader) for place, _ in results]
                for (place, value), at in zip(results, targets, strict=True):
                    if not place[2]:
                        self.add(place, at, build.extract_element(value, INT(lane)))
                with build.if_then(build.not_(reader.wall)):
                    for (place, value), at in zip(results, targets, strict=True):
                        if place[2]:
                            self.add(place, at, build.extract_element(value, INT(lane)))
        build.ret_void()

    def target(self, place: Place, pair: ir.Value, reader: "_Reader") -> ir.Value:
        n, row, of_second = place
        leaf = self.loop.outputs[n]
        particle = reader.second if of_second else reader.first
        index = {Kind.PARTICLE: particle, Kind.PAIR: pair, Kind.ALL: LONG(0)}[leaf.kind]
        return self.place(self.outputs[n], leaf, row, index)

    def add(self, place: Place, at: ir.Value, value: ir.Value) -> None:
        leaf = self.loop.outputs[place[0]]
        if leaf.kind is not Kind.PAIR:
            before = self.build.load(at, typ=TYPES[leaf.dtype])
            value = self.build.fadd(before, value, flags=FREE)
        self.build.store(value, at)

    def clear(self, pointer: ir.Value, leaf: Leaf, begin: ir.Value, end: ir.Value) -> None:
        for row in range(leaf.width):
            with _counted(self.build, begin, end) as index:
                place = self.place(pointer, leaf, row, index)
                self.build.store(TYPES[leaf.dtype](0.0), place)

    def place(self, pointer: ir.Value, leaf: Leaf, row: int, index: ir.Value) -> ir.Value:
        stride = {Kind.PARTICLE: self.particles, Kind.PAIR: self.room, Kind.ALL: LONG(1)}[leaf.kind]
        index = self.build.add(self.build.mul(LONG(row), stride), index)
        return self.build.gep(pointer, [index], source_etype=TYPES[leaf.dtype])


class _Reader:
    """The scalars of one pair, by their number among the arguments of the law."""

    def __init__(self, body: _Body, pair: ir.Value):
        self.body, self.pair, build = body, pair, body.build

        def end(pointer: ir.Value) -> ir.Value:
            at = build.gep(pointer, [pair], source_etype=INT)
            return build.sext(build.load(at, typ=INT), LONG)

        self.first, self.second = end(body.first), end(body.second)
        self.wall = build.icmp_signed(">=", self.second, body.particles)
        self.inside = build.select(self.wall, LONG(0), self.second)
        self.places = places(body.loop.inputs)
        self.known: dict[int, ir.Value] = {}

    def type_of(self, scalar: int) -> ir.Type:
        return TYPES[self.body.loop.inputs[self.places[scalar][0]].dtype]

    def __call__(self, scalar: int) -> ir.Value:
        if scalar not in self.known:
            self.known[scalar] = self._read(*self.places[scalar])
        return self.known[scalar]

    def _read(self, n: int, row: int, of_second: bool) -> ir.Value:
        build, leaf = self.body.build, self.body.loop.inputs[n]
        particle = self.inside if of_second else self.first
        index = {Kind.PARTICLE: particle, Kind.PAIR: self.pair, Kind.ALL: LONG(0)}[leaf.kind]
        at = self.body.place(self.body.inputs[n], leaf, row, index)
        value = build.load(at, typ=TYPES[leaf.dtype])
        return build.select(self.wall, TYPES[leaf.dtype](0), value) if of_second else value


@contextmanager
def _counted(build: ir.IRBuilder, begin: ir.Value, end: ir.Value) -> Iterator[ir.Value]:
    """A loop of an index from begin to before end."""
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


def _translated(
    build: ir.IRBuilder,
    closed: ClosedJaxpr,
    read: Callable[[int], ir.Value],
    lanes: int | None,
) -> list[ir.Value]:
    """A program of scalars, written where the builder stands.

    Args:
      build: the builder.
      closed: the program.
      read: its arguments by number, called where they are needed.
      lanes: of vectors that stand for the scalars; None for scalars.
    """
    arguments = {variable: i for i, variable in enumerate(closed.jaxpr.invars)}
    values = {
        variable: _constant(value, variable.aval.dtype, lanes)
        for variable, value in zip(closed.jaxpr.constvars, closed.consts, strict=True)
    }

    def of(atom) -> ir.Value:
        if isinstance(atom, Literal):
            return _constant(atom.val, atom.aval.dtype, lanes)
        if atom in arguments:
            return read(arguments[atom])
        return values[atom]

    for equation in closed.jaxpr.eqns:
        inner = next((equation.params[k] for k in INNER if k in equation.params), None)
        if inner is not None:
            given = equation.invars
            results = _translated(build, inner, lambda i, given=given: of(given[i]), lanes)
        else:
            given = [of(atom) for atom in equation.invars]
            results = [_operation(build, equation, given, lanes)]
        values.update(zip(equation.outvars, results, strict=True))
    return [of(atom) for atom in closed.jaxpr.outvars]


def _type(dtype: np.dtype, lanes: int | None) -> ir.Type:
    kind = TYPES[dtype.name]
    return kind if lanes is None else ir.VectorType(kind, lanes)


def _constant(value: object, dtype: np.dtype, lanes: int | None) -> ir.Constant:
    number = TYPES[dtype.name](np.asarray(value).item())
    return number if lanes is None else ir.Constant(_type(dtype, lanes), [number] * lanes)


INNER = ("jaxpr", "call_jaxpr")
SAME = ("broadcast_in_dim", "reshape", "squeeze", "copy", "copy_p", "stop_gradient")
ARITHMETIC = {"add": "fadd", "add_any": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
WHOLE = {"add": "add", "add_any": "add", "sub": "sub", "mul": "mul"}
ORDER = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
LOGIC = {"and": "and_", "or": "or_", "xor": "xor"}
INTRINSIC = {"sqrt": "llvm.sqrt", "abs": "llvm.fabs", "max": "llvm.maximum", "min": "llvm.minimum"}


def _operation(build: ir.IRBuilder, equation, given: list[ir.Value], lanes: int | None) -> ir.Value:
    """One operation of JAX on scalars.

    Raises:
      NotImplementedError: it is none of those that contact laws consist of.
    """
    name, kind = equation.primitive.name, equation.outvars[0].aval.dtype
    of = equation.invars[0].aval.dtype
    real = of.kind == "f"
    if name in SAME:
        return given[0]
    if name in ARITHMETIC and real:
        return getattr(build, ARITHMETIC[name])(*given, flags=FREE)
    if name in WHOLE and not real:
        return getattr(build, WHOLE[name])(*given)
    if name in ORDER:
        if real:
            compare = build.fcmp_unordered if name == "ne" else build.fcmp_ordered
            return compare(ORDER[name], *given)
        return build.icmp_signed(ORDER[name], *given)
    if name in LOGIC:
        return getattr(build, LOGIC[name])(*given)
    if name == "not":
        return build.not_(*given)
    if name == "neg" and real:
        return build.fneg(*given)
    if name in INTRINSIC and real:
        return build.call(_intrinsic(build.module, INTRINSIC[name], of, lanes, len(given)), given)
    if name == "select_n" and len(given) == 3:
        return build.select(given[0], given[2], given[1])
    if name == "square" and real:
        return build.fmul(given[0], given[0], flags=FREE)
    if name == "integer_pow" and real:
        return _power(build, given[0], equation.params["y"], _constant(1.0, of, lanes))
    if name == "convert_element_type":
        return _converted(build, given[0], of, kind, _type(kind, lanes))
    raise NotImplementedError(f"{name} of {of} has no machine code here")


def _intrinsic(
    module: ir.Module, base: str, dtype: np.dtype, lanes: int | None, arguments: int
) -> ir.Function:
    name = f"{base}.{'' if lanes is None else f'v{lanes}'}f{8 * dtype.itemsize}"
    if name in module.globals:
        return module.globals[name]
    kind = _type(dtype, lanes)
    return ir.Function(module, ir.FunctionType(kind, [kind] * arguments), name)


def _power(build: ir.IRBuilder, base: ir.Value, exponent: int, one: ir.Value) -> ir.Value:
    result = one
    for _ in range(abs(exponent)):
        result = build.fmul(result, base, flags=FREE)
    return result if exponent >= 0 else build.fdiv(one, result, flags=FREE)


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
    raise NotImplementedError(f"{old} to {new} has no machine code here")
