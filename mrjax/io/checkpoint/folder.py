"""Folders of checkpoints: their content, locks, and removal."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mrjax.core.errors import InputError
from mrjax.io.checkpoint.marker import (
    MARKER,
    Marker,
    is_scratch,
    marker_or_none,
    write_marker,
)

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

MOST_NAMES = 5
"""Largest number of file names in a message."""


def holds_anything(folder: Path) -> bool:
    """True if a checkpoint, or one in a folder below it, holds any piece."""
    marker = marker_or_none(folder)
    if marker is not None and marker.done:
        return False
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                if holds_anything(Path(entry.path)):
                    return True
            elif marker is not None and _is_piece(entry, marker):
                return True
    return False


def remove(folder: Path) -> list[str]:
    """Removes the pieces of a checkpoint, and the folder if nothing else is in it.

    Returns:
      Names of the remaining files, which mrjax did not make.
    """
    marker = marker_or_none(folder)
    if marker is None:
        return []
    if not marker.done:
        with suppress(OSError):  # a half removed checkpoint must not be resumed
            write_marker(folder, marker.model_copy(update={"done": True}))
    with suppress(OSError):
        clear(folder)
    if not folder.is_dir() or os.path.lexists(folder / MARKER):
        return []
    return sorted(os.listdir(folder))


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Context that locks a checkpoint for this process, if the file system has locks.

    Raises:
      InputError: another process is at work there.
    """
    with (folder / MARKER).open("rb") as marker:
        if fcntl is not None:
            try:
                fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f"{folder}: another process is at work there; wait for it, or give another "
                    "folder"
                ) from None
            except OSError:  # some file systems have no locks
                pass
        yield


def _is_piece(entry: os.DirEntry, marker: Marker) -> bool:
    """True if the entry is a piece of the work that the marker names."""
    ending = f".{tag(marker.digest)}.npz"
    return entry.is_file(follow_symlinks=False) and entry.name.endswith(ending)


def clear(folder: Path, keeping: bool = False) -> bool:
    """Removes all pieces in a folder and below it, then markers and empty folders.

    Args:
      folder: a checkpoint, or a folder in one.
      keeping: True to keep the folder itself and its marker.

    Returns:
      True if the folder held anything that mrjax made.
    """
    marker = marker_or_none(folder)
    made_by_mrjax = marker is not None
    with os.scandir(folder) as entries:
        for entry in list(entries):
            if entry.is_dir(follow_symlinks=False):
                made_by_mrjax |= clear(Path(entry.path))
            elif marker is not None and (_is_piece(entry, marker) or is_scratch(entry)):
                os.unlink(entry)
    if made_by_mrjax and not keeping:
        if marker is not None:
            (folder / MARKER).unlink()
        with suppress(OSError):  # a folder with other files stays
            folder.rmdir()
    return made_by_mrjax


def clear_scratch(folder: Path) -> None:
    """Removes scratch files that killed processes left behind."""
    with os.scandir(folder) as entries:
        for entry in list(entries):
            if is_scratch(entry):
                Path(entry).unlink(missing_ok=True)


def tag(digest: str) -> str:
    """Returns the part of a piece's file name that marks its work."""
    return digest[:12]
