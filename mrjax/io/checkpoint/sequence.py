"""A chain of pieces, each of which begins where the one before ended."""

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
    """Pieces each of which begins where the one before ended.

    Beside them lie the last state and the one before that: damage at the end costs one piece, and a
    process may be killed at any byte.
    """

    def __init__(self, store: PieceStore, name: str) -> None:
        self._store, self._name = store, name
        self._digests: list[str] = []

    def resumed(self) -> tuple[list[Arrays], Arrays | None]:
        """The arrays of all pieces so far, and the state after the last; none and None at first.

        Where the last pieces or states are damaged, missing or of another place, those before them;
        the log says so.

        Raises:
          InputError: a piece in the middle is so: the state after the one before it is not kept.
        """
        states = [state for place in (0, 1) if (state := self._state(place)) is not None]
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
        """Adds a piece, and the state from which the next begins.

        The first call, where `resumed` did not come before it, begins anew.

        Args:
          arrays: of the piece.
          state: arrays from which the work goes on.
        """
        previous = self._digests[-1] if self._digests else None
        number = len(self._digests)
        # Lost with the power, it is found missing, and the state before it is still there.
        digest = self._store.write(self._piece_name(number), previous, arrays, {}, "content")
        # Last: it says which pieces count.
        place = (number + 1) % 2
        self._store.write(self._state_name(place), digest, state, {"pieces": number + 1}, "name")
        self._digests.append(digest)

    def _pieces(self, count: int) -> tuple[list[Piece], str]:
        """The first `count` pieces, or those before the first faulty one, and its fault."""
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

    def _state(self, place: int) -> Piece | None:
        """The last state or the one before it; None where it is not there, or damaged."""
        try:
            state = self._store.read(self._state_name(place))
        except DamagedError as error:
            LOG.warning("%s; it is not used", in_message(str(error)))
            return None
        return state if state is None or _count(state) % 2 == place else None

    def _lacks_states(self) -> bool:
        """True if any piece but the first is there, without states: none was written so."""
        name = re.escape(self._store.path(f"{self._name}-NUMBER").name)
        pattern = re.compile(name.replace("NUMBER", r"(\d+)"))
        folder = self._store.folder
        names = os.listdir(folder) if folder.is_dir() else []
        matches = (pattern.fullmatch(entry) for entry in names)
        return any(match is not None and int(match[1]) > 0 for match in matches)

    def _piece_name(self, number: int) -> str:
        return f"{self._name}-{number:05d}"

    def _state_name(self, place: int) -> str:
        return f"{self._name}-state-{place}"


def _count(state: Piece) -> int:
    """The number of pieces before a state."""
    return int(state.described.metadata["pieces"])
