"""A checkpoint: what each piece of long work gave, kept so that the work can go on.

Work that is resumed takes the same decisions from the same numbers again, and so ends with the same
bits as work that nothing stopped.
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
    """A folder of pieces of one piece of work, made with the first of them."""

    @classmethod
    def of_work(cls, folder: Path, **work: Any) -> "Checkpoint":
        """The checkpoint in a folder, or one to be begun there.

        Args:
          folder: need not be there yet, or is empty, or a checkpoint.
          work: all that decides the results of the work, by name.

        Raises:
          InputError: the folder is not a checkpoint, or keeps other work; the message says what
            differs.
        """
        here = description.described(work)
        marker = existing_marker(folder)
        if marker is None or marker.done:
            return cls(folder, here)
        if marker.work == here:
            clear_scratch(folder)
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

    def load(self, name: str) -> tuple[Arrays, dict[str, Any]] | None:
        """Arrays and metadata of a piece outside any sequence; None where it is to be computed.

        One that is damaged, or of another place or work, is to be computed again; the log says so.
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
        """Keeps a piece outside any sequence, in place of an earlier one of that name."""
        # There may be hundreds in a second; one that is lost with the power is computed again.
        self.write(name, None, arrays, metadata or {}, "nothing")

    def sequence(self, name: str) -> Sequence:
        """Pieces that depend on each other, one after the other."""
        return Sequence(self, name)
