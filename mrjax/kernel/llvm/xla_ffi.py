"""LLVM code that reads the call frame of XLA's foreign function interface (xla/ffi/api/c_api.h)."""

import re
from functools import cache
from pathlib import Path

import jax
from llvmlite import ir

from .jaxpr import INT, LONG, POINTER, as_word

# Offsets in the C structs of the interface, in bytes.
EXTENSION, INTERFACE, CONTEXT, ARGUMENTS, RESULTS = 8, 16, 24, 72, 112
METADATA, MAJOR, MINOR = 24, 24, 28
DATA = 24
DESTROY_ERROR, SCHEDULE, NUMBER_OF_THREADS = 64, 136, 144
MAJOR_VERSION = 0


class CallFrame:
    """The call frame of a handler: access to the buffers of the call and to XLA's thread pool."""

    def __init__(self, build: ir.IRBuilder, pointer: ir.Value):
        self.build, self.pointer = build, pointer
        # On registration XLA calls with a metadata extension, which asks for the API version.
        extension = self._load_at(pointer, EXTENSION)
        with build.if_then(build.icmp_unsigned("!=", extension, NULL)):
            metadata = self._load_at(extension, METADATA)
            build.store(INT(MAJOR_VERSION), byte_offset(build, metadata, MAJOR))
            build.store(INT(_minor_version()), byte_offset(build, metadata, MINOR))
            build.ret(NULL)

    def buffers(self, arguments: int, results: int) -> list[ir.Value]:
        """Addresses of the data of the arguments, then of the results.

        Args:
          arguments, results: numbers of each.
        """
        places = self._load_at(self.pointer, ARGUMENTS), self._load_at(self.pointer, RESULTS)
        return [
            self._load_at(self._load_at(place, 8 * i), DATA)
            for place, number in zip(places, (arguments, results), strict=True)
            for i in range(number)
        ]

    def threads(self) -> ir.Value:
        """Number of threads in XLA's pool; 1 if XLA does not report it."""
        number = self.build.alloca(LONG)
        self.build.store(LONG(1), number)
        self._succeeds(NUMBER_OF_THREADS, number)
        return self.build.load(number, typ=LONG)

    def schedule(self, task: ir.Function, data: ir.Value) -> ir.Value:
        """Asks XLA's thread pool to call the task, now or later; true if the pool accepts."""
        return self._succeeds(SCHEDULE, task, data)

    def _succeeds(self, function: int, *members: ir.Value) -> ir.Value:
        """Calls a function of the interface; true if it succeeds."""
        build = self.build
        error = self._call(function, self._load_at(self.pointer, CONTEXT), *members)
        failed = build.icmp_unsigned("!=", error, NULL)
        with build.if_then(failed):
            self._call(DESTROY_ERROR, error)
        return build.not_(failed)

    def _call(self, function: int, *members: ir.Value) -> ir.Value:
        interface = self._load_at(self.pointer, INTERFACE)
        address = self.build.inttoptr(self._load_at(interface, function, LONG), FROM_STRUCT)
        return self.build.call(address, [self._struct(*members)])

    def _struct(self, *members: ir.Value) -> ir.Value:
        """Allocates an argument struct: its own size, a null extension, then the members."""
        size = 8 * (2 + len(members))
        struct = self.build.alloca(LONG, size // 8)
        for place, member in enumerate((LONG(size), NULL, *members)):
            self.build.store(
                as_word(self.build, member), byte_offset(self.build, struct, 8 * place)
            )
        return struct

    def _load_at(self, base: ir.Value, offset: int, kind: ir.Type = POINTER) -> ir.Value:
        return self.build.load(byte_offset(self.build, base, offset), typ=kind)


NULL = ir.Constant(POINTER, None)
FROM_STRUCT = ir.FunctionType(POINTER, [POINTER]).as_pointer()


def byte_offset(build: ir.IRBuilder, base: ir.Value, offset: int) -> ir.Value:
    """Address at `offset` bytes after `base`."""
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
