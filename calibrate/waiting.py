"""Ctrl-C during a fit: it ends at the next place where that is safe, while or after the model runs.

Python answers a signal between two of its own steps: a call that waits within XLA holds it off
until the program ends. One that looks whether the result is there, and sleeps, does not. While
JAX compiles, an exception of a signal would leave jaxlib 0.10.1 so that it crashes when the
interpreter ends: the signal is noted, and raised where a fit looks for it.
"""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import jax

BRIEF = 5e-3
"""Wait, s, during which nobody sleeps: many models take no longer."""
LONGEST_SLEEP, SHARE = 0.05, 0.005
"""Between two looks: s, and of the time waited so far, by which the wait may be too long."""

_noted: list[int] = []
"""Signals that no one has answered yet."""


@contextmanager
def stoppable() -> Iterator[None]:
    """A piece of work that Ctrl-C ends where it looks whether to stop; a second one, at once.

    Leaves Ctrl-C alone outside the main thread, which no signal reaches, within other such work,
    and where somebody else answers it.

    Raises:
      KeyboardInterrupt: Ctrl-C came.
    """
    ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if not ours:
        yield
        return

    def note(number: int, _frame: object) -> None:
        _noted.append(number)
        if len(_noted) > 1:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    try:
        yield
        look()
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _noted.clear()


def look() -> None:
    """Passes where nobody asks to stop.

    Raises:
      KeyboardInterrupt: Ctrl-C came.
    """
    if _noted and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt


def there(found: Any) -> Any:
    """The same arrays when all of them are there, if they are not traced; raises as `look`."""
    began = time.perf_counter()
    leaves: list[Any] = jax.tree.leaves(found)
    for leaf in leaves:
        while not isinstance(leaf, jax.core.Tracer) and not leaf.is_ready():
            look()
            waited = time.perf_counter() - began
            time.sleep(min(LONGEST_SLEEP, SHARE * waited) if waited > BRIEF else 0.0)
    look()
    return found


def watched(function: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled function that is waited for so that Ctrl-C ends the wait."""

    def watching(*arguments: Any) -> Any:
        return there(function(*arguments))

    return watching
