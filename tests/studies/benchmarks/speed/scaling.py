"""What a particle-step and a rebuild of the neighbour list cost, and memory, by the number of them.

From step to step: as long as a longer run takes beyond a shorter one, both of many steps with one
list and of steps with a list each. A run of many particles is too short to be timed as a whole,
its first list and what else precedes the first step among it.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mrjax.dem import engine
from mrjax.dem.plan import RunPlan
from mrjax.dem.schedule import MOST_STEPS_BETWEEN_REBUILDS

from . import memory, process, states, timing
from .process import Process

WORK = 5e7
"""Particle-steps by which the longer run with one list exceeds the shorter."""
LEAST_STEPS, MOST_STEPS = 64, 10_000
FIRST = {"kept": 8, "anew": 1}
"""Steps of the shorter runs."""
REBUILDS = 1 / 20
"""Steps with a list each, as a part of those with one."""
ALWAYS = 1e30
"""Haste at which a list is never thought fresh, while its program is traced."""
LARGE = (40, 57)
"""Tiles along x and y: 502,400 and 1,020,186 particles."""


def measured(
    folder: Path,
    tiles: tuple[int, ...] = states.TILES,
    repetitions: int = 3,
    large: bool = False,
    work: float = WORK,
) -> Iterator[dict]:
    """A row for each size, on one core."""
    states.make(folder, states.SETTLED)
    for times in (*tiles, *(LARGE if large else ())):
        yield _row(folder, times, repetitions, work)


def _row(folder: Path, tiles: int, repetitions: int, work: float) -> dict:
    with Process("scaling", {"folder": str(folder), "tiles": tiles, "work": work}, 1) as asked:
        of_run = asked.answer()
        found = [asked.again() for _ in range(repetitions)]
    step, with_rebuild = (np.array([one[name] for one in found]) for name in ("kept", "anew"))
    rebuild = with_rebuild - step
    at_most = step + rebuild / MOST_STEPS_BETWEEN_REBUILDS
    particles = of_run["particles"]
    return {
        "particles": particles,
        "seconds_per_particle_step": timing.spread(at_most / particles),
        "rebuild_in_steps": timing.spread(rebuild / step),
        "share_of_rebuilds": timing.spread(rebuild / MOST_STEPS_BETWEEN_REBUILDS / at_most),
        "share_if_every_step": timing.spread(rebuild / with_rebuild),
        "peak": of_run["peak"],
        "bytes_per_particle": of_run["peak"] / particles,
    }


def here(folder: str, tiles: int, work: float) -> Iterator[dict[str, float]]:
    """First the memory of a run, then seconds of a step with a list kept, and with one anew."""
    state, box = states.load(Path(folder), states.SETTLED, tiles)
    parameters = states.dry()
    steps = int(np.clip(work / state.particles, LEAST_STEPS, MOST_STEPS))
    more = {"kept": steps, "anew": max(2, int(REBUILDS * steps))}

    def seconds(plan: RunPlan) -> float:
        return timing.seconds(lambda: states.run(state, parameters, box, plan))

    # At rest nothing outruns a list that is kept for a whole run.
    runs = {
        name: [
            states.dry_run(state, box, step, rebuild_every=step if name == "kept" else 1)
            for step in (first, first + more[name])
        ]
        for name, first in FIRST.items()
    }
    hurry = engine.SPEED_MARGIN
    for name, both in runs.items():
        engine.SPEED_MARGIN = hurry if name == "kept" else ALWAYS
        for plan in both:
            states.run(state, parameters, box, plan)
    engine.SPEED_MARGIN = hurry
    longest = runs["kept"][1]
    yield {
        "particles": state.particles,
        "peak": memory.taken(lambda: states.run(state, parameters, box, longest)),
    }
    while True:
        yield {
            name: (seconds(longer) - seconds(shorter)) / more[name]
            for name, (shorter, longer) in runs.items()
        }


if __name__ == "__main__":
    process.serve(here)
