"""Divides work among the processes of one computation, on one machine or several.

The processes are those of `--distributed`, which `join` connects, or those of `jax.distributed`.
"""

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

import jax
import numpy as np
from jax.experimental import multihost_utils

from mrjax.core.errors import InputError, SimulationError, SystemRefusal
from mrjax.simulation import messages, partners
from mrjax.simulation.partners import timing

T = TypeVar("T")
R = TypeVar("R")

_group: partners.Group | None = None
"""The group of this process, once it has joined."""


def join(address: str | None = None, count: int | None = None, number: int | None = None) -> None:
    """Connects this process with the others of a computation, all of which make this call.

    The call comes before anything is computed. From then on a process that dies ends all others
    with one line and exit status 3. Those that wait for it end at once, the others within
    `timing.GRACE`. If its machine died, they end `timing.SILENCE` later.

    Args:
      address: HOST:PORT at which process 0 can be reached.
      count: number of processes.
      number: number of this process, from 0. If all three are left out, they are those of the
        cluster's scheduler, as JAX finds them.

    Raises:
      InputError: the others do not come within `timing.PATIENCE`, or there is no scheduler.
    """
    global _group
    try:
        if address is None:
            address, count, number = _scheduled()
        if address is None or count is None or number is None:
            raise ValueError("there is no scheduler")
        _group = partners.meet(address, count, number)
    except (ValueError, RuntimeError, OSError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
        raise InputError(
            f"the processes did not find each other ({reason}); give all the same HOST:PORT and "
            "COUNT, and each its own number"
        ) from None


def leave() -> None:
    """Tells the others that this process has done its share, so that its end does not end them."""
    if _group is not None:
        _group.leave()


def _scheduled() -> tuple[str | None, int | None, int | None]:
    """Address, count and number from the cluster's scheduler; also sets this process' GPUs."""
    from jax._src.clusters import ClusterEnv  # JAX has no public name for it

    address, count, number, devices = ClusterEnv.auto_detect_unset_distributed_params(
        None, None, None, None, None, int(timing.PATIENCE)
    )
    if devices:
        visible = ",".join(map(str, devices))
        jax.config.update("jax_cuda_visible_devices", visible)
        jax.config.update("jax_rocm_visible_devices", visible)
    return address, count, number


def count() -> int:
    """The number of processes."""
    return jax.process_count() if _group is None else _group.count


def number() -> int:
    """The number of this process, from 0 on."""
    return jax.process_index() if _group is None else _group.number


def is_first() -> bool:
    """True on process 0, which alone writes files and messages."""
    return number() == 0


def divided(work: Callable[[Sequence[T]], list[R]], items: Sequence[T]) -> list[R]:
    """Divides work among the processes; returns the results for all items, on every process.

    Every process makes this call with equally many items.

    Args:
      work: function from some of the items to as many results, of kinds that `messages` can encode.
      items: all items.

    Raises:
      InputError, SimulationError, SystemRefusal: the work of any process raised it.
      SystemRefusal: a process is lost.
    """
    total = count()
    if total == 1:
        return work(items)
    try:
        outcome: list[R] | Exception = work(items[number() :: total])
    except (InputError, SimulationError, SystemRefusal) as error:  # the others must not wait
        outcome = error
    try:
        shares = [messages.decode(message) for message in _gathered(messages.encode(outcome))]
    except ValueError as error:
        raise SystemRefusal(f"what another process sent {error}; give a free port") from None
    for share in shares:
        if isinstance(share, Exception):
            leave()
            raise share
    return [shares[place % total][place // total] for place in range(len(items))]


def by_first(work: Callable[[], R]) -> R:
    """Does work on process 0 alone; returns its result on every process. Raises as `divided`."""
    return divided(lambda some: [work() for _ in some], [None])[0]


def _gathered(mine: bytes) -> list[bytes]:
    """The messages of all processes, in the order of their numbers, on every process."""
    if _group is not None:
        return _group.gather(mine)
    packed = np.frombuffer(mine, np.uint8)
    sizes = multihost_utils.process_allgather(np.array(packed.size)).ravel()
    padded = np.pad(packed, (0, int(sizes.max()) - packed.size))
    rows = multihost_utils.process_allgather(padded)
    return [row[:size].tobytes() for row, size in zip(rows, sizes, strict=True)]


def usable_cores() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
