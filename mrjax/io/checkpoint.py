"""Long work kept on disk piece by piece, so that a run that was killed goes on from there.

What is kept is what each piece gave. Work that is resumed takes the same decisions from the same
numbers again, and so ends with the same bits as work that nothing stopped.

A folder is a checkpoint where it holds a marker of ours, and is not touched elsewhere. A piece is
named after its work, and holds a digest of that, of its own place, of the piece before it and of
its numbers.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import logging
import os
import re
import stat
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

import jax
import numpy as np
from jax.typing import ArrayLike
from pydantic import BaseModel

from mrjax.core.errors import InputError
from mrjax.core.text import in_message
from mrjax.io import files, markers, npz
from mrjax.io.identity import identity
from mrjax.io.machine import machine
from mrjax.io.markers import ForeignError, Strict
from mrjax.io.npz import DamagedError

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

MARKER = "mrjax-checkpoint.json"
"""Makes a folder a checkpoint, and says of what work."""
OLD_MARKER = "of.json"
KIND: Literal["mrjax checkpoint"] = "mrjax checkpoint"
FORM: Literal[1] = 1
PACKAGES = ("mrjax", "jax", "jaxlib", "llvmlite", "numpy", "scipy")
"""Those on whose versions digits hang."""
LISTED = 5
"""Names that a message shows at most."""

LOG = logging.getLogger("mrjax")

Arrays = dict[str, np.ndarray]


class _Marker(Strict):
    """What the marker says."""

    kind: Literal["mrjax checkpoint"]
    form: Literal[1]
    work: dict[str, str]
    digest: str
    done: bool = False  # what is left of it is to be taken away


class _Told(Strict):
    """What a piece says of itself."""

    kind: Literal["mrjax piece"]
    work: str
    name: str
    previous: str | None
    digest: str
    metadata: dict[str, Any]


PIECE = npz.Schema("a piece of a checkpoint", _Told, None)


@dataclasses.dataclass(frozen=True)
class _Piece:
    """A piece as it was read."""

    arrays: Arrays
    told: _Told


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    """A folder of pieces of one piece of work, made with the first of them."""

    folder: Path
    work: dict[str, str]

    @classmethod
    def of_work(cls, folder: Path, **work: Any) -> "Checkpoint":
        """The one in a folder, or one to be begun there.

        Args:
          folder: need not be there yet, or is empty, or a checkpoint.
          work: all that decides what the work gives, by name.

        Raises:
          InputError: the folder is not a checkpoint, or keeps other work; the message says what
            differs.
        """
        here = {**dict(_told("", work)), **_environment()}
        marker = _opened(folder)
        if marker is None or marker.done:
            return cls(folder, here)
        if marker.work == here:
            _clear_scratch(folder)
            return cls(folder, here)
        for name in {**here, **marker.work} if holds_anything(folder) else ():
            if here.get(name) != marker.work.get(name):
                raise InputError(
                    f"{folder}: keeps other work, with {name} = "
                    f"{marker.work.get(name, 'not given')} where it is "
                    f"{here.get(name, 'not given')} here; give what it began with, or take it away "
                    "to begin anew"
                )
        return cls(folder, here)

    @property
    def digest(self) -> str:
        """Of the work."""
        return _digest_of_work(self.work)

    def claim(self) -> None:
        """Makes the folder, and says there what it is of.

        Raises:
          InputError: it is not ours, or not any more.
        """
        marker = _opened(self.folder)
        if marker is not None and marker.work == self.work and not marker.done:
            return
        if marker is not None and not marker.done and holds_anything(self.folder):
            raise InputError(f"{self.folder}: keeps other work by now; give another folder")
        if marker is not None:
            _clear(self.folder, keeping=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        _mark(self.folder, _Marker(kind=KIND, form=FORM, work=self.work, digest=self.digest))
        _clear_scratch(self.folder)

    def kept(self, name: str) -> tuple[Arrays, dict[str, Any]] | None:
        """Arrays and metadata of a piece that hangs on no other; None where it is to be done.

        One that is damaged, or of another place or work, is to be done again; the log says so.
        """
        try:
            piece = self._read(name)
        except DamagedError as error:
            LOG.warning("%s; it is computed again", in_message(str(error)))
            return None
        return None if piece is None else (piece.arrays, piece.told.metadata)

    def keep(
        self, name: str, arrays: Mapping[str, ArrayLike], metadata: Mapping[str, Any] | None = None
    ) -> None:
        """Keeps a piece that hangs on no other, in place of what went by that name."""
        # There may be hundreds in a second; one that is lost with the power is done again.
        self._write(name, None, arrays, metadata or {}, "nothing")

    def sequence(self, name: str) -> "Sequence":
        """Pieces that hang on each other, one after the other."""
        return Sequence(self, name)

    def _path(self, name: str) -> Path:
        """Of a piece: no other program gives a file this name."""
        return self.folder / f"{name}.{_tag(self.digest)}.npz"

    def _read(self, name: str) -> _Piece | None:
        """A piece, known to be of this place of this work and whole; None where there is none.

        Raises:
          DamagedError: it is not.
          InputError: there is something other than a file, or it cannot be read.
        """
        path = self._path(name)
        if not _is_file(path):
            return None
        arrays, told = npz.examined(path, PIECE, sys.maxsize)
        if (told.work, told.name) != (self.digest, name):
            raise DamagedError(f"{path}: is of another place, or of other work")
        if told.digest != self._digest(name, told.previous, arrays, told.metadata):
            raise DamagedError(f"{path}: its numbers are not those that were kept")
        return _Piece(arrays, told)

    def _write(
        self,
        name: str,
        previous: str | None,
        arrays: Mapping[str, ArrayLike],
        metadata: Mapping[str, Any],
        lasting: files.Lasting,
    ) -> str:
        """Keeps a piece; its digest."""
        numbers = {key: np.asarray(array) for key, array in arrays.items()}
        extra = files.plain(dict(metadata))
        found = self._digest(name, previous, numbers, extra)
        told = _Told(
            kind="mrjax piece",
            work=self.digest,
            name=name,
            previous=previous,
            digest=found,
            metadata=extra,
        )
        self.claim()
        path = self._path(name)
        _is_file(path)
        npz.write(path, numbers, told.model_dump(), lasting)
        return found

    def _digest(
        self, name: str, previous: str | None, arrays: Arrays, metadata: dict[str, Any]
    ) -> str:
        """Of a piece: its work, its place, what is before it, and what it holds."""
        bound = json.dumps([self.digest, name, previous, list(arrays), metadata], sort_keys=True)
        return _sha256(bound, *arrays.values()).hexdigest()


class Sequence:
    """Pieces each of which begins where the one before ended.

    Beside them lie the last state and the one before that: what is damaged at the end costs a
    piece, and a process may be killed at any byte.
    """

    def __init__(self, checkpoint: Checkpoint, name: str) -> None:
        self._checkpoint, self._name = checkpoint, name
        self._digests: list[str] = []

    def resumed(self) -> tuple[list[Arrays], Arrays | None]:
        """The arrays of all pieces so far, and of the state after the last; none and None at first.

        Where the last pieces or states are damaged, missing or of another place, those before them;
        the log says so.

        Raises:
          InputError: a piece in the middle is so: the state after the one before it is not kept.
        """
        states = [state for place in (0, 1) if (state := self._state(place)) is not None]
        states.sort(key=_count, reverse=True)
        pieces, fault = self._pieces(_count(states[0]) if states else 0)
        digests = [piece.told.digest for piece in pieces]
        for state in states:
            count = _count(state)
            if count <= len(pieces) and state.told.previous == digests[count - 1]:
                if fault:
                    LOG.warning("%s; the work goes on after %d pieces", in_message(fault), count)
                self._digests = digests[:count]
                return [piece.arrays for piece in pieces[:count]], state.arrays
        if states or self._later_than_first():
            fault = fault or f"{self._checkpoint.folder}: the states of {self._name} are missing"
            raise InputError(
                f"{fault}; put it back, or take {self._checkpoint.folder} away to begin anew"
            )
        self._digests = []
        return [], None

    def append(self, arrays: Mapping[str, ArrayLike], state: Mapping[str, ArrayLike]) -> None:
        """Adds a piece, and the state from which the next begins.

        The first call, where `resumed` did not come before it, begins anew.

        Args:
          arrays: of the piece.
          state: arrays from which the work goes on.
        """
        previous = self._digests[-1] if self._digests else None
        number = len(self._digests)
        # Lost with the power, it is found missing, and the state before it is still there.
        name = self._piece_name(number)
        found = self._checkpoint._write(name, previous, arrays, {}, "content")
        # Last: it says which pieces count.
        place = (number + 1) % 2
        self._checkpoint._write(
            self._state_name(place), found, state, {"pieces": number + 1}, "name"
        )
        self._digests.append(found)

    def _pieces(self, count: int) -> tuple[list[_Piece], str]:
        """So many pieces, or those before the first that is not right, and what is wrong."""
        pieces: list[_Piece] = []
        for number in range(count):
            name = self._piece_name(number)
            try:
                piece = self._checkpoint._read(name)
            except DamagedError as error:
                return pieces, str(error)
            path = self._checkpoint._path(name)
            if piece is None:
                return pieces, f"{path}: is missing"
            if piece.told.previous != (pieces[-1].told.digest if pieces else None):
                return pieces, f"{path}: does not follow the piece before it"
            pieces.append(piece)
        return pieces, ""

    def _state(self, place: int) -> _Piece | None:
        """One of the two last states; None where it is not there, or damaged."""
        try:
            state = self._checkpoint._read(self._state_name(place))
        except DamagedError as error:
            LOG.warning("%s; it is not used", in_message(str(error)))
            return None
        return state if state is None or _count(state) % 2 == place else None

    def _later_than_first(self) -> bool:
        """Whether any piece but the first is there: one that was kept without its state."""
        name = re.escape(self._checkpoint._path(f"{self._name}-NUMBER").name)
        wanted = re.compile(name.replace("NUMBER", r"(\d+)"))
        names = os.listdir(self._checkpoint.folder) if self._checkpoint.folder.is_dir() else []
        return any((found := wanted.fullmatch(one)) and int(found[1]) > 0 for one in names)

    def _piece_name(self, number: int) -> str:
        return f"{self._name}-{number:05d}"

    def _state_name(self, place: int) -> str:
        return f"{self._name}-state-{place}"


def _count(state: _Piece) -> int:
    """Of the pieces before a state."""
    return int(state.told.metadata["pieces"])


def refuse_foreign(folder: str | Path | None) -> None:
    """Passes where a folder is a checkpoint, or where one can be begun, or for None.

    Raises:
      InputError: it is anything else; it is not touched.
    """
    if folder is not None:
        _opened(Path(folder))


def _opened(folder: Path) -> _Marker | None:
    """The marker of a checkpoint; None where one can be begun. Raises as `refuse_foreign`."""
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
        if (marker := _marker(folder)) is not None:
            return marker
        old, ours = (folder / OLD_MARKER).exists(), _only_ours(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); {advice}") from None
    if old:
        raise InputError(f"{folder}: is a checkpoint of an earlier version; {advice}")
    if not ours:
        raise InputError(f"{folder}: is no checkpoint that mrjax made, and not empty; {advice}")
    return None


def holds_anything(folder: Path) -> bool:
    """Whether any piece is kept in a checkpoint, or in one within it."""
    marker = _marker_or_none(folder)
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
    """Takes away what was kept in a checkpoint, and the folder if nothing else is in it.

    Returns:
      Names of what is left there, which mrjax did not make.
    """
    marker = _marker_or_none(folder)
    if marker is None:
        return []
    if not marker.done:
        with suppress(OSError):  # what is half removed must not be taken for a checkpoint
            _mark(folder, marker.model_copy(update={"done": True}))
    with suppress(OSError):
        _clear(folder)
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


def digest(*arrays: ArrayLike) -> str:
    """A name for numbers, to the last bit."""
    return _sha256("", *map(np.asarray, arrays)).hexdigest()[:16]


def _sha256(text: str, *arrays: np.ndarray) -> Any:
    found = hashlib.sha256(text.encode())
    for array in arrays:
        found.update(f"{array.dtype}{array.shape}".encode())
        found.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    return found


def _digest_of_work(work: dict[str, str]) -> str:
    return _sha256(json.dumps(work, sort_keys=True)).hexdigest()


def _tag(digest: str) -> str:
    """What the names of the pieces of one work have in common."""
    return digest[:12]


def _marker(folder: Path) -> _Marker | None:
    """What a folder's marker says; None where there is none.

    Raises:
      InputError: it is none of ours, or damaged.
    """
    path = folder / MARKER
    try:
        marker = markers.read(path, _Marker)
        if marker is not None and marker.digest != _digest_of_work(marker.work):
            raise ForeignError("its digest is of other work")
        return marker
    except ForeignError as error:
        raise InputError(
            f"{path}: is no marker that mrjax wrote, or damaged ({error}); the folder is not "
            "touched: give another, or take it away"
        ) from None


def _marker_or_none(folder: Path) -> _Marker | None:
    """What a folder's marker says, if it is a folder, and one of ours."""
    try:
        return _marker(folder) if stat.S_ISDIR(folder.lstat().st_mode) else None
    except (OSError, InputError):
        return None


def _only_ours(folder: Path) -> bool:
    """Whether a folder without a marker holds at most what comes about on the way to one.

    Folders of checkpoints, which are made before it, and what killed processes were writing.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                within = Path(entry.path)
                if _marker_or_none(within) is None and not _only_ours(within):
                    return False
            elif not _is_scratch(entry):
                return False
    return True


def _mark(folder: Path, marker: _Marker) -> None:
    files.write_json(folder / MARKER, marker.model_dump())


def _is_file(path: Path) -> bool:
    """Whether a file is there.

    Raises:
      InputError: something else is.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: is no file, so not of mrjax; it is not touched: take it away")
    return True


def _is_piece(entry: os.DirEntry, marker: _Marker) -> bool:
    ending = f".{_tag(marker.digest)}.npz"
    return entry.is_file(follow_symlinks=False) and entry.name.endswith(ending)


def _clear(folder: Path, keeping: bool = False) -> bool:
    """Takes away all pieces in a folder and below it, then markers and folders left empty.

    Args:
      folder: a checkpoint, or a folder in one.
      keeping: whether the folder and its marker stay.

    Returns:
      Whether anything of ours was there.
    """
    marker = _marker_or_none(folder)
    ours = marker is not None
    with os.scandir(folder) as entries:
        for entry in list(entries):
            if entry.is_dir(follow_symlinks=False):
                ours |= _clear(Path(entry.path))
            elif marker is not None and (_is_piece(entry, marker) or _is_scratch(entry)):
                os.unlink(entry)
    if ours and not keeping:
        if marker is not None:
            (folder / MARKER).unlink()
        with suppress(OSError):  # what mrjax did not make stays
            folder.rmdir()
    return ours


def _clear_scratch(folder: Path) -> None:
    """Takes away what killed processes were writing."""
    with os.scandir(folder) as entries:
        for entry in list(entries):
            if _is_scratch(entry):
                Path(entry).unlink(missing_ok=True)


def _is_scratch(entry: os.DirEntry) -> bool:
    return entry.is_file(follow_symlinks=False) and files.is_scratch(entry.name)


def _environment() -> dict[str, str]:
    """On what else the last digits hang."""
    versions = {f"version of {name}": importlib.metadata.version(name) for name in PACKAGES}
    return versions | {"machine": machine(), "device": jax.default_backend()}


def _told(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """All that a value consists of, by name, as text; arrays by a digest."""
    if isinstance(value, jax.tree_util.Partial):
        value = {"law": identity(value.func), "arguments": value.args, **value.keywords}
    elif isinstance(value, BaseModel):
        value = dict(value)
    elif dataclasses.is_dataclass(value):
        value = {one.name: getattr(value, one.name) for one in dataclasses.fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, list | tuple):
        value = {str(place): one for place, one in enumerate(value)}
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _told(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, str | bool | int | float) or value is None:
        yield name, str(value)
    elif np.ndim(value):
        yield name, f"array {digest(value)}"
    else:
        yield name, str(np.asarray(value).item())
