"""Standard output and error that may be closed, full, or a pipe whose reader went away.

A command ends where standard output cannot be written. Standard error has progress and warnings,
for which no work is given up: they are dropped, and the exit status says so in the end.
"""

import io
import os
import select
import sys
from typing import TYPE_CHECKING, TextIO

from mrjax.core.refusals import refusal

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

IN, OUT, ERR = 0, 1, 2
"""File descriptors."""


class _Raw(io.RawIOBase):
    """A file descriptor, to which nothing more is written once the system has refused it."""

    def __init__(self, descriptor: int, name: str, *, forgiving: bool) -> None:
        self.descriptor, self.name, self.forgiving = descriptor, name, forgiving
        self.refused = False

    def write(self, data: "ReadableBuffer") -> int:
        """Writes as much as the system takes; returns its length, or that of all where dropped."""
        while not self.refused:
            try:
                return os.write(self.descriptor, data)
            except BlockingIOError:  # another program has made a terminal so
                select.select([], [self.descriptor], [])
            except OSError as error:
                self.refused = True
                if not self.forgiving:
                    raise refusal(self.name, error) from error
        return memoryview(data).nbytes

    def writable(self) -> bool:
        """Always."""
        return True

    def fileno(self) -> int:
        """The file descriptor."""
        return self.descriptor

    def isatty(self) -> bool:
        """True for a terminal."""
        return os.isatty(self.descriptor)


def guard() -> None:
    """Puts guarded streams in place of Python's own, which others may have replaced already."""
    for descriptor in (IN, OUT, ERR):
        _occupy(descriptor)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _guarded(sys.stdout, _Raw(OUT, "standard output", forgiving=False))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _guarded(sys.stderr, _Raw(ERR, "standard error", forgiving=True))


def lost_messages() -> bool:
    """True if anything was dropped that standard error was to have."""
    raw = getattr(getattr(sys.stderr, "buffer", None), "raw", None)
    return isinstance(raw, _Raw) and raw.refused


def _guarded(own: TextIO | None, raw: _Raw) -> TextIO:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if own is None else own.encoding,
        errors="backslashreplace",
        line_buffering=raw.forgiving or raw.isatty(),
    )


def _occupy(descriptor: int) -> None:
    """Opens a closed descriptor on the null device: else the next file would get it.

    Whatever a library logs would be written into that file.
    """
    try:
        os.fstat(descriptor)
    except OSError:
        # What is written to it is refused, as it would be to a closed one.
        opened = os.open(os.devnull, os.O_WRONLY if descriptor == IN else os.O_RDONLY)
        if opened != descriptor:
            os.dup2(opened, descriptor)
            os.close(opened)
        os.set_inheritable(descriptor, True)
