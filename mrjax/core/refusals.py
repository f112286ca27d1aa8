"""Errors of the operating system in one line: the file, the reason, the remedy."""

import errno
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mrjax.core.errors import SystemRefusal
from mrjax.core.text import shortened

LONGEST_NAME = 120
"""Largest number of characters of a path in a message."""
ELSEWHERE = "give another folder, or allow to write there"
REMEDIES = {
    errno.ENOSPC: "free some space, or give a folder on another disk",
    errno.EDQUOT: "free some of your quota, or give a folder on another disk",
    errno.EFBIG: "raise the limit of file sizes (`ulimit -f`)",
    errno.EMFILE: "raise the limit of open files (`ulimit -n`)",
    errno.ENFILE: "close other programs that hold files open",
    errno.ENOMEM: "close other programs, or give a smaller problem",
    errno.EACCES: ELSEWHERE,
    errno.EPERM: ELSEWHERE,
    errno.EROFS: ELSEWHERE,
    errno.EISDIR: "take the folder of that name away, or give another folder",
    errno.EEXIST: "take the file of that name away, or give another folder",
    errno.ENOTDIR: "give another folder",
    errno.ENOENT: "give another folder",
    errno.ENAMETOOLONG: "give a shorter name",
    errno.ELOOP: "give a path without links that lead to each other",
    errno.EPIPE: "let its reader read to the end",
    errno.EBADF: "open it, or send it to /dev/null",
}
"""Remedies for errors of the operating system."""


def refusal(
    name: object, error: BaseException, failure: str = "cannot be written"
) -> SystemRefusal:
    """Returns the error to raise for a file or stream.

    Args:
      name: name of the file or stream.
      error: the exception that Python raised, an `OSError` in most cases.
      failure: words for the failed operation.
    """
    if isinstance(error, SystemRefusal):
        return error
    short_name = shortened(str(name), LONGEST_NAME)
    number = getattr(error, "errno", None)
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    remedy = f"; {REMEDIES[number]}" if number in REMEDIES else ""
    return SystemRefusal(f"{short_name}: {failure} ({reason}){remedy}")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Context that turns errors of the system, and failed programs, into a message with the file.

    Raises:
      SystemRefusal: the system raised an error, which is the cause (`__cause__`).
    """
    try:
        yield
    except (OSError, subprocess.SubprocessError) as error:
        raise refusal(path, error) from error


def in_one_line(error: BaseException) -> str | None:
    """Returns the message for an error of the system; None for any other error."""
    if isinstance(error, SystemRefusal):
        return str(error)
    if isinstance(error, OSError):
        return str(refusal(error.filename or "the operating system", error, "refused"))
    message = str(error)
    if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in message:
        reason = message.splitlines()[0][:200] if message else "no more memory"
        return f"memory: refused ({reason}); {REMEDIES[errno.ENOMEM]}"
    if isinstance(error, RuntimeError) and "can't start new thread" in message:
        return "threads: refused (too many); raise the limit of processes (`ulimit -u`)"
    return None
