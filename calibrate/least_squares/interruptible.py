"""Ctrl-C during a fit: the fit ends at the next safe point, while or after the model runs.

Python answers a signal only between two of its own steps. A call that waits within XLA delays the
answer until the program ends. A loop that checks for the result and sleeps does not.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import jax

from mrjax.core.interruption import Stop, interruptible

BRIEF = 5e-3
"""Time of checking without sleep, s: many models take no longer."""
LONGEST_SLEEP, SHARE = 0.05, 0.005
"""Limits of the sleep between two checks: in s, and as a share of the time waited so far."""

_NEVER = Stop()
_stop = _NEVER
"""Request to stop the outermost piece of work."""


@contextmanager
def stoppable() -> Iterator[None]:
    """A context for work that Ctrl-C ends at its next check; a second Ctrl-C ends it at once.

    It changes nothing outside the main thread, which no signal reaches, and within another such
    context.

    Raises:
      KeyboardInterrupt: Ctrl-C came.
    """
    global _stop
    if _stop is not _NEVER or threading.current_thread() is not threading.main_thread():
        yield
        return
    with interruptible() as stop:
        _stop = stop
        try:
            yield
        finally:
            _stop = _NEVER


def raise_if_stopped() -> None:
    """Raises if Ctrl-C came.

    Raises:
      StoppedError: Ctrl-C came. It ends the piece of work, which then raises `KeyboardInterrupt`.
    """
    _stop.check()


def wait_for(result: Any) -> Any:
    """Waits for arrays, and returns them; Ctrl-C ends the wait. Traced arrays need no wait."""
    began = time.perf_counter()
    leaves: list[Any] = jax.tree.leaves(result)
    for leaf in leaves:
        while not isinstance(leaf, jax.core.Tracer) and not leaf.is_ready():
            raise_if_stopped()
            waited = time.perf_counter() - began
            time.sleep(min(LONGEST_SLEEP, SHARE * waited) if waited > BRIEF else 0.0)
    raise_if_stopped()
    return result


def watched(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wraps a compiled function so that Ctrl-C ends the wait for its result."""

    def watching(*arguments: Any) -> Any:
        return wait_for(function(*arguments))

    return watching
