"""Particle-steps in a second, dispersed and at rest, in turns with LIGGGHTS.

Both codes begin where the other does, forget what contacts remembered, and run some steps before
the clock starts. What they leave behind is looked at: it has to be the same bed.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from mrjax.core.run import Run
from mrjax.dem.plan import RunPlan

from . import liggghts, process, states, timing
from .process import Process

WORK = 4e7
"""Particle-steps of a run, which takes some seconds."""
LEAST_STEPS, MOST_STEPS = 1_000, 30_000
"""So many that they outweigh what precedes the first; and as long as a dispersed box stays so."""
WARM = 2_000
"""Steps before the clock starts."""
DTYPES = ("float64", "float32")


def measured(
    folder: Path, tiles: tuple[int, ...] = states.TILES, repetitions: int = 3, work: float = WORK
) -> Iterator[dict]:
    """A row for every phase, size and number of cores."""
    for phase in (states.SETTLED, states.DILUTE):
        states.make(folder, phase)
        for times in tiles:
            for cores in process.numbers_of_cores():
                yield _row(folder, phase, times, cores, repetitions, work)


def _row(folder: Path, phase: str, tiles: int, cores: int, repetitions: int, work: float) -> dict:
    state, box = states.load(folder, phase, tiles)
    position, velocity = np.asarray(state.position), np.asarray(state.velocity)
    steps = int(np.clip(work / len(position), LEAST_STEPS, MOST_STEPS))
    warm = min(WARM, steps)
    found = {name: {"seconds": [], "start": []} for name in DTYPES}
    compared = liggghts.available(cores)
    if compared:
        found["liggghts"] = {"seconds": []}
    with ExitStack() as stack:
        given = {"folder": str(folder), "phase": phase, "tiles": tiles, "steps": steps}
        ours = {}
        for dtype in DTYPES:
            asked = Process("throughput", {**given, "warm": warm, "dtype": dtype}, cores)
            ours[dtype] = stack.enter_context(asked)
            found[dtype].update(ours[dtype].answer())

        def our_turn(dtype: str) -> None:
            for key, value in ours[dtype].again().items():
                found[dtype][key].append(value)

        for _ in range(repetitions):
            our_turn("float64")
            if compared:  # between the two, so that it is next to either
                theirs = liggghts.run(
                    position, velocity, box, steps=steps, warm=warm, number_of_cores=cores
                )
                look = states.look(theirs.position, theirs.velocity)
                found["liggghts"].update(builds=theirs.builds, **look)
                found["liggghts"]["seconds"].append(theirs.seconds)
            our_turn("float32")
    for dtype in DTYPES:
        found[dtype]["start"] = timing.spread(found[dtype]["start"])
    for code in found.values():
        code["rate"] = timing.spread([len(position) * steps / one for one in code["seconds"]])
    if compared:
        for dtype in DTYPES:
            pair = found["liggghts"]["seconds"], found[dtype]["seconds"]
            found[dtype]["over_liggghts"] = timing.ratios(*pair)
    of = {"phase": phase, "particles": len(position), "cores": cores, "steps": steps, "warm": warm}
    return {**of, **found}


def here(
    folder: str, phase: str, tiles: int, steps: int, warm: int, dtype: str
) -> Iterator[dict[str, float]]:
    """First what the run is and where it ends, then how long its steps take, again and again.

    As long as a run of `warm + steps` takes beyond one of `warm`: the other code's clock, too, runs
    from step to step, without what precedes the first.
    """
    state, box = states.load(Path(folder), phase, tiles, dtype)
    parameters = states.dry()

    def until(step: int) -> tuple[RunPlan, Run]:
        plan = states.dry_run(state, box, step)
        return plan, states.run(state, parameters, box, plan)

    (shorter, _), (longer, run) = until(warm), until(warm + steps)

    def seconds(plan: RunPlan) -> float:
        return timing.seconds(lambda: states.run(state, parameters, box, plan))

    yield {
        "builds": longer.schedule.intervals - shorter.schedule.intervals,
        **states.look(np.asarray(run.state.position), np.asarray(run.state.velocity)),
    }
    while True:
        before = seconds(shorter)
        taken = seconds(longer) - before
        yield {"seconds": taken, "start": before - warm / steps * taken}


if __name__ == "__main__":
    process.serve(here)
