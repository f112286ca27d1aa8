"""A loop over pairs in chunks; each chunk has its own sums, which are added in the chunks' order.

The buffer of a chunk has space for all particles. A chunk clears, fills and passes on only the
range from the lowest to the highest particle id of its pairs. This range is short if particles are
sorted in space and the pair list is sorted by particle.
"""

from llvmlite import ir

from ..loop import Kind, Operand, PairLoop
from .jaxpr import FREE, INT, LONG, POINTER, TYPES, counted
from .threads import word


def room_for_sums(outputs: tuple[Operand, ...], particles: int) -> int:
    """Number of values in the sums of one chunk."""
    return sum(leaf.width * _length(leaf, particles) for leaf in _sums(outputs))


def chunk_stages(
    loop: PairLoop, body: ir.Function, chunks: int, particles: int, room: int
) -> list[ir.Function]:
    """Builds the stages of a chunked loop: one evaluates the pairs, one adds up the sums.

    Each stage is a function of the words of a job and the index of a chunk. The words hold the
    addresses of the arrays that `body` takes, the address of the buffer for the sums of all chunks,
    and the number of pairs. The words after these store the range of particle ids of each chunk.
    """
    module = body.module
    some = _Stage(loop, module, "some", chunks, particles, room)
    some.pairs(body)
    if not _sums(loop.outputs):
        return [some.function]
    added = _Stage(loop, module, "added", chunks, particles, room)
    added.sums()
    return [some.function, added.function]


def _sums(outputs: tuple[Operand, ...]) -> list[Operand]:
    return [leaf for leaf in outputs if leaf.kind is not Kind.PAIR]


def _length(leaf: Operand, particles: int) -> int:
    return particles if leaf.kind is Kind.PARTICLE else 1


class _Stage:
    """Builder of one stage function, with the values that it loads from the words of the job."""

    def __init__(
        self,
        loop: PairLoop,
        module: ir.Module,
        name: str,
        chunks: int,
        particles: int,
        room: int,
    ):
        kind = ir.FunctionType(ir.VoidType(), [POINTER, LONG])
        self.function = ir.Function(module, kind, name)
        self.function.linkage = "internal"
        self.loop, self.chunks = loop, chunks
        self.words, self.chunk = self.function.args
        self.build = build = ir.IRBuilder(self.function.append_basic_block())
        self.outputs, arrays = 3 + len(loop.inputs), 3 + len(loop.inputs + loop.outputs)
        self.number = TYPES[loop.outputs[0].dtype]

        def loaded(index: int, typ: ir.Type) -> ir.Value:
            return build.load(word(build, self.words, index), typ=typ)

        self.arrays = [loaded(index, POINTER) for index in range(arrays)]
        self.chunk_sums = loaded(arrays, POINTER)
        self.pair_count = loaded(arrays + 1, LONG)
        self.particles, self.room = particles, room
        self.lows, self.highs = arrays + 2, arrays + 2 + chunks

    def pairs(self, body: ir.Function) -> None:
        """Emits the loop over the pairs of this chunk."""
        build = self.build
        begin, end = self.share(self.pair_count)
        low, high = self.particle_range(begin, end)
        build.store(low, word(build, self.words, build.add(LONG(self.lows), self.chunk)))
        build.store(high, word(build, self.words, build.add(LONG(self.highs), self.chunk)))
        last = build.icmp_signed("==", self.chunk, LONG(self.chunks - 1))
        past = build.select(last, LONG(self.room), end)
        arrays = list(self.arrays)
        for index, leaf in enumerate(self.loop.outputs):
            if leaf.kind is not Kind.PAIR:
                arrays[self.outputs + index] = self.place(self.chunk, index)
        build.call(body, [*arrays, begin, end, past, low, high])
        build.ret_void()

    def sums(self) -> None:
        """Emits the addition of all chunks' sums, for this chunk's share of the particles.

        The first chunk also adds up the outputs that are summed over all pairs.
        """
        build = self.build
        begin, end = self.share(LONG(self.particles))
        outputs = list(enumerate(self.loop.outputs))
        of_particles = [index for index, leaf in outputs if leaf.kind is Kind.PARTICLE]
        of_all = [index for index, leaf in outputs if leaf.kind is Kind.SHARED]
        for index in of_particles:
            self.clear(index, begin, end)
        with counted(build, LONG(0), LONG(self.chunks)) as chunk:
            low, high = (
                build.load(word(build, self.words, build.add(LONG(ends), chunk)), typ=LONG)
                for ends in (self.lows, self.highs)
            )
            low = build.select(build.icmp_signed(">", low, begin), low, begin)
            high = build.select(build.icmp_signed("<", high, end), high, end)
            for index in of_particles:
                self.add(index, chunk, low, high)
        if of_all:
            with build.if_then(build.icmp_signed("==", self.chunk, LONG(0))):
                for index in of_all:
                    self.clear(index, LONG(0), LONG(1))
                with counted(build, LONG(0), LONG(self.chunks)) as chunk:
                    for index in of_all:
                        self.add(index, chunk, LONG(0), LONG(1))
        build.ret_void()

    def share(self, number: ir.Value) -> tuple[ir.Value, ir.Value]:
        """Begin and end of this chunk's share of `number` items."""
        build = self.build
        after = build.add(self.chunk, LONG(1))
        return tuple(
            build.sdiv(build.mul(number, edge), LONG(self.chunks)) for edge in (self.chunk, after)
        )

    def particle_range(self, begin: ir.Value, end: ir.Value) -> tuple[ir.Value, ir.Value]:
        """Lowest particle id of these pairs, and one more than the highest."""
        build = self.build
        particles = INT(self.particles)
        low, high = (build.alloca(INT) for _ in range(2))
        build.store(particles, low)
        build.store(INT(0), high)

        def update(place: ir.Value, order: str, value: ir.Value) -> None:
            before = build.load(place, typ=INT)
            beyond = build.icmp_signed(order, value, before)
            build.store(build.select(beyond, value, before), place)

        with counted(build, begin, end) as pair:
            for pointer in self.arrays[:2]:
                end_of_pair = build.gep(pointer, [pair], source_etype=INT)
                particle = build.load(end_of_pair, typ=INT)
                wall = build.icmp_signed(">=", particle, particles)
                update(low, "<", particle)
                update(high, ">", build.select(wall, INT(0), build.add(particle, INT(1))))
        return tuple(build.sext(build.load(place, typ=INT), LONG) for place in (low, high))

    def place(self, chunk: ir.Value, output: int) -> ir.Value:
        """Address of a chunk's sums for one output."""
        build, loop = self.build, self.loop
        before = room_for_sums(loop.outputs[:output], self.particles)
        of_chunks = build.mul(chunk, LONG(room_for_sums(loop.outputs, self.particles)))
        numbers = build.add(of_chunks, LONG(before))
        return build.gep(self.chunk_sums, [numbers], source_etype=self.number)

    def rows(self, output: int, array: ir.Value) -> list[ir.Value]:
        """Addresses of the rows of an output, in the output array or in the sums of a chunk."""
        leaf = self.loop.outputs[output]
        steps = (LONG(row * _length(leaf, self.particles)) for row in range(leaf.width))
        return [self.build.gep(array, [step], source_etype=self.number) for step in steps]

    def clear(self, output: int, begin: ir.Value, end: ir.Value) -> None:
        for row in self.rows(output, self.arrays[self.outputs + output]):
            with counted(self.build, begin, end) as index:
                place = self.build.gep(row, [index], source_etype=self.number)
                self.build.store(self.number(0.0), place)

    def add(self, output: int, chunk: ir.Value, begin: ir.Value, end: ir.Value) -> None:
        totals = self.rows(output, self.arrays[self.outputs + output])
        sums = self.rows(output, self.place(chunk, output))
        for rows in zip(totals, sums, strict=True):
            with counted(self.build, begin, end) as index:
                places = [self.build.gep(row, [index], source_etype=self.number) for row in rows]
                values = (self.build.load(place, typ=self.number) for place in places)
                self.build.store(self.build.fadd(*values, flags=FREE), places[0])
