"""What a particle-step and a rebuild of the neighbour list cost, and memory, by the number of them.

A list that is rebuilt in every step against one that is kept, from which what a step and a rebuild
cost by themselves follows: runs of many particles are too short to keep it as long as others do.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

import mrjax
from mrjax import scan
from mrjax.schedule import MOST_STEPS_BETWEEN_REBUILDS
from mrjax.simulate import prepared

from . import memory, process, states, timing
from .process import Process

WORK = 3e6
"""Particle-steps of a run."""
LEAST_STEPS, MOST_STEPS = 16, 10_000
ALWAYS = 1e30
"""Haste at which a list is never thought fresh, while its program is traced."""
OFTEN = 0.1
"""Steps that rebuild the list, each, as a part of those that keep it."""
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
    usual, often = (
        np.array([one[name] for one in found]) / of_run[f"{name}_steps"]
        for name in ("usual", "often")
    )
    kept = of_run["usual_steps"] / of_run["rebuilds"]
    rebuild = (often - usual) / (1 - 1 / kept)
    step = usual - rebuild / kept
    at_most = step + rebuild / MOST_STEPS_BETWEEN_REBUILDS
    particles = of_run["particles"]
    return {
        "particles": particles,
        "seconds_per_particle_step": timing.spread(at_most / particles),
        "rebuild_in_steps": timing.spread(rebuild / step),
        "share_of_rebuilds": timing.spread(rebuild / MOST_STEPS_BETWEEN_REBUILDS / at_most),
        "share_if_every_step": timing.spread(rebuild / often),
        "peak": of_run["peak"],
        "bytes_per_particle": of_run["peak"] / particles,
    }


def here(folder: str, tiles: int, work: float) -> Iterator[dict[str, float]]:
    """First what the runs are, and the memory of one, then how long both take."""
    state, box = states.load(Path(folder), states.SETTLED, tiles)
    parameters = states.dry()
    # At rest nothing outruns a list that is kept for the most steps there may be.
    affordable = int(np.clip(work / state.particles, LEAST_STEPS, MOST_STEPS))
    between = min(MOST_STEPS_BETWEEN_REBUILDS, affordable)
    whole = affordable // between * between
    steps = {"usual": whole, "often": max(2, int(OFTEN * whole))}
    every = {"usual": between, "often": 1}
    chosen = {"time_step": states.TIME_STEP, "skin": states.SKIN}

    def follow(name: str) -> mrjax.Run:
        return mrjax.simulate(
            state,
            parameters,
            box,
            duration=steps[name] * states.TIME_STEP,
            rebuild_every=every[name],
            **chosen,
        )

    follow("usual")
    kept, scan.HURRY = scan.HURRY, ALWAYS
    follow("often")
    scan.HURRY = kept
    cuts = prepared(
        state,
        parameters,
        box,
        duration=steps["usual"] * states.TIME_STEP,
        frames=1,
        rebuild_every=between,
        **chosen,
    ).cuts
    yield {
        "particles": state.particles,
        "peak": memory.taken(lambda: follow("usual")),
        "rebuilds": cuts.intervals,
        **{f"{name}_steps": number for name, number in steps.items()},
    }
    while True:
        yield {name: timing.seconds(lambda name=name: follow(name)) for name in steps}


if __name__ == "__main__":
    process.serve(here)
