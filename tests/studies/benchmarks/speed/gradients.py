"""What gradients cost beside the run: time and memory, from a settled bed of case2 in oil."""

from collections.abc import Iterator
from pathlib import Path

import jax

from . import memory, process, programs, states, timing
from .process import Process

STEPS = (1_000, 10_000)


def measured(
    folder: Path, steps: tuple[int, ...] = STEPS, repetitions: int = 3, whole: bool = False
) -> Iterator[dict]:
    """A row for each number of steps and cores; with `whole`, also for those of the curve."""
    states.make(folder, states.IN_OIL)
    if whole:
        steps = (*steps, states.curve(folder)[1])
    for number in steps:
        for cores in process.numbers_of_cores():
            found = {
                name: _found(name, folder, number, cores, repetitions) for name in programs.OWN_RUN
            }
            for name, one in found.items():
                for column, run in (("run", programs.RUN), ("own_run", programs.OWN_RUN[name])):
                    of_run = found[run]["seconds"]["median"]
                    one[f"over_{column}"] = one["seconds"]["median"] / of_run
            yield {"steps": number, "cores": cores, "programs": found}


def _found(name: str, folder: Path, steps: int, cores: int, repetitions: int) -> dict:
    given = {"name": name, "folder": str(folder), "steps": steps}
    with Process("gradients", given, cores) as asked:
        of_program = asked.answer()
        times = [asked.again()["seconds"] for _ in range(repetitions)]
    return {**of_program, "seconds": timing.spread(times)}


def here(name: str, folder: str, steps: int) -> Iterator[dict[str, float]]:
    """First the memory, in bytes, then how long a call takes, again and again."""
    function, argument = programs.program(name, Path(folder), steps)
    compiled = jax.jit(function).lower(argument).compile()
    analysis = compiled.memory_analysis()
    yield {
        "peak": memory.taken(lambda: compiled(argument)),
        "planned": None if analysis is None else int(analysis.temp_size_in_bytes),
    }
    while True:
        yield {"seconds": timing.seconds(lambda: compiled(argument))}


if __name__ == "__main__":
    process.serve(here)
