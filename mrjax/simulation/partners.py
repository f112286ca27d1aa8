"""Processes that compute together: each connected to the first, none left waiting for a dead one.

Frames go both ways: a letter for the kind, the length, and the content. All send a sign of life now
and then. A process that dies closes its connection; one whose machine is gone falls silent.
"""

import json
import os
import queue
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import version

from mrjax.core.errors import InputError, SystemRefusal
from mrjax.core.text import in_message

PATIENCE = 300.0
"""How long processes wait for each other to come, s."""
SILENCE = 60.0
"""After which one that sent nothing counts as dead, s."""
BEAT = 10.0
"""Between signs of life, s."""
GRACE = 10.0
"""In which a process ends by itself that has lost another, s."""
HELLO_BYTES = 1000
MOST_BYTES = 2**36
"""Of a frame."""
BLOCK = 2**20
REFUSED = 3
"""Exit status of a process that has lost another."""
HELLO, WELCOME, NO, DATA, ALIVE, BYE, LOST = b"HWNDABL"
FRAME = struct.Struct("!BQ")


class Group:
    """The processes of one computation, as this one sees them."""

    def __init__(self, number: int, count: int, sockets: dict[int, socket.socket]) -> None:
        self.number, self.count = number, count
        self.links = {one: Link(connected, one, self) for one, connected in sockets.items()}
        self.lost: str | None = None
        self.told = self.left = False
        self._lock = threading.Lock()
        for link in self.links.values():
            threading.Thread(target=link.receive, daemon=True).start()
        threading.Thread(target=self._beat, daemon=True).start()

    def gather(self, mine: bytes) -> list[bytes]:
        """What each process holds, in their order, on every process.

        Raises:
          SystemRefusal: one of them is lost.
        """
        if self.number == 0:
            shares = [mine, *(self.links[one].next() for one in range(1, self.count))]
            for link in self.links.values():
                for share in shares:
                    link.send(DATA, share)
            return shares
        self.links[0].send(DATA, mine)
        return [self.links[0].next() for _ in range(self.count)]

    def leave(self) -> None:
        """Says that this process has no more to do with the others."""
        self.left = True
        for link in self.links.values():
            link.send(BYE, b"")
        if self.number:  # else the first may still be busy with the others, and find this one gone
            with suppress(queue.Empty):
                while self.links[0].arrived.get(timeout=GRACE) is not None:
                    pass

    def lose(self, reason: str) -> None:
        """Ends this process, and has the first tell the others: at once, or after `GRACE`."""
        with self._lock:
            if self.left or self.lost:
                return
            self.lost = reason
        timer = threading.Timer(GRACE, self._end)
        timer.daemon = True
        timer.start()
        for link in self.links.values():
            if self.number == 0:
                link.send(LOST, reason.encode())
        for link in self.links.values():
            link.arrived.put(None)

    def refusal(self) -> SystemRefusal:
        """That another process is lost, where this one waits for it."""
        self.told = True
        return SystemRefusal(
            f"{self.lost or 'another process ended'}; nothing of this run is kept: start all of "
            "them again"
        )

    def _end(self) -> None:
        if not self.left:
            if not self.told:
                print(f"mrjax: {in_message(str(self.refusal()))}", file=sys.stderr, flush=True)
            os._exit(REFUSED)

    def _beat(self) -> None:
        while not (self.left or self.lost):
            for link in self.links.values():
                link.send(ALIVE, b"")
            time.sleep(BEAT)


class Link:
    """The connection with one other process."""

    def __init__(self, connected: socket.socket, number: int, group: Group) -> None:
        self.socket, self.number, self.group = connected, number, group
        self.arrived: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        connected.settimeout(SILENCE)

    def send(self, kind: int, content: bytes) -> None:
        """Sends a frame; where the other is gone, `receive` finds out."""
        try:
            with self._lock:
                send(self.socket, kind, content)
        except OSError:
            with suppress(OSError):
                self.socket.shutdown(socket.SHUT_RDWR)

    def next(self) -> bytes:
        """The next content that arrives.

        Raises:
          SystemRefusal: this or another process is lost.
        """
        content = self.arrived.get()
        if content is None:
            raise self.group.refusal()
        return content

    def receive(self) -> None:
        """Takes what arrives until the other leaves or is lost."""
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
            self.group.lose(f"{who} was silent for {SILENCE:.0f} s")
        except OSError as error:
            self.group.lose(f"{who} was lost ({error.strerror or error})")


def send(connected: socket.socket, kind: int, content: bytes) -> None:
    """Sends one frame, in blocks that each have the socket's time."""
    connected.sendall(FRAME.pack(kind, len(content)))
    for at in range(0, len(content), BLOCK):
        connected.sendall(content[at : at + BLOCK])


def frames(connected: socket.socket, most: int) -> Iterator[tuple[int, bytes]]:
    """Kind and content of what arrives, until the other closes the connection.

    Raises:
      OSError: it is lost, silent for too long, or sends more than `most` bytes at once.
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
    """So many bytes, or fewer where the other has closed the connection."""
    parts, missing = [], length
    while missing and (part := connected.recv(min(missing, BLOCK))):
        parts.append(part)
        missing -= len(part)
    return b"".join(parts)


def meet(address: str, count: int, number: int) -> Group:
    """Waits until all processes are there.

    Args:
      address: HOST:PORT of process 0.
      count: of the processes.
      number: of this one.

    Raises:
      InputError: they do not fit together.
      OSError, ValueError: they cannot be reached, or do not come.
    """
    host, _, port = address.rpartition(":")
    if not int(port) < 2**16:
        raise ValueError(f"{port} is no port")
    until = time.monotonic() + PATIENCE
    if number == 0:
        return Group(number, count, _called(int(port), count, until))
    return Group(number, count, {0: _calling(host.strip("[]"), int(port), count, number, until)})


def _called(port: int, count: int, until: float) -> dict[int, socket.socket]:
    """Connections of process 0 with all others, by their numbers."""
    there: dict[int, socket.socket] = {}
    both = socket.has_dualstack_ipv6()
    family = socket.AF_INET6 if both else socket.AF_INET
    with socket.create_server(("", port), family=family, dualstack_ipv6=both) as server:
        while len(there) < count - 1:
            server.settimeout(max(0.01, until - time.monotonic()))
            try:
                caller, _ = server.accept()
            except TimeoutError:
                first = min(set(range(1, count)) - set(there))
                raise TimeoutError(
                    f"process {first} of {count} did not come within {PATIENCE:.0f} s"
                ) from None
            _admit(caller, count, there)
    for caller in there.values():
        send(caller, WELCOME, b"")
    return there


def _admit(caller: socket.socket, count: int, there: dict[int, socket.socket]) -> None:
    """Takes a partner's connection among those that are there; says no to what is none."""
    try:
        caller.settimeout(5.0)
        kind, content = next(frames(caller, HELLO_BYTES))
        said = json.loads(content)
        number = said["number"]
        if kind != HELLO or not isinstance(number, int):
            raise ValueError
        ours = {"mrjax": version("mrjax"), "count": count}
        reason = "".join(
            f"process {number} has {name} = {said.get(name)}, process 0 has {value}"
            for name, value in ours.items()
            if said.get(name) != value
        )
        if not reason and (number in there or not 0 < number < count):
            reason = f"there is a process {number} already"
        if not reason:
            there[number] = caller
            return
        send(caller, NO, reason.encode())
    except Exception:  # a stranger, who may say anything
        pass
    caller.close()


def _calling(host: str, port: int, count: int, number: int, until: float) -> socket.socket:
    """The connection of another process with process 0, once all are there."""
    while True:
        try:
            caller = socket.create_connection((host, port), timeout=10.0)
            break
        except socket.gaierror:
            raise
        except OSError:
            if time.monotonic() > until:
                raise
        time.sleep(0.1)
    hello = {"mrjax": version("mrjax"), "count": count, "number": number}
    send(caller, HELLO, json.dumps(hello).encode())
    caller.settimeout(PATIENCE + GRACE)
    kind, content = next(frames(caller, HELLO_BYTES), (0, b""))
    if kind == NO:
        raise InputError(content.decode(errors="replace"))
    if kind != WELCOME:
        raise ConnectionError("process 0 ended before all were there")
    return caller
