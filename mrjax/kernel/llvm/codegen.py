"""Machine code for a loop over pairs, compiled by LLVM from the jaxpr of the law.

XLA splits a contact law into some thirty passes over all pairs. Here LLVM compiles the same jaxpr
into the body of one loop. The loop evaluates the guard of every pair, collects the pairs that pass
(those in contact), and evaluates the law for several of them at a time in SIMD lanes. XLA calls the
compiled loop through its foreign function interface.
"""

import ctypes
import hashlib
import sys
from functools import cache
from threading import Lock

import jax
from llvmlite import binding, ir

from ..loop import Kind, Operand, PairLoop, Slot, slots
from . import threads
from .chunks import chunk_stages
from .jaxpr import FREE, FUNCTIONS, INT, LONG, POINTER, TYPES, counted, translate
from .xla_ffi import NULL, CallFrame

VECTOR, LINEAR = 32, 64
"""Bytes of a SIMD vector of pairs, in ordinary loops and in loops linear in tangents or cotangents.

In double precision these are four and eight pairs. Eight were faster in linear loops, which reverse
mode uses.
"""
CHUNKS = 8
"""Number of chunks of a long list.

It does not depend on the number of threads, so the order of summation does not either.
"""
LONG_LIST = 16_384
"""Capacity of a list, in pairs, from which on chunks make a loop faster."""

_engines: dict[str, binding.ExecutionEngine] = {}  # each owns the machine code of one name
_lock = Lock()


def _lanes(loop: PairLoop) -> int:
    """Number of pairs that are evaluated together."""
    return loop.lanes(LINEAR if loop.linear else VECTOR)


def chunk_count(room: int) -> int:
    """Number of chunks of a pair list with capacity `room`."""
    return CHUNKS if room >= LONG_LIST else 1


@cache
def registered(loop: PairLoop, particles: int, room: int) -> str:
    """Compiles a loop, registers it with XLA, and returns its name, the same in every process.

    A chunked loop has one extra scratch output, of `chunks.room_for_sums` values for each chunk;
    ignore it.

    Args:
      loop: the loop.
      particles, room: N and P; they are constants in the code, so row offsets are constants too.

    Raises:
      NotImplementedError: the law has an operation that cannot be translated.
    """
    module = _module(loop, particles, room)
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
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    for name in FUNCTIONS.values():
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        binding.add_symbol(name, address)
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


def _module(loop: PairLoop, particles: int, room: int) -> ir.Module:
    """Builds the LLVM module of a loop.

    It has a function `law` for one vector of pairs, a function `loop` for all pairs or one chunk,
    and the `handler` that XLA calls.
    """
    module = ir.Module("pairs")
    operands = 3 + len(loop.inputs)
    pointers = [POINTER] * (operands + len(loop.outputs))
    shared = {
        index for alias in loop.in_place for index in (3 + alias.input, operands + alias.output)
    }

    def function(name: str, *more: ir.Type) -> ir.Function:
        kind = ir.FunctionType(ir.VoidType(), [*pointers, *more])
        body = ir.Function(module, kind, name)
        body.linkage = "internal"
        if loop.linear:
            # On a stack aligned to 16 bytes, vectors as long as a cache line would straddle two.
            body.attributes.alignstack = LINEAR
            body.attributes.add("nounwind")  # llvmlite omits alignstack if it is the only attribute
        for index, argument in enumerate(body.args[: len(pointers)]):
            if index not in shared:
                argument.add_attribute("noalias")
        return body

    law, body = function("law", POINTER, LONG, POINTER), function("loop", *[LONG] * 5)
    shape = LONG(particles), LONG(room)
    _Body(loop, law, *shape).law(*law.args[-3:])
    _Body(loop, body, *shape).pairs(law, *body.args[-5:])

    handler = ir.Function(module, ir.FunctionType(POINTER, [POINTER]), "handler")
    build = ir.IRBuilder(handler.append_basic_block())
    frame = CallFrame(build, handler.args[0])
    number = chunk_count(room)
    data = frame.buffers(operands, len(loop.outputs) + (number > 1))
    pairs = build.sext(build.load(data[2], typ=INT), LONG)
    pairs = build.select(build.icmp_signed("<", pairs, shape[1]), pairs, shape[1])
    if number == 1:
        build.call(body, [*data, LONG(0), pairs, shape[1], LONG(0), shape[0]])
    else:
        both = chunk_stages(loop, body, number, particles, room)
        threads.run(frame, both, number, [*data, pairs], spare=2 * number)
    build.ret(NULL)
    return module


class _Body:
    """Builder of a function that reads and writes the arrays of a call, which are its arguments."""

    def __init__(
        self, loop: PairLoop, function: ir.Function, particles: ir.Constant, room: ir.Constant
    ):
        self.loop, self.arguments = loop, function.args[: 3 + len(loop.inputs + loop.outputs)]
        self.particles, self.room = particles, room
        self.first, self.second, self.count = self.arguments[:3]
        self.inputs = self.arguments[3 : 3 + len(loop.inputs)]
        self.outputs = self.arguments[3 + len(loop.inputs) :]
        self.build = ir.IRBuilder(function.append_basic_block())

    def pairs(
        self,
        law: ir.Function,
        begin: ir.Value,
        end: ir.Value,
        past: ir.Value,
        low: ir.Value,
        high: ir.Value,
    ) -> None:
        """Emits the loop over pairs: the guard of each pair, then the law for vectors of pairs.

        Args:
          law: function called for pairs that pass the guard.
          begin, end: range of the pairs, `end` exclusive.
          past: end of the empty entries that follow from `end`, exclusive. Zeros are written there,
            except where an output reuses the buffer of an input.
          low, high: range of the particles that these pairs add to, `high` exclusive.
        """
        build, loop = self.build, self.loop
        in_place = {alias.output for alias in loop.in_place}
        lasting = {alias.output for alias in loop.in_place if alias.lasting}
        for pointer, leaf in zip(self.outputs, loop.outputs, strict=True):
            if leaf.kind is Kind.PARTICLE:
                self.clear(pointer, leaf, low, high)
        lanes = _lanes(loop)
        queue, length = (build.alloca(LONG, size) for size in (lanes, 1))
        build.store(LONG(0), length)
        nothing = ir.VectorType(TYPES[loop.outputs[0].dtype], lanes)(None)
        over_all = [place for place in slots(loop.outputs) if self.over_all(place)]
        sums = build.alloca(nothing.type, max(1, len(over_all)))
        for number in range(len(over_all)):
            build.store(nothing, self.sum(sums, number, nothing.type))
        with counted(build, begin, end) as pair:
            (touching,) = translate(build, loop.guard, _Reader(self, pair), None)
            with build.if_else(touching) as (near, apart):
                with near:
                    old_length = build.load(length, typ=LONG)
                    build.store(pair, build.gep(queue, [old_length], source_etype=LONG))
                    new_length = build.add(old_length, LONG(1))
                    build.store(new_length, length)
                    with build.if_then(build.icmp_signed("==", new_length, LONG(lanes))):
                        build.call(law, [*self.arguments, queue, new_length, sums])
                        build.store(LONG(0), length)
                with apart:
                    for place in slots(loop.outputs):
                        leaf = loop.outputs[place[0]]
                        if leaf.kind is Kind.PAIR and place[0] not in lasting:
                            address = self.place(self.outputs[place[0]], leaf, place[1], pair)
                            build.store(TYPES[leaf.dtype](0.0), address)
        remaining = build.load(length, typ=LONG)
        with build.if_then(build.icmp_signed(">", remaining, LONG(0))):
            first = build.load(queue, typ=LONG)
            with counted(build, remaining, LONG(lanes)) as lane:  # repeat a pair in unused lanes
                build.store(first, build.gep(queue, [lane], source_etype=LONG))
            build.call(law, [*self.arguments, queue, remaining, sums])
        for index, (pointer, leaf) in enumerate(zip(self.outputs, loop.outputs, strict=True)):
            if leaf.kind is Kind.PAIR and index not in in_place:
                self.clear(pointer, leaf, end, past)
        for number, (index, row, _) in enumerate(over_all):
            lane_sums = build.load(self.sum(sums, number, nothing.type), typ=nothing.type)
            total = build.extract_element(lane_sums, INT(0))
            for lane in range(1, lanes):
                total = build.fadd(total, build.extract_element(lane_sums, INT(lane)), flags=FREE)
            address = self.place(self.outputs[index], loop.outputs[index], row, LONG(0))
            build.store(total, address)
        build.ret_void()

    def law(self, queue: ir.Value, count: ir.Value, sums: ir.Value) -> None:
        """Emits the law for one vector of pairs; only the first `count` lanes are counted.

        Outputs that are summed over all pairs are accumulated lane by lane in a vector each.

        Args:
          queue: address of the indices of the pairs, one for each lane.
          count: number of lanes in use; the other lanes repeat a pair.
          sums: address of the vectors of the outputs that are summed over all pairs.
        """
        build, loop = self.build, self.loop
        lanes = _lanes(loop)
        pairs = [
            build.load(build.gep(queue, [LONG(lane)], source_etype=LONG), typ=LONG)
            for lane in range(lanes)
        ]
        readers = [_Reader(self, pair) for pair in pairs]

        @cache
        def read(scalar: int) -> ir.Value:
            whole = ir.VectorType(readers[0].type_of(scalar), lanes)(ir.Undefined)
            for lane, reader in enumerate(readers):
                whole = build.insert_element(whole, reader(scalar), INT(lane))
            return whole

        values = translate(build, loop.law, read, lanes)
        results = list(zip(slots(loop.outputs), values, strict=True))
        in_use = self.below(count, lanes)
        shared = [value for place, value in results if self.over_all(place)]
        for number, whole in enumerate(shared):
            address = self.sum(sums, number, whole.type)
            added = build.select(in_use, whole, whole.type(None))
            total = build.fadd(build.load(address, typ=whole.type), added, flags=FREE)
            build.store(total, address)
        results = [(place, value) for place, value in results if not self.over_all(place)]
        for lane, (pair, reader) in enumerate(zip(pairs, readers, strict=True)):
            with build.if_then(build.icmp_signed("<", LONG(lane), count)):
                targets = [self.target(place, pair, reader) for place, _ in results]
                for (place, value), address in zip(results, targets, strict=True):
                    if not place[2]:
                        self.add(place, address, build.extract_element(value, INT(lane)))
                with build.if_then(build.not_(reader.wall)):
                    for (place, value), address in zip(results, targets, strict=True):
                        if place[2]:
                            self.add(place, address, build.extract_element(value, INT(lane)))
        build.ret_void()

    def over_all(self, place: Slot) -> bool:
        return self.loop.outputs[place[0]].kind is Kind.SHARED

    def sum(self, sums: ir.Value, number: int, kind: ir.Type) -> ir.Value:
        return self.build.gep(sums, [LONG(number)], source_etype=kind)

    def below(self, count: ir.Value, lanes: int) -> ir.Value:
        """Mask of the lanes whose index is below `count`."""
        counts = ir.VectorType(LONG, lanes)(ir.Undefined)
        for lane in range(lanes):
            counts = self.build.insert_element(counts, count, INT(lane))
        numbers = ir.Constant(counts.type, [LONG(lane) for lane in range(lanes)])
        return self.build.icmp_signed("<", numbers, counts)

    def target(self, place: Slot, pair: ir.Value, reader: "_Reader") -> ir.Value:
        n, row, of_second = place
        leaf = self.loop.outputs[n]
        particle = reader.second if of_second else reader.first
        index = pair if leaf.kind is Kind.PAIR else particle
        return self.place(self.outputs[n], leaf, row, index)

    def add(self, place: Slot, address: ir.Value, value: ir.Value) -> None:
        leaf = self.loop.outputs[place[0]]
        if leaf.kind is not Kind.PAIR:
            before = self.build.load(address, typ=TYPES[leaf.dtype])
            value = self.build.fadd(before, value, flags=FREE)
        self.build.store(value, address)

    def clear(self, pointer: ir.Value, leaf: Operand, begin: ir.Value, end: ir.Value) -> None:
        for row in range(leaf.width):
            with counted(self.build, begin, end) as index:
                place = self.place(pointer, leaf, row, index)
                self.build.store(TYPES[leaf.dtype](0.0), place)

    def place(self, pointer: ir.Value, leaf: Operand, row: int, index: ir.Value) -> ir.Value:
        stride = {Kind.PARTICLE: self.particles, Kind.PAIR: self.room, Kind.SHARED: LONG(1)}[
            leaf.kind
        ]
        index = self.build.add(self.build.mul(LONG(row), stride), index)
        return self.build.gep(pointer, [index], source_etype=TYPES[leaf.dtype])


class _Reader:
    """Loads the scalars of one pair, each at most once, by their index in the law's arguments."""

    def __init__(self, body: _Body, pair: ir.Value):
        self.body, self.pair, build = body, pair, body.build

        def end(pointer: ir.Value) -> ir.Value:
            address = build.gep(pointer, [pair], source_etype=INT)
            return build.sext(build.load(address, typ=INT), LONG)

        self.first, self.second = end(body.first), end(body.second)
        self.wall = build.icmp_signed(">=", self.second, body.particles)
        self.inside = build.select(self.wall, LONG(0), self.second)
        self.places = slots(body.loop.inputs)
        self.values: dict[int, ir.Value] = {}

    def type_of(self, scalar: int) -> ir.Type:
        return TYPES[self.body.loop.inputs[self.places[scalar][0]].dtype]

    def __call__(self, scalar: int) -> ir.Value:
        if scalar not in self.values:
            self.values[scalar] = self._read(*self.places[scalar])
        return self.values[scalar]

    def _read(self, n: int, row: int, of_second: bool) -> ir.Value:
        build, leaf = self.body.build, self.body.loop.inputs[n]
        particle = self.inside if of_second else self.first
        index = {Kind.PARTICLE: particle, Kind.PAIR: self.pair, Kind.SHARED: LONG(0)}[leaf.kind]
        address = self.body.place(self.body.inputs[n], leaf, row, index)
        value = build.load(address, typ=TYPES[leaf.dtype])
        return build.select(self.wall, TYPES[leaf.dtype](0), value) if of_second else value
