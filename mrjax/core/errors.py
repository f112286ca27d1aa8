"""The three ways mrjax says no: wrong input, a result not to be trusted, the system refuses."""

from typing import Any

from mrjax.core import text

LONGEST = 60
"""Characters of a value that a message shows."""


class InputError(ValueError):
    """An input that cannot be used; the message names the value, the fault and the remedy.

    It is one printable line of at most 400 characters, whatever it is made of.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


class SimulationError(RuntimeError):
    """A run ended with a result that must not be used; the message says why and what to change."""

    state: Any = None
    """The last good `mrjax.State`, from which a run can go on with the remedy; None if unknown."""
    time: float | None = None
    """Time of that state, s from the start of the run."""
    faults: int = 0
    """Every `Fault` of that run, added up."""

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


class SystemRefusal(OSError):  # noqa: N818 - says who refuses, as no "Error" would
    """The operating system refuses a file, a stream or memory; the message has name and remedy.

    What the system raised is the cause (`__cause__`), with its `errno`. What was computed and kept
    (`checkpoint`) stays.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(text.in_message(str(message)))


def shown(value: object) -> str:
    """A value as a message has it: one printable line, and only the beginning of what is long."""
    try:
        line = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, tables in tables
        return f"a {type(value).__name__} too long to show"
    return text.shortened(text.printable(" ".join(line.split())), LONGEST, ends=1.0)


def shown_key(key: object) -> str:
    """A key of a table as a message has it: as it is where it is a plain word."""
    plain = str(key).isidentifier() and len(str(key)) <= LONGEST
    return str(key) if plain else shown(key)
