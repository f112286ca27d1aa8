"""How much memory a call takes beyond what the process held before it. Linux only."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax


def taken(call: Callable[[], Any]) -> int:
    """Bytes at the peak of a call less those before it.

    The peak is set back first: that of `ru_maxrss` is, for small runs, the compiler's. What was
    freed, but kept by the allocator for calls like this one, is given back as well.
    """
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = _kilobytes("VmRSS")
    jax.block_until_ready(call())
    return 1024 * (_kilobytes("VmHWM") - before)


def _kilobytes(name: str) -> int:
    for line in Path("/proc/self/status").read_text("utf-8").splitlines():
        if line.startswith(name):
            return int(line.split()[1])
    raise RuntimeError(f"/proc/self/status has no {name}")
