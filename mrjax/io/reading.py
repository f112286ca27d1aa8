"""Reading of a user's files: only regular files, up to a largest size.

A pipe would wait for its writer, a device may never end, and opening a device may have an effect.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mrjax.core.errors import InputError

SPECIAL_FILES = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""Kinds of paths that are neither a file nor a directory."""


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Opens a regular file, to be read as bytes.

    Raises:
      InputError: the path is a pipe, a socket or a device.
      OSError: there is no such file, it is a directory, or the system refuses.
    """
    _refuse_special(path, os.stat(path).st_mode)
    with open(path, "rb", opener=_without_waiting) as file:
        _refuse_special(path, os.fstat(file.fileno()).st_mode)  # the file may have been replaced
        yield file


def content(path: Path, most: int) -> bytes:
    """Reads a file of at most `most` bytes.

    Raises:
      InputError: the file is larger, or no regular file.
      OSError: as for `opened`.
    """
    with opened(path) as file:
        data = file.read(most + 1) or b""  # None if the file has no data yet
    if len(data) > most:
        raise InputError(f"{path}: is larger than {most / 1e6:g} MB; check the path")
    return data


def text(path: Path, most: int) -> str:
    """Reads a file of at most `most` bytes as text in UTF-8, without a byte order mark.

    Raises:
      InputError, OSError: as for `content`.
      UnicodeDecodeError: the file is not UTF-8.
    """
    return content(path, most).decode("utf-8-sig")


def is_file(path: Path) -> bool:
    """True if a path leads to a file; False for text that the system accepts as no path."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _refuse_special(path: Path, mode: int) -> None:
    if (kind := SPECIAL_FILES.get(stat.S_IFMT(mode))) is not None:
        raise InputError(f"{path}: is {kind}, which is not read; give a file")


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
