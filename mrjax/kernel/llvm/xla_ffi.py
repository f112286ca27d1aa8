"""A call of XLA's, as a function of C finds it (xla/ffi/api/c_api.h), in instructions of LLVM."""

import re
from functools import cache
from pathlib import Path

import jax
from llvmlite import ir

from .jaxpr import INT, LONG, POINTER, as_word

# Where the interface keeps what is read here, in bytes.
EXTENSION, INTERFACE, CONTEXT, ARGUMENTS, RESULTS = 8, 16, 24, 72, 112
METADATA, MAJOR, MINOR = 24, 24, 28
DATA = 24
DESTROY_ERROR, SCHEDULE, NUMBER_OF_THREADS = 64, 136, 144
MAJOR_VERSION = 0


class CallFrame:
    """The call frame of a handler: arrays, and XLA's threads."""

    def __init__(self, build: ir.IRBuilder, pointer: ir.Value):
        self.build, self.pointer = build, pointer
        # XLA first asks, by the only extension there is, for the version this was written for.
        extension = self._at(pointer, EXTENSION)
        with build.if_then(build.icmp_unsigned("!=", extension, NULL)):
            metadata = self._at(extension, METADATA)
            build.store(INT(MAJOR_VERSION), byte_offset(build, metadata, MAJOR))
            build.store(INT(_minor_version()), byte_offset(build, metadata, MINOR))
            build.ret(NULL)

    def buffers(self, arguments: int, results: int) -> list[ir.Value]:
        """Addresses of the numbers of so many arguments and results."""
        places = self._at(self.pointer, ARGUMENTS), self._at(self.pointer, RESULTS)
        return [
            self._at(self._at(place, 8 * i), DATA)
            for place, number in zip(places, (arguments, results), strict=True)
            for i in range(number)
        ]

    def threads(self) -> ir.Value:
        """Number of threads that XLA computes with; 1 where it does not say."""
        number = self.build.alloca(LONG)
        self.build.store(LONG(1), number)
        self._asked(NUMBER_OF_THREADS, number)
        return self.build.load(number, typ=LONG)

    def schedule(self, task: ir.Function, data: ir.Value) -> ir.Value:
        """Has one of XLA's threads call the task, now or later; whether it will."""
        return self._asked(SCHEDULE, task, data)

    def _asked(self, function: int, *given: ir.Value) -> ir.Value:
        """Calls the interface; whether that did without error."""
        build = self.build
        error = self._called(function, self._at(self.pointer, CONTEXT), *given)
        failed = build.icmp_unsigned("!=", error, NULL)
        with build.if_then(failed):
            self._called(DESTROY_ERROR, error)
        return build.not_(failed)

    def _called(self, function: int, *given: ir.Value) -> ir.Value:
        interface = self._at(self.pointer, INTERFACE)
        address = self.build.inttoptr(self._at(interface, function, LONG), FROM_STRUCT)
        return self.build.call(address, [self._struct(*given)])

    def _struct(self, *members: ir.Value) -> ir.Value:
        """Begins with its own size and no extension."""
        size = 8 * (2 + len(members))
        struct = self.build.alloca(LONG, size // 8)
        for place, member in enumerate((LONG(size), NULL, *members)):
            self.build.store(
                as_word(self.build, member), byte_offset(self.build, struct, 8 * place)
            )
        return struct

    def _at(self, base: ir.Value, offset: int, kind: ir.Type = POINTER) -> ir.Value:
        return self.build.load(byte_offset(self.build, base, offset), typ=kind)


NULL = ir.Constant(POINTER, None)
FROM_STRUCT = ir.FunctionType(POINTER, [POINTER]).as_pointer()


def byte_offset(build: ir.IRBuilder, base: ir.Value, offset: int) -> ir.Value:
    """So many bytes on."""
    return build.gep(base, [LONG(offset)], source_etype=ir.IntType(8))


@cache
def _minor_version() -> int:
    header = Path(jax.ffi.include_dir()) / "xla" / "ffi" / "api" / "c_api.h"
    text = header.read_text()
    version = {
        part: int(re.findall(rf"#define XLA_FFI_API_{part} (\d+)", text)[0])
        for part in ("MAJOR", "MINOR")
    }
    if version["MAJOR"] != MAJOR_VERSION:
        raise NotImplementedError(f"XLA's foreign function interface {version} is not known here")
    return version["MINOR"]
