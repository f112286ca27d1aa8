"""The three errors that mrjax raises: wrong input, a faulty run, a refusal by the system."""

from typing import Any

from mrjax.core import text

LONGEST = 60
"""Largest number of characters of a value in a message."""


class InputError(ValueError):
    """An input that cannot be used; the message names the value, the fault and the remedy.

    The message is always one printable line of at most 400 characters.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


class SimulationError(RuntimeError):
    """A run ended with a result that must not be used; the message says why and what to change."""

    state: Any = None
    """The last good `mrjax.State`, from which a run can continue after the change; None if there is
    none."""
    time: float | None = None
    """Time of that state, s from the start of the run."""
    faults: int = 0
    """Sum of all faults (`mrjax.Fault`) of that run."""

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


class SystemRefusal(OSError):  # noqa: N818 - says who refuses, as no "Error" would
    """The operating system refused a file, a stream or memory; the message has name and remedy.

    The system's own error is the cause (`__cause__`), with its `errno`. Results already in a
    `checkpoint` stay there.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


def shown(value: object) -> str:
    """Returns a value as text for a message: one printable line, cut after `LONGEST` characters."""
    try:
        line = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, deeply nested tables
        return f"a {type(value).__name__} too long to show"
    return text.shortened(text.printable(" ".join(line.split())), LONGEST, head=1.0)


def shown_key(key: object) -> str:
    """Returns a table's key as text for a message: unquoted if it is a plain word."""
    plain = str(key).isidentifier() and len(str(key)) <= LONGEST
    return str(key) if plain else shown(key)
