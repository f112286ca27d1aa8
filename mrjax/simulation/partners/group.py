"""The connections of one process with the others: exchange of messages, signs of life, losses.

A process that dies closes its connection; one whose machine is gone falls silent.
"""

import os
import queue
import socket
import sys
import threading
import time
from contextlib import suppress

from mrjax.core.errors import SystemRefusal
from mrjax.core.text import in_message
from mrjax.simulation.partners import timing
from mrjax.simulation.partners.frames import ALIVE, BYE, DATA, LOST, MOST_BYTES, frames, send

REFUSED = 3
"""Exit status of a process that has lost another."""


class Group:
    """The processes of one computation, as connections of this process."""

    def __init__(self, number: int, count: int, sockets: dict[int, socket.socket]) -> None:
        self.number, self.count = number, count
        self.links = {other: Link(connected, other, self) for other, connected in sockets.items()}
        self.lost_reason: str | None = None
        self.reported = self.has_left = False
        self._lock = threading.Lock()
        for link in self.links.values():
            threading.Thread(target=link.receive, daemon=True).start()
        threading.Thread(target=self._beat, daemon=True).start()

    def gather(self, mine: bytes) -> list[bytes]:
        """Exchanges one message of each process; returns all, in order of number, on every process.

        Raises:
          SystemRefusal: a process is lost.
        """
        if self.number == 0:
            shares = [mine, *(self.links[other].next() for other in range(1, self.count))]
            for link in self.links.values():
                for share in shares:
                    link.send(DATA, share)
            return shares
        self.links[0].send(DATA, mine)
        return [self.links[0].next() for _ in range(self.count)]

    def leave(self) -> None:
        """Tells the others that this process has done its share."""
        self.has_left = True
        for link in self.links.values():
            link.send(BYE, b"")
        # Otherwise process 0, while busy with the others, would take this process for lost.
        if self.number:
            with suppress(queue.Empty):
                while self.links[0].arrived.get(timeout=timing.GRACE) is not None:
                    pass

    def lose(self, reason: str) -> None:
        """Ends this process, at once or after `timing.GRACE`; process 0 tells the others."""
        with self._lock:
            if self.has_left or self.lost_reason:
                return
            self.lost_reason = reason
        timer = threading.Timer(timing.GRACE, self._end)
        timer.daemon = True
        timer.start()
        for link in self.links.values():
            if self.number == 0:
                link.send(LOST, reason.encode())
        for link in self.links.values():
            link.arrived.put(None)

    def refusal(self) -> SystemRefusal:
        """The error of this process when it waits for another that is lost."""
        self.reported = True
        return SystemRefusal(
            f"{self.lost_reason or 'another process ended'}; nothing of this run is kept: start "
            "all of them again"
        )

    def _end(self) -> None:
        if not self.has_left:
            if not self.reported:
                print(f"mrjax: {in_message(str(self.refusal()))}", file=sys.stderr, flush=True)
            os._exit(REFUSED)

    def _beat(self) -> None:
        while not (self.has_left or self.lost_reason):
            for link in self.links.values():
                link.send(ALIVE, b"")
            time.sleep(timing.BEAT)


class Link:
    """The connection with one other process."""

    def __init__(self, connected: socket.socket, number: int, group: Group) -> None:
        self.socket, self.number, self.group = connected, number, group
        self.arrived: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        connected.settimeout(timing.SILENCE)

    def send(self, kind: int, content: bytes) -> None:
        """Sends a frame; `receive` finds out if the other process is gone."""
        try:
            with self._lock:
                send(self.socket, kind, content)
        except OSError:
            with suppress(OSError):
                self.socket.shutdown(socket.SHUT_RDWR)

    def next(self) -> bytes:
        """The content of the next message.

        Raises:
          SystemRefusal: the other process, or a third one, is lost.
        """
        content = self.arrived.get()
        if content is None:
            raise self.group.refusal()
        return content

    def receive(self) -> None:
        """Receives frames until the other process leaves or is lost."""
        who = f"process {self.number} of {self.group.count}"
        try:
            for kind, content in frames(self.socket, MOST_BYTES):
                if kind == DATA:
                    self.arrived.put(content)
                elif kind == BYE:
                    self.arrived.put(None)
                    return
                elif kind == LOST:
                    self.group.lose(content.decode(errors="replace"))
            raise ConnectionResetError
        except ConnectionError:
            self.group.lose(f"{who} ended before its work was done")
        except TimeoutError:
            self.group.lose(f"{who} was silent for {timing.SILENCE:.0f} s")
        except OSError as error:
            self.group.lose(f"{who} was lost ({error.strerror or error})")
