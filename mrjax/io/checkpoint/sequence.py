"""A chain of pieces, each of which begins from the state at the end of the piece before."""

import logging
import os
import re
from collections.abc import Mapping

from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.text import in_message
from mrjax.io.checkpoint.store import Arrays, Piece, PieceStore
from mrjax.io.npz import DamagedError

LOG = logging.getLogger("mrjax")


class Sequence:
    """A chain of pieces, each of which begins from the state at the end of the piece before.

    The last two states are saved beside the pieces. Damage at the end therefore costs one piece,
    and a process may be killed at any time.
    """

    def __init__(self, store: PieceStore, name: str) -> None:
        self._store, self._name = store, name
        self._digests: list[str] = []

    def resumed(self) -> tuple[list[Arrays], Arrays | None]:
        """Reads all pieces so far, and the state after the last one.

        If the last pieces or states are damaged, missing or out of order, the chain ends before
        them; the log says so.

        Returns:
          The arrays of each piece, and the arrays of the state; an empty list and None at first.

        Raises:
          InputError: an earlier piece is damaged, and the state before it is no longer there.
        """
        states = [state for slot in (0, 1) if (state := self._state(slot)) is not None]
        states.sort(key=_count, reverse=True)
        pieces, fault = self._pieces(_count(states[0]) if states else 0)
        digests = [piece.described.digest for piece in pieces]
        for state in states:
            count = _count(state)
            if count <= len(pieces) and state.described.previous == digests[count - 1]:
                if fault:
                    LOG.warning("%s; the work goes on after %d pieces", in_message(fault), count)
                self._digests = digests[:count]
                return [piece.arrays for piece in pieces[:count]], state.arrays
        folder = self._store.folder
        if states or self._lacks_states():
            fault = fault or f"{folder}: the states of {self._name} are missing"
            raise InputError(f"{fault}; put it back, or take {folder} away to begin anew")
        self._digests = []
        return [], None

    def append(self, arrays: Mapping[str, ArrayLike], state: Mapping[str, ArrayLike]) -> None:
        """Adds a piece, and the state from which the next piece begins.

        Without an earlier call of `resumed` the first call begins a new chain.

        Args:
          arrays: arrays of the piece.
          state: arrays of the state after it.
        """
        previous = self._digests[-1] if self._digests else None
        number = len(self._digests)
        # If a power failure loses this piece, `resumed` goes on from the state before it.
        digest = self._store.write(self._piece_name(number), previous, arrays, {}, "content")
        # The state comes last, because it counts the valid pieces.
        slot = (number + 1) % 2
        self._store.write(self._state_name(slot), digest, state, {"pieces": number + 1}, "name")
        self._digests.append(digest)

    def _pieces(self, count: int) -> tuple[list[Piece], str]:
        """Reads the first `count` pieces, up to the first faulty one; returns its fault, too."""
        pieces: list[Piece] = []
        for number in range(count):
            name = self._piece_name(number)
            try:
                piece = self._store.read(name)
            except DamagedError as error:
                return pieces, str(error)
            path = self._store.path(name)
            if piece is None:
                return pieces, f"{path}: is missing"
            if piece.described.previous != (pieces[-1].described.digest if pieces else None):
                return pieces, f"{path}: does not follow the piece before it"
            pieces.append(piece)
        return pieces, ""

    def _state(self, slot: int) -> Piece | None:
        """Reads the state in slot 0 or 1; returns None if it is missing or damaged."""
        try:
            state = self._store.read(self._state_name(slot))
        except DamagedError as error:
            LOG.warning("%s; it is not used", in_message(str(error)))
            return None
        return state if state is None or _count(state) % 2 == slot else None

    def _lacks_states(self) -> bool:
        """True if there is a piece after the first one, which cannot be without a state."""
        name = re.escape(self._store.path(f"{self._name}-NUMBER").name)
        pattern = re.compile(name.replace("NUMBER", r"(\d+)"))
        folder = self._store.folder
        names = os.listdir(folder) if folder.is_dir() else []
        matches = (pattern.fullmatch(entry) for entry in names)
        return any(match is not None and int(match[1]) > 0 for match in matches)

    def _piece_name(self, number: int) -> str:
        return f"{self._name}-{number:05d}"

    def _state_name(self, slot: int) -> str:
        return f"{self._name}-state-{slot}"


def _count(state: Piece) -> int:
    """Returns the number of pieces before a state."""
    return int(state.described.metadata["pieces"])
