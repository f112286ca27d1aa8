"""Pieces on disk: each is bound to its work, its place in it, its neighbour and its numbers.

A piece holds a digest of all four, so that none is taken for another.
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
from mrjax.io.checkpoint.work import digest_of_work, sha256
from mrjax.io.markers import Strict
from mrjax.io.npz import DamagedError

Arrays = dict[str, np.ndarray]


class PieceMetadata(Strict):
    """The description in a piece of itself."""

    kind: Literal["mrjax piece"]
    work: str
    name: str
    previous: str | None
    digest: str
    metadata: dict[str, Any]


PIECE = npz.Schema("a piece of a checkpoint", PieceMetadata, None)


@dataclass(frozen=True)
class Piece:
    """A piece as it was read."""

    arrays: Arrays
    described: PieceMetadata


@dataclass(frozen=True)
class PieceStore:
    """A folder for the pieces of one work, made with the first of them."""

    folder: Path
    work: dict[str, str]

    @property
    def digest(self) -> str:
        """The digest of the work."""
        return digest_of_work(self.work)

    def claim(self) -> None:
        """Makes the folder, with a marker that describes the work.

        Raises:
          InputError: it is not ours, or not any more.
        """
        marker = existing_marker(self.folder)
        if marker is not None and marker.work == self.work and not marker.done:
            return
        if marker is not None and not marker.done and holds_anything(self.folder):
            raise InputError(f"{self.folder}: keeps other work by now; give another folder")
        if marker is not None:
            clear(self.folder, keeping=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_marker(self.folder, Marker(kind=KIND, form=FORM, work=self.work, digest=self.digest))
        clear_scratch(self.folder)

    def path(self, name: str) -> Path:
        """The path of a piece: no other program gives a file this name."""
        return self.folder / f"{name}.{tag(self.digest)}.npz"

    def read(self, name: str) -> Piece | None:
        """A piece that belongs to this place of this work and is whole; None if there is none.

        Raises:
          DamagedError: it does not, or is not.
          InputError: there is something other than a file, or it cannot be read.
        """
        path = self.path(name)
        if not _is_file(path):
            return None
        arrays, described = npz.examined(path, PIECE, sys.maxsize)
        if (described.work, described.name) != (self.digest, name):
            raise DamagedError(f"{path}: is of another place, or of other work")
        digest = self._digest_of_piece(name, described.previous, arrays, described.metadata)
        if described.digest != digest:
            raise DamagedError(f"{path}: its numbers are not those that were kept")
        return Piece(arrays, described)

    def write(
        self,
        name: str,
        previous: str | None,
        arrays: Mapping[str, ArrayLike],
        metadata: Mapping[str, Any],
        lasting: files.Lasting,
    ) -> str:
        """Writes a piece; returns its digest.

        Args:
          name: of its place.
          previous: digest of the piece before it, None without one.
          arrays: its numbers.
          metadata: what JSON takes.
          lasting: as for `files.replacing`.
        """
        numbers = {key: np.asarray(array) for key, array in arrays.items()}
        extra = files.plain(dict(metadata))
        digest = self._digest_of_piece(name, previous, numbers, extra)
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
        npz.write(path, numbers, described.model_dump(), lasting)
        return digest

    def _digest_of_piece(
        self, name: str, previous: str | None, arrays: Arrays, metadata: dict[str, Any]
    ) -> str:
        """The digest of a piece: its work, its place, the piece before it, and its content."""
        bound = json.dumps([self.digest, name, previous, list(arrays), metadata], sort_keys=True)
        return sha256(bound, *arrays.values()).hexdigest()


def _is_file(path: Path) -> bool:
    """True if a file is there, False if nothing is.

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
