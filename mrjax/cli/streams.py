"""Standard output and error that may be closed, full, or a pipe without a reader.

A command ends if standard output cannot be written to. Progress and warnings on standard error are
dropped if they cannot be written; the command continues, and its exit status reports the loss.
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
    """A file descriptor that drops all data after the system has refused a write."""

    def __init__(self, descriptor: int, name: str, *, forgiving: bool) -> None:
        self.descriptor, self.name, self.forgiving = descriptor, name, forgiving
        self.refused = False

    def write(self, data: "ReadableBuffer") -> int:
        """Writes data; returns the number of bytes written or dropped."""
        while not self.refused:
            try:
                return os.write(self.descriptor, data)
            except BlockingIOError:  # another program has made the terminal non-blocking
                select.select([], [self.descriptor], [])
            except OSError as error:
                self.refused = True
                if not self.forgiving:
                    raise refusal(self.name, error) from error
        return memoryview(data).nbytes

    def writable(self) -> bool:
        """Returns True."""
        return True

    def fileno(self) -> int:
        """Returns the file descriptor."""
        return self.descriptor

    def isatty(self) -> bool:
        """True for a terminal."""
        return os.isatty(self.descriptor)


def guard() -> None:
    """Replaces Python's own standard streams by guarded ones; other replacements stay."""
    for descriptor in (IN, OUT, ERR):
        _occupy(descriptor)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _guarded_stream(sys.stdout, _Raw(OUT, "standard output", forgiving=False))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _guarded_stream(sys.stderr, _Raw(ERR, "standard error", forgiving=True))


def lost_messages() -> bool:
    """True if a message for standard error was dropped."""
    raw = getattr(getattr(sys.stderr, "buffer", None), "raw", None)
    return isinstance(raw, _Raw) and raw.refused


def _guarded_stream(own: TextIO | None, raw: _Raw) -> TextIO:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if own is None else own.encoding,
        errors="backslashreplace",
        line_buffering=raw.forgiving or raw.isatty(),
    )


def _occupy(descriptor: int) -> None:
    """Opens a closed descriptor on the null device.

    Otherwise the next opened file would get the descriptor, and the log messages of libraries.
    """
    try:
        os.fstat(descriptor)
    except OSError:
        # Opened so that writing to it is refused, as for a closed descriptor.
        opened = os.open(os.devnull, os.O_WRONLY if descriptor == IN else os.O_RDONLY)
        if opened != descriptor:
            os.dup2(opened, descriptor)
            os.close(opened)
        os.set_inheritable(descriptor, True)
