"""Ctrl-C during a fit: it ends at the next place where that is safe, while or after the model runs.

Python answers a signal between two of its own steps: a call that waits within XLA holds it off
until the program ends. One that looks whether the result is there, and sleeps, does not.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import jax

from mrjax.core.interruption import Stop, interruptible

BRIEF = 5e-3
"""Wait, s, during which nobody sleeps: many models take no longer."""
LONGEST_SLEEP, SHARE = 0.05, 0.005
"""Between two looks: s, and of the time waited so far, by which the wait may be too long."""

_NEVER = Stop()
_stop = _NEVER
"""Of the outermost piece of work that goes on."""


@contextmanager
def stoppable() -> Iterator[None]:
    """A piece of work that Ctrl-C ends where it looks whether to stop; a second one, at once.

    Leaves Ctrl-C alone outside the main thread, which no signal reaches, and within other such
    work.

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
    """Returns the arrays when all are there; Ctrl-C ends the wait, and traced ones need none."""
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
    """A compiled function that is waited for so that Ctrl-C ends the wait."""

    def watching(*arguments: Any) -> Any:
        return wait_for(function(*arguments))

    return watching
