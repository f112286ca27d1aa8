"""The whole curve of case2 in oil, and what LIGGGHTS does about the same box.

LIGGGHTS settles it without a fluid. With the drag, which `fix viscous` takes from the velocity
before the step, its steps are bounded by mass over drag, and the curve is out of its reach.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

import mrjax
from mrjax.core.box import Box
from mrjax.laws import drag, particle

from . import liggghts, process, states, timing
from .process import Process

DRY_STEPS = 180_000
"""From dispersed to rest in a vacuum."""
DRAGGED_STEPS = 20_000
BISECTIONS = 10
FEW, FALLING = 8, 5_000
"""Particles and steps of a try whether a step is stable."""


def measured(folder: Path, repetitions: int = 3, dry_steps: int = DRY_STEPS) -> Iterator[dict]:
    """A row for each number of cores; LIGGGHTS on one, as 314 particles are too few for more."""
    states.make(folder, states.DILUTE)
    states.make(folder, states.SETTLED)
    dragged = _dragged(folder) if liggghts.available() else None
    for cores in process.numbers_of_cores():
        yield _row(folder, cores, repetitions, dry_steps, dragged)


def _row(folder: Path, cores: int, repetitions: int, dry_steps: int, dragged: dict | None) -> dict:
    state, box = states.load(folder, states.DILUTE)
    position, velocity = np.asarray(state.position), np.asarray(state.velocity)
    ours, theirs = [], []
    with Process("curve", {}, cores) as asked:
        of_run = asked.answer()
        for _ in range(repetitions):
            ours.append(asked.again()["seconds"])
            if dragged:
                theirs.append(liggghts.run(position, velocity, box, steps=dry_steps).seconds)
    row = {"cores": cores, **of_run, "seconds": timing.spread(ours)}
    if not dragged:
        return row
    step = dragged["largest_step"]
    return {
        **row,
        "dry": {
            "steps": dry_steps,
            "seconds": timing.spread(theirs),
            "over_ours": timing.ratios(theirs, ours),
        },
        "dragged": {**dragged, "seconds": of_run["duration"] / step * dragged["seconds_per_step"]},
    }


def _dragged(folder: Path) -> dict:
    """The largest step with the drag of case2, s, and what one takes in a bed."""
    own = states.recipe().parameters()
    gamma = float(drag.coefficient(own))
    mass = float(particle.mass(own))
    least, most = 0.5 * mass / gamma, 10.0 * mass / gamma
    for _ in range(BISECTIONS):
        middle = (least * most) ** 0.5
        least, most = (middle, most) if _falls(middle, gamma) else (least, middle)
    state, box = states.load(folder, states.SETTLED)
    there = np.asarray(state.position), np.asarray(state.velocity)
    # Shorter: contacts add to what the drag asks for, and a step takes as long whatever its length.
    run = liggghts.run(*there, box, steps=DRAGGED_STEPS, time_step=0.5 * least, drag=gamma)
    return {
        "largest_step": least,
        "two_masses_over_drag": 2.0 * mass / gamma,
        "seconds_per_step": run.seconds / DRAGGED_STEPS,
    }


def _falls(time_step: float, gamma: float) -> bool:
    """Whether a few particles far from each other come to fall at the speed at which they should.

    LIGGGHTS knows of no buoyancy: they weigh what they do in a vacuum.
    """
    row = np.arange(FEW) % 2, np.arange(FEW) // 2 % 2, np.arange(FEW) // 4
    position = 1e-5 * (np.stack(row, axis=1) + 0.7)
    box = Box((2.5e-5, 2.5e-5, 5e-5))
    # Shaken sideways: drag that overshoots lets that grow.
    velocity = np.tile([1e-9, 0.0, 0.0], (FEW, 1))
    try:
        end = liggghts.run(
            position, velocity, box, steps=FALLING, time_step=time_step, drag=gamma
        ).velocity
    except RuntimeError:  # lost
        return False
    own = states.dry()
    expected = -float(particle.mass(own) * own.gravity) / gamma
    return bool(np.isfinite(end).all() and np.abs(end - [0.0, 0.0, expected]).max() < -expected)


def here() -> Iterator[dict[str, float]]:
    """First what the run is, then how long it takes, again and again."""
    sheet = states.recipe()
    run = mrjax.sedimentation(sheet).run
    yield {"duration": float(run.times[0, -1]), "steps": int(run.steps)}
    while True:
        yield {"seconds": timing.seconds(lambda: mrjax.sedimentation(sheet).run)}


if __name__ == "__main__":
    process.serve(here)
