"""Connects processes: process 0 waits for all others, and each sends its number and version."""

import json
import socket
import time
from importlib.metadata import version

from mrjax.core.errors import InputError
from mrjax.simulation.partners import timing
from mrjax.simulation.partners.frames import HELLO, HELLO_BYTES, NO, WELCOME, frames, send
from mrjax.simulation.partners.group import Group


def meet(address: str, count: int, number: int) -> Group:
    """Connects all processes, and waits until all are there.

    Args:
      address: HOST:PORT of process 0.
      count: number of processes.
      number: number of this process.

    Raises:
      InputError: the processes differ in version or count, or a number is wrong or taken.
      OSError, ValueError: a process cannot be reached, or does not come.
    """
    host, _, port = address.rpartition(":")
    if not int(port) < 2**16:
        raise ValueError(f"{port} is no port")
    deadline = time.monotonic() + timing.PATIENCE
    if number == 0:
        return Group(number, count, _accepted_callers(int(port), count, deadline))
    first = _connected_to_first(host.strip("[]"), int(port), count, number, deadline)
    return Group(number, count, {0: first})


def _accepted_callers(port: int, count: int, deadline: float) -> dict[int, socket.socket]:
    """Connections of process 0 with all others, by their numbers."""
    callers: dict[int, socket.socket] = {}
    dual_stack = socket.has_dualstack_ipv6()
    family = socket.AF_INET6 if dual_stack else socket.AF_INET
    with socket.create_server(("", port), family=family, dualstack_ipv6=dual_stack) as server:
        while len(callers) < count - 1:
            server.settimeout(max(0.01, deadline - time.monotonic()))
            try:
                caller, _ = server.accept()
            except TimeoutError:
                first = min(set(range(1, count)) - set(callers))
                raise TimeoutError(
                    f"process {first} of {count} did not come within {timing.PATIENCE:.0f} s"
                ) from None
            _admit(caller, count, callers)
    for caller in callers.values():
        send(caller, WELCOME, b"")
    return callers


def _admit(caller: socket.socket, count: int, callers: dict[int, socket.socket]) -> None:
    """Adds a process of this computation to the callers; refuses any other."""
    try:
        caller.settimeout(5.0)
        kind, content = next(frames(caller, HELLO_BYTES))
        greeting = json.loads(content)
        number = greeting["number"]
        if kind != HELLO or not isinstance(number, int):
            raise ValueError
        expected = {"mrjax": version("mrjax"), "count": count}
        reason = "".join(
            f"process {number} has {name} = {greeting.get(name)}, process 0 has {value}"
            for name, value in expected.items()
            if greeting.get(name) != value
        )
        if not reason and (number in callers or not 0 < number < count):
            reason = f"there is a process {number} already"
        if not reason:
            callers[number] = caller
            return
        send(caller, NO, reason.encode())
    except Exception:  # an unknown program may send anything
        pass
    caller.close()


def _connected_to_first(
    host: str, port: int, count: int, number: int, deadline: float
) -> socket.socket:
    """The connection of another process with process 0, after all processes have come."""
    while True:
        try:
            caller = socket.create_connection((host, port), timeout=10.0)
            break
        except socket.gaierror:
            raise
        except OSError:
            if time.monotonic() > deadline:
                raise
        time.sleep(0.1)
    hello = {"mrjax": version("mrjax"), "count": count, "number": number}
    send(caller, HELLO, json.dumps(hello).encode())
    caller.settimeout(timing.PATIENCE + timing.GRACE)
    kind, content = next(frames(caller, HELLO_BYTES), (0, b""))
    if kind == NO:
        raise InputError(content.decode(errors="replace"))
    if kind != WELCOME:
        raise ConnectionError("process 0 ended before all were there")
    return caller
