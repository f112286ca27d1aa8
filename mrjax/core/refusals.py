"""Refusals of the operating system in one line: the file, the reason, the remedy."""

import errno
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mrjax.core.errors import SystemRefusal
from mrjax.core.text import shortened

LONGEST_NAME = 120
"""Characters of a path that a line shows."""
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
    errno.EEXIST: "take away what has that name, or give another folder",
    errno.ENOTDIR: "give another folder",
    errno.ENOENT: "give another folder",
    errno.ENAMETOOLONG: "give a shorter name",
    errno.ELOOP: "give a path without links that lead to each other",
    errno.EPIPE: "have its reader stay to the end",
    errno.EBADF: "open it, or send it to /dev/null",
}
"""Remedies for errors of the operating system."""


def refusal(name: object, error: BaseException, done: str = "cannot be written") -> SystemRefusal:
    """The refusal of one file or stream.

    Args:
      name: of the file or stream.
      error: what Python raised, an `OSError` in most cases.
      done: what could not be done with it.
    """
    if isinstance(error, SystemRefusal):
        return error
    named = shortened(str(name), LONGEST_NAME)
    number = getattr(error, "errno", None)
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    remedy = f"; {REMEDIES[number]}" if number in REMEDIES else ""
    return SystemRefusal(f"{named}: {done} ({reason}){remedy}")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Names the file where the system refuses something inside; a program that failed likewise.

    Raises:
      SystemRefusal: in place of what the system raised, which is its cause.
    """
    try:
        yield
    except (OSError, subprocess.SubprocessError) as error:
        raise refusal(path, error) from error


def in_one_line(error: BaseException) -> str | None:
    """The line for what ended a command, if the system refused something; else None."""
    if isinstance(error, SystemRefusal):
        return str(error)
    if isinstance(error, OSError):
        return str(refusal(error.filename or "the operating system", error, "refused"))
    said = str(error)
    if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in said:
        reason = said.splitlines()[0][:200] if said else "no more memory"
        return f"memory: refused ({reason}); {REMEDIES[errno.ENOMEM]}"
    if isinstance(error, RuntimeError) and "can't start new thread" in said:
        return "threads: refused (too many); raise the limit of processes (`ulimit -u`)"
    return None
