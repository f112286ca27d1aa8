"""Compiled programs that can be waited for, so that Ctrl-C ends the wait and not only the program.

Python answers a signal between two of its own steps. A call that waits within XLA holds it off
until the program ends; one that looks whether the result is there, and sleeps, does not.
"""

import time
from collections.abc import Callable
from typing import Any

import jax

BRIEF = 0.2
"""Duration of a program, s, up to which it is simply waited for."""
LONGEST_SLEEP, SHARE = 0.05, 0.005
"""Between two looks: s, and of the time waited so far, by which the wait may be too long."""


class Interruptible:
    """A compiled function whose long calls let Python see signals."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.took = 0.0  # by the last call, s

    def __call__(self, *arguments: Any) -> Any:
        """What the function gives, when it is there."""
        began = time.perf_counter()
        found = self.function(*arguments)
        if self.took > BRIEF:
            wait(found, began)
        found = jax.block_until_ready(found)
        self.took = time.perf_counter() - began
        return found


def wait(found: Any, began: float | None = None) -> None:
    """Sleeps until all arrays of a tree are there."""
    began = time.perf_counter() if began is None else began
    leaves: list[Any] = jax.tree.leaves(found)
    for leaf in leaves:
        while not leaf.is_ready():
            time.sleep(min(LONGEST_SLEEP, 1e-4 + SHARE * (time.perf_counter() - began)))
