"""The marker that makes a folder a checkpoint; a folder without one is never touched."""

import os
import stat
from pathlib import Path
from typing import Literal

from mrjax.core.errors import InputError
from mrjax.io import files, markers
from mrjax.io.checkpoint.work import digest_of_work
from mrjax.io.markers import ForeignError, Strict

MARKER = "mrjax-checkpoint.json"
"""Makes a folder a checkpoint, and names its work."""
OLD_MARKER = "of.json"
KIND: Literal["mrjax checkpoint"] = "mrjax checkpoint"
FORM: Literal[1] = 1


class Marker(Strict):
    """The content of a marker."""

    kind: Literal["mrjax checkpoint"]
    form: Literal[1]
    work: dict[str, str]
    digest: str
    done: bool = False  # what is left of it is to be taken away


def refuse_foreign(folder: str | Path | None) -> None:
    """Passes where a folder is a checkpoint, or where one can be begun, or for None.

    Raises:
      InputError: it is anything else; it is not touched.
    """
    if folder is not None:
        existing_marker(Path(folder))


def existing_marker(folder: Path) -> Marker | None:
    """The marker of a checkpoint; None where one can be begun.

    Raises:
      InputError: the folder is anything else; it is not touched.
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
        old, empty = (folder / OLD_MARKER).exists(), _as_good_as_empty(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); {advice}") from None
    if old:
        raise InputError(f"{folder}: is a checkpoint of an earlier version; {advice}")
    if not empty:
        raise InputError(f"{folder}: is no checkpoint that mrjax made, and not empty; {advice}")
    return None


def _read_marker(folder: Path) -> Marker | None:
    """The marker of a folder; None where there is none.

    Raises:
      InputError: mrjax did not write it, or it is damaged.
    """
    path = folder / MARKER
    try:
        marker = markers.read(path, Marker)
        if marker is not None and marker.digest != digest_of_work(marker.work):
            raise ForeignError("its digest is of other work")
        return marker
    except ForeignError as error:
        raise InputError(
            f"{path}: is no marker that mrjax wrote, or damaged ({error}); the folder is not "
            "touched: give another, or take it away"
        ) from None


def marker_or_none(folder: Path) -> Marker | None:
    """The marker of a checkpoint; None of anything else."""
    try:
        return _read_marker(folder) if stat.S_ISDIR(folder.lstat().st_mode) else None
    except (OSError, InputError):
        return None


def _as_good_as_empty(folder: Path) -> bool:
    """True if a folder without a marker holds at most what comes about on the way to one.

    Folders of checkpoints, which are made before it, and what killed processes were writing.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                within = Path(entry.path)
                if marker_or_none(within) is None and not _as_good_as_empty(within):
                    return False
            elif not is_scratch(entry):
                return False
    return True


def write_marker(folder: Path, marker: Marker) -> None:
    """Writes the marker of a checkpoint."""
    files.write_json(folder / MARKER, marker.model_dump())


def is_scratch(entry: os.DirEntry) -> bool:
    """True for what a killed process was writing."""
    return entry.is_file(follow_symlinks=False) and files.is_scratch(entry.name)
