"""Frames on a connection: a letter for the kind, the length, and the content."""

import socket
import struct
from collections.abc import Iterator

HELLO_BYTES = 1000
"""Greatest length of a frame from a process that is not admitted yet."""
MOST_BYTES = 2**36
"""Greatest length of a frame."""
BLOCK = 2**20
HELLO, WELCOME, NO, DATA, ALIVE, BYE, LOST = b"HWNDABL"
"""Kinds of frames."""
FRAME = struct.Struct("!BQ")


def send(connected: socket.socket, kind: int, content: bytes) -> None:
    """Sends one frame, in blocks that each have the socket's time limit."""
    connected.sendall(FRAME.pack(kind, len(content)))
    for offset in range(0, len(content), BLOCK):
        connected.sendall(content[offset : offset + BLOCK])


def frames(connected: socket.socket, most: int) -> Iterator[tuple[int, bytes]]:
    """Yields kind and content of each frame, until the other process closes the connection.

    Raises:
      OSError: the other process is lost, silent for too long, or sends a frame of more than `most`
        bytes.
    """
    while head := _received(connected, FRAME.size):
        if len(head) < FRAME.size:
            return
        kind, length = FRAME.unpack(head)
        if length > most:
            raise OSError("sent what is no frame")
        content = _received(connected, length)
        if len(content) < length:
            return
        yield kind, content


def _received(connected: socket.socket, length: int) -> bytes:
    """The next `length` bytes, or fewer if the other process has closed the connection."""
    blocks, missing = [], length
    while missing and (block := connected.recv(min(missing, BLOCK))):
        blocks.append(block)
        missing -= len(block)
    return b"".join(blocks)
