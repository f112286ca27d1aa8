"""A checkpoint: the results of each piece of long work, saved so that the work can be resumed.

Resumed work takes the same decisions from the same numbers, and so ends with the same bits as work
that was not interrupted.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.text import in_message
from mrjax.io.checkpoint import work as description
from mrjax.io.checkpoint.folder import clear_scratch, holds_anything
from mrjax.io.checkpoint.marker import existing_marker
from mrjax.io.checkpoint.sequence import Sequence
from mrjax.io.checkpoint.store import Arrays, PieceStore
from mrjax.io.npz import DamagedError

LOG = logging.getLogger("mrjax")


@dataclass(frozen=True)
class Checkpoint(PieceStore):
    """A folder with the pieces of one work; it is made with the first piece."""

    @classmethod
    def open(cls, folder: Path, **work: Any) -> "Checkpoint":
        """Opens the checkpoint in a folder, or prepares a new one.

        Args:
          folder: a checkpoint, an empty folder, or a path without a folder.
          work: everything that the results of the work depend on, by name.

        Raises:
          InputError: the folder is not a checkpoint, or holds other work; the message says what
            differs.
        """
        current = description.describe(work)
        marker = existing_marker(folder)
        if marker is None or marker.done:
            return cls(folder, current)
        if marker.work == current:
            clear_scratch(folder)
            return cls(folder, current)
        for name in {**current, **marker.work} if holds_anything(folder) else ():
            if current.get(name) != marker.work.get(name):
                raise InputError(
                    f"{folder}: holds other work, with {name} = "
                    f"{marker.work.get(name, 'not given')} there and "
                    f"{current.get(name, 'not given')} here; give the values that it began with, "
                    "or take it away to begin anew"
                )
        return cls(folder, current)

    def load(self, name: str) -> tuple[Arrays, dict[str, Any]] | None:
        """Reads the arrays and metadata of a piece outside any sequence.

        Returns:
          None if the piece has to be computed: it is missing, damaged, or belongs to other work or
          another name. A damaged piece is logged.
        """
        try:
            piece = self.read(name)
        except DamagedError as error:
            LOG.warning("%s; it is computed again", in_message(str(error)))
            return None
        return None if piece is None else (piece.arrays, piece.described.metadata)

    def save(
        self, name: str, arrays: Mapping[str, ArrayLike], metadata: Mapping[str, Any] | None = None
    ) -> None:
        """Saves a piece outside any sequence, in place of an earlier one of that name."""
        # There may be hundreds in a second; one lost in a power failure is computed again.
        self.write(name, None, arrays, metadata or {}, "nothing")

    def sequence(self, name: str) -> Sequence:
        """Returns the chain of pieces of this name, each of which continues the piece before."""
        return Sequence(self, name)
