"""How long programs take to compile: the first call less the second."""

from collections.abc import Iterator
from pathlib import Path

import jax

from . import process, programs, states, timing

STEPS = 1_000


def measured(folder: Path, steps: int = STEPS) -> list[dict]:
    """A row for each program, in a process of its own."""
    states.make(folder, states.IN_OIL)
    return [
        {
            "program": name,
            **process.answered(
                "compilation",
                {"name": name, "folder": str(folder), "steps": steps},
                max(process.numbers_of_cores()),
            ),
        }
        for name in (programs.VELOCITY, *programs.OWN_RUN)
    ]


def here(name: str, folder: str, steps: int) -> Iterator[dict[str, float]]:
    """Seconds, of calls and of the compilation."""
    function, argument = programs.program(name, Path(folder), steps)
    called = function if name == programs.VELOCITY else jax.jit(function)
    first, second = (timing.seconds(lambda: called(argument)) for _ in range(2))
    yield {"first": first, "second": second, "compilation": first - second}


if __name__ == "__main__":
    process.serve(here)
