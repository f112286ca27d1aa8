"""A measurement in a process of its own, on cores of its own, that answers when it is asked.

A module with such a measurement has a generator; run by its name it yields one line of JSON, and
the next for each line it reads. In between it sleeps: two codes can take turns on the same cores.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

REPOSITORY = Path(__file__).parents[4]
PACKAGE = "tests.studies.benchmarks.speed"


@contextmanager
def pinned(number: int) -> Iterator[None]:
    """Processes started here stay on the first so many cores of those that this one may use.

    They are there before their interpreter starts: libraries count cores when they are loaded.
    """
    all_of_them = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(all_of_them)[:number])
    try:
        yield
    finally:
        os.sched_setaffinity(0, all_of_them)


def most_cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0))


def numbers_of_cores() -> list[int]:
    """One, and two where there are two."""
    return [number for number in (1, 2) if number <= most_cores()]


def clean_environment(cache: str) -> dict[str, str]:
    """That of this process, with another folder for whatever is kept between processes."""
    # JAX sets the second as it is imported, and a new process would find it set.
    mine = ("JAX", "TF_CPP_MIN_LOG_LEVEL")
    kept = {name: value for name, value in os.environ.items() if not any(of in name for of in mine)}
    return {**kept, "XDG_CACHE_HOME": cache}


class Process:
    """The generator of one module of this package, somewhere else."""

    def __init__(self, module: str, given: dict[str, Any], number_of_cores: int):
        self._cache = tempfile.TemporaryDirectory()
        with pinned(number_of_cores):
            self._child = subprocess.Popen(
                [sys.executable, "-m", f"{PACKAGE}.{module}", json.dumps(given)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                cwd=REPOSITORY,
                env=clean_environment(self._cache.name),
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_) -> None:
        self._child.stdin.close()
        self._child.wait()
        self._child.stdout.close()
        self._cache.cleanup()

    def answer(self) -> dict[str, Any]:
        """What the generator yields next.

        Raises:
          RuntimeError: it failed; its own words are on standard error.
        """
        line = self._child.stdout.readline()
        if not line:
            raise RuntimeError(f"measurement ended with status {self._child.wait()}")
        return json.loads(line)

    def again(self) -> dict[str, Any]:
        """Lets it go on, and waits for what it yields."""
        self._child.stdin.write("\n")
        self._child.stdin.flush()
        return self.answer()


def answered(module: str, given: dict[str, Any], number_of_cores: int) -> dict[str, Any]:
    """The first answer of a process that is then ended."""
    with Process(module, given, number_of_cores) as process:
        return process.answer()


def serve(generator: Callable[..., Iterator[dict[str, Any]]]) -> None:
    """The other side: the generator with the arguments of the command line, in float64."""
    import jax

    jax.config.update("jax_enable_x64", True)
    for found in generator(**json.loads(sys.argv[1])):
        print(json.dumps(found), flush=True)
        if not sys.stdin.readline():
            return
