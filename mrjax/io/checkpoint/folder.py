"""Folders of checkpoints: whether they hold anything, locks, and their removal."""

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
"""Names of files that a message shows at most."""


def holds_anything(folder: Path) -> bool:
    """True if any piece is kept in a checkpoint, or in one within it."""
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
    """Takes away the pieces of a checkpoint, and the folder if nothing else is in it.

    Returns:
      Names of files left there, which mrjax did not make.
    """
    marker = marker_or_none(folder)
    if marker is None:
        return []
    if not marker.done:
        with suppress(OSError):  # what is half removed must not be taken for a checkpoint
            write_marker(folder, marker.model_copy(update={"done": True}))
    with suppress(OSError):
        clear(folder)
    if not folder.is_dir() or os.path.lexists(folder / MARKER):
        return []
    return sorted(os.listdir(folder))


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """A checkpoint for this process alone, where the file system can say so.

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
    """True for a piece of the marker's work."""
    ending = f".{tag(marker.digest)}.npz"
    return entry.is_file(follow_symlinks=False) and entry.name.endswith(ending)


def clear(folder: Path, keeping: bool = False) -> bool:
    """Takes away all pieces in a folder and below it, then markers and folders left empty.

    Args:
      folder: a checkpoint, or a folder in one.
      keeping: whether the folder and its marker stay.

    Returns:
      True if anything that mrjax made was there.
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
        with suppress(OSError):  # what mrjax did not make stays
            folder.rmdir()
    return made_by_mrjax


def clear_scratch(folder: Path) -> None:
    """Takes away what killed processes were writing."""
    with os.scandir(folder) as entries:
        for entry in list(entries):
            if is_scratch(entry):
                Path(entry).unlink(missing_ok=True)


def tag(digest: str) -> str:
    """The part that the names of all pieces of one work have in common."""
    return digest[:12]
