"""`mrjax-calibrate fang2005` from a cold start and again, with what it kept in between."""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from . import process

STARTS = ("cold", "second")


def measured(experiment: str = "fang2005") -> list[dict]:
    """A row for each start, with the seconds of the clock and of all cores."""
    with tempfile.TemporaryDirectory() as cache:
        return [{"start": start, **_run(experiment, cache)} for start in STARTS]


def _run(experiment: str, cache: str) -> dict[str, float]:
    cores = max(process.numbers_of_cores())
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    with tempfile.TemporaryDirectory() as out, process.pinned(cores):
        subprocess.run(
            [sys.executable, "-m", "calibrate", experiment, "--out", str(Path(out) / "fit")],
            cwd=process.REPOSITORY,
            env=process.clean_environment(cache),
            stdout=subprocess.DEVNULL,
            check=True,
        )
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"cores": cores, "wall": wall, "cpu": used}
