"""The marker file that makes a folder a checkpoint; a folder without one is never changed."""

import os
import stat
from pathlib import Path
from typing import Literal

from mrjax.core.errors import InputError
from mrjax.io import files, markers
from mrjax.io.checkpoint.work import work_digest
from mrjax.io.markers import ForeignError, Strict

MARKER = "mrjax-checkpoint.json"
"""Name of the marker file, which describes the work of the checkpoint."""
OLD_MARKER = "of.json"
KIND: Literal["mrjax checkpoint"] = "mrjax checkpoint"
FORM: Literal[1] = 1


class Marker(Strict):
    """The content of a marker file."""

    kind: Literal["mrjax checkpoint"]
    form: Literal[1]
    work: dict[str, str]
    digest: str
    done: bool = False  # True once its removal has begun


def refuse_foreign(folder: str | Path | None) -> None:
    """Refuses a folder that is neither a checkpoint nor a place for a new one; None passes.

    Raises:
      InputError: the folder is anything else; it is not changed.
    """
    if folder is not None:
        existing_marker(Path(folder))


def existing_marker(folder: Path) -> Marker | None:
    """Reads the marker of a checkpoint; returns None if a new checkpoint can begin there.

    Raises:
      InputError: the folder is anything else; it is not changed.
    """
    advice = "it is not touched: give another, or take it away"
    try:
        mode = folder.lstat().st_mode
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"{folder}: cannot be looked at ({error.strerror}); {advice}") from None
    if not stat.S_ISDIR(mode):
        kind = "a link" if stat.S_ISLNK(mode) else "no folder"
        raise InputError(f"{folder}: is {kind}, and no checkpoint that mrjax made; {advice}")
    try:
        if (marker := _read_marker(folder)) is not None:
            return marker
        old, empty = (folder / OLD_MARKER).exists(), _holds_only_scratch(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); {advice}") from None
    if old:
        raise InputError(f"{folder}: is a checkpoint of an earlier version; {advice}")
    if not empty:
        raise InputError(f"{folder}: is no checkpoint that mrjax made, and not empty; {advice}")
    return None


def _read_marker(folder: Path) -> Marker | None:
    """Reads the marker of a folder; returns None if there is none.

    Raises:
      InputError: mrjax did not write the marker, or it is damaged.
    """
    path = folder / MARKER
    try:
        marker = markers.read(path, Marker)
        if marker is not None and marker.digest != work_digest(marker.work):
            raise ForeignError("its digest is of other work")
        return marker
    except ForeignError as error:
        raise InputError(
            f"{path}: is not a marker that mrjax wrote, or is damaged ({error}); the folder is "
            "not touched: give another, or take it away"
        ) from None


def marker_or_none(folder: Path) -> Marker | None:
    """Reads the marker of a checkpoint; returns None for any other folder or file."""
    try:
        return _read_marker(folder) if stat.S_ISDIR(folder.lstat().st_mode) else None
    except (OSError, InputError):
        return None


def _holds_only_scratch(folder: Path) -> bool:
    """True if a folder without a marker holds at most the beginnings of a checkpoint.

    These are scratch files of killed processes, and folders of checkpoints within it, which are
    made before its own marker.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                subfolder = Path(entry.path)
                if marker_or_none(subfolder) is None and not _holds_only_scratch(subfolder):
                    return False
            elif not is_scratch(entry):
                return False
    return True


def write_marker(folder: Path, marker: Marker) -> None:
    """Writes the marker file of a checkpoint."""
    files.write_json(folder / MARKER, marker.model_dump())


def is_scratch(entry: os.DirEntry) -> bool:
    """True if the entry is a scratch file of a killed process."""
    return entry.is_file(follow_symlinks=False) and files.is_scratch(entry.name)
