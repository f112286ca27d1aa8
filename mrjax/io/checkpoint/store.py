"""Pieces of a checkpoint on disk.

A piece holds a digest of its work, its name, the piece before it and its numbers, so that no piece
is mistaken for another.
"""

import json
import stat
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.io import files, npz
from mrjax.io.checkpoint.folder import clear, clear_scratch, holds_anything, tag
from mrjax.io.checkpoint.marker import FORM, KIND, Marker, existing_marker, write_marker
from mrjax.io.checkpoint.work import sha256, work_digest
from mrjax.io.markers import Strict
from mrjax.io.npz import DamagedError

Arrays = dict[str, np.ndarray]


class PieceMetadata(Strict):
    """The metadata of a piece."""

    kind: Literal["mrjax piece"]
    work: str
    name: str
    previous: str | None
    digest: str
    metadata: dict[str, Any]


PIECE = npz.Schema("a piece of a checkpoint", PieceMetadata, None)


@dataclass(frozen=True)
class Piece:
    """The arrays and metadata of a piece."""

    arrays: Arrays
    described: PieceMetadata


@dataclass(frozen=True)
class PieceStore:
    """A folder for the pieces of one work; it is made with the first piece."""

    folder: Path
    work: dict[str, str]

    @property
    def digest(self) -> str:
        """The digest of the work."""
        return work_digest(self.work)

    def claim(self) -> None:
        """Makes the folder, with a marker that describes the work.

        Raises:
          InputError: the folder was not made by mrjax, or now holds other work.
        """
        marker = existing_marker(self.folder)
        if marker is not None and marker.work == self.work and not marker.done:
            return
        if marker is not None and not marker.done and holds_anything(self.folder):
            raise InputError(f"{self.folder}: now holds other work; give another folder")
        if marker is not None:
            clear(self.folder, keeping=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_marker(self.folder, Marker(kind=KIND, form=FORM, work=self.work, digest=self.digest))
        clear_scratch(self.folder)

    def path(self, name: str) -> Path:
        """Returns the path of a piece; no other program gives a file such a name."""
        return self.folder / f"{name}.{tag(self.digest)}.npz"

    def read(self, name: str) -> Piece | None:
        """Reads a piece of this work; returns None if there is none.

        Raises:
          DamagedError: the piece is damaged, or belongs to other work or another name.
          InputError: the path is no file, or it cannot be read.
        """
        path = self.path(name)
        if not _is_file(path):
            return None
        arrays, described = npz.read_or_damage(path, PIECE, sys.maxsize)
        if (described.work, described.name) != (self.digest, name):
            raise DamagedError(f"{path}: belongs to another piece, or to other work")
        digest = self._piece_digest(name, described.previous, arrays, described.metadata)
        if described.digest != digest:
            raise DamagedError(f"{path}: its numbers are not those that were saved")
        return Piece(arrays, described)

    def write(
        self,
        name: str,
        previous: str | None,
        arrays: Mapping[str, ArrayLike],
        metadata: Mapping[str, Any],
        durability: files.Durability,
    ) -> str:
        """Writes a piece; returns its digest.

        Args:
          name: name of the piece.
          previous: digest of the piece before it; None if there is none.
          arrays: numbers of the piece, by name.
          metadata: metadata of the piece, in types that JSON has.
          durability: as for `files.replacing`.
        """
        numbers = {key: np.asarray(array) for key, array in arrays.items()}
        extra = files.plain(dict(metadata))
        digest = self._piece_digest(name, previous, numbers, extra)
        described = PieceMetadata(
            kind="mrjax piece",
            work=self.digest,
            name=name,
            previous=previous,
            digest=digest,
            metadata=extra,
        )
        self.claim()
        path = self.path(name)
        _is_file(path)
        npz.write(path, numbers, described.model_dump(), durability)
        return digest

    def _piece_digest(
        self, name: str, previous: str | None, arrays: Arrays, metadata: dict[str, Any]
    ) -> str:
        """Returns the digest of a piece: its work, its name, the piece before it, its content."""
        bound = json.dumps([self.digest, name, previous, list(arrays), metadata], sort_keys=True)
        return sha256(bound, *arrays.values()).hexdigest()


def _is_file(path: Path) -> bool:
    """True if there is a file, False if there is nothing.

    Raises:
      InputError: there is something other than a file.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(mode):
        raise InputError(
            f"{path}: is no file, so mrjax did not write it; it is not touched: take it away"
        )
    return True
