"""Work divided among the processes of one computation, on one machine or several."""

import os
import pickle
import socket
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import jax
import numpy as np
from jax.experimental import multihost_utils

from mrjax.errors import InputError, SimulationError, SystemRefusal

T = TypeVar("T")
R = TypeVar("R")

PATIENCE = 300.0
"""How long a process waits for the first one to be there, s; JAX waits as long for the others."""


def join(address: str | None = None, count: int | None = None, number: int | None = None) -> None:
    """Makes this process one of `count`, which all call this, before anything is computed.

    Args:
      address: HOST:PORT at which process 0 can be reached.
      count: of the processes.
      number: of this one, from 0 on. All three left out, they are those of the cluster's scheduler,
        as `jax.distributed.initialize` finds them.

    Raises:
      InputError: the others cannot be reached, or there is no scheduler.
    """
    try:
        if address is not None:
            _try(address, number)
        jax.distributed.initialize(address, count, number)
    except (ValueError, RuntimeError, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise InputError(
            f"the processes did not find each other ({reason}); give all the same HOST:PORT and "
            "COUNT, and each its own number"
        ) from None


def _try(address: str, number: int | None) -> None:
    """Listens or connects once: where JAX cannot, it crashes instead of raising."""
    host, _, port = address.rpartition(":")
    if not int(port) < 2**16:
        raise ValueError(f"{port} is no port")
    if number == 0:
        socket.create_server(("", int(port))).close()
        return
    began = time.monotonic()
    while True:
        try:
            socket.create_connection((host, int(port)), timeout=10.0).close()
            return
        except socket.gaierror:
            raise
        except OSError:
            if time.monotonic() - began > PATIENCE:
                raise
        time.sleep(0.1)


def is_first() -> bool:
    """Whether this process is the one that writes and speaks; true of a single one."""
    return jax.process_index() == 0


def divided(work: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> list[R]:
    """What work gives for all items, on every process, each having done its share.

    Every process calls this with as many items.

    Args:
      work: from some of the items to as many results, which can be pickled.
      items: all of them.

    Raises:
      InputError, SimulationError, SystemRefusal: as raised by the work of any process.
    """
    count = jax.process_count()
    if count == 1:
        return work(items)
    try:
        done: list[R] | Exception = work(items[jax.process_index() :: count])
    except (InputError, SimulationError, SystemRefusal) as error:  # the others must not wait
        done = error
    shares = _of_all(done)
    for share in shares:
        if isinstance(share, Exception):
            raise share
    return [shares[place % count][place // count] for place in range(len(items))]


def by_first(work: Callable[[], R]) -> R:
    """What work gives on process 0 alone, on every process; raises as `divided`."""
    return divided(lambda some: [work() for _ in some], [None])[0]


def _of_all(mine: object) -> list:
    """What each process holds, in their order, on every process."""
    packed = np.frombuffer(pickle.dumps(mine), np.uint8)
    sizes = multihost_utils.process_allgather(np.array(packed.size)).ravel()
    padded = np.pad(packed, (0, int(sizes.max()) - packed.size))
    rows = multihost_utils.process_allgather(padded)
    return [pickle.loads(row[:size].tobytes()) for row, size in zip(rows, sizes, strict=True)]


def usable_cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
