"""A run followed part after part: kept on disk as it goes, and with a last good state if it fails.

A part begins with the state in which the one before ended. One that failed for want of room is
repeated with more.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax import checks, history, state_file
from mrjax.box import Box
from mrjax.checkpoint import Checkpoint, Sequence, refuse_foreign
from mrjax.failure import failure
from mrjax.hindrance import Hindrance, as_tree
from mrjax.parameters import Parameters
from mrjax.run import Run
from mrjax.scan import Setup, attempt
from mrjax.simulate import prepared
from mrjax.state import State
from mrjax.trajectory import Trajectory

ALONG = ("heights", "mean_velocity", "mean_speed", "trajectory")
"""What a run has one of for every frame, beside the times."""
RECORDED = (
    *("times", "heights", "radius", "mean_velocity", "mean_speed"),
    *("deepest_overlap", "coating_overlap", "fault", "rising"),
)
"""Arrays of a part beside its state and trajectory."""
MOST_AT_ONCE = 10**8
"""Steps of one particle in a part of a run of given duration: some seconds."""


def follow(
    state: State,
    parameters: Parameters,
    box: Box,
    *,
    duration: float,
    frames: int = 1,
    time_step: float | None = None,
    skin: float = 0.1,
    rebuild_every: int | None = None,
    hindrance: Hindrance | None = None,
    trajectory: bool = False,
    checkpoint: str | Path | None = None,
) -> Run:
    """`simulate` for long runs: in parts of some seconds each, which can be kept on disk.

    Not for traced calls. Where a run fails, the error carries the state before the part that
    failed, and says when and to which particle it happened.

    Args:
      state, parameters, box, duration, frames, time_step, skin, rebuild_every, hindrance: as for
        `simulate`.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      checkpoint: folder that keeps the parts. Called again with it and the same arguments, on the
        same machine, the run goes on, and ends with the same bits. It stays until it is removed.

    Raises:
      InputError: an argument that cannot be used, or a checkpoint of another run.
      SimulationError: the run is not to be trusted.
    """
    refuse_foreign(checkpoint)
    checks.of_run(state, parameters, box)
    hindrance = as_tree(hindrance)
    whole = prepared(
        state,
        parameters,
        box,
        duration=duration,
        frames=frames,
        time_step=time_step,
        skin=skin,
        hindrance=hindrance,
        rebuild_every=rebuild_every,
        trajectory=trajectory,
    )
    kept = None
    if checkpoint is not None:
        work = Checkpoint.of_work(
            Path(checkpoint),
            parameters=parameters,
            box=box,
            duration=duration,
            frames=frames,
            time_step=time_step,
            hindrance=hindrance,
            state=state_file.arrays(state),
            setup=whole,
        )
        kept = Kept(work.sequence("part"))
    setup, count, each = _divided(whole, state.particles)
    following = stages(state, parameters, hindrance, box, setup, kept)
    run = joined([next(following) for _ in range(count)], setup)
    chosen = {name: jax.tree.map(lambda rows: rows[::each], getattr(run, name)) for name in ALONG}
    return replace(run, times=run.times[::each], **chosen)


def _divided(setup: Setup, particles: int) -> tuple[Setup, int, int]:
    """One part of a run, how many there are, and how many of their frames are one of the run's."""
    cuts = setup.cuts
    work = cuts.intervals * cuts.steps * particles
    if cuts.frames * work <= MOST_AT_ONCE:
        return setup, 1, 1
    if work <= MOST_AT_ONCE:
        # Parts of equal length share their compiled program.
        most = MOST_AT_ONCE // work
        frames = max(n for n in range(1, most + 1) if cuts.frames % n == 0)
        count, each, cuts = cuts.frames // frames, 1, replace(cuts, frames=frames)
    else:
        each = min(cuts.intervals, math.ceil(work / MOST_AT_ONCE))
        count = cuts.frames * each
        cuts = replace(cuts, frames=1, intervals=math.ceil(cuts.intervals / each))
    return replace(setup, duration=setup.duration / count, cuts=cuts), count, each


@dataclass(frozen=True)
class Kept:
    """The parts of one run on disk: what each recorded, and the state after the last."""

    sequence: Sequence

    def parts(self, like: State) -> tuple[list[dict[str, np.ndarray]], State]:
        """What was recorded so far, and the state from which to go on: this one, if nothing was."""
        recorded, last = self.sequence.resumed()
        after = like if last is None else state_file.of_arrays(last, like.contact_diameter)
        return recorded, after

    def keep(self, part: Run, state: State) -> None:
        """Adds a part, and the state from which to go on."""
        self.sequence.append(_recorded(part), state_file.arrays(state))


def stages(
    state: State,
    parameters: Parameters,
    hindrance: Hindrance | None,
    box: Box,
    setup: Setup,
    kept: Kept | None = None,
) -> Iterator[Run]:
    """Part after part, without end; where one has a fault that can be mended, it is repeated.

    Parts that are kept come first, without being computed; of those only the last has its state.

    Raises:
      SimulationError: a fault that cannot be mended (`failure`).
    """
    now = ready(state, box, setup)
    recorded, now = ([], now) if kept is None else kept.parts(now)
    time = 0.0
    for number in itertools.count():
        if number < len(recorded):
            part = _as_recorded(recorded[number], now, box, setup)
            after = now
        else:
            part = _part(now, parameters, hindrance, box, setup)
            after = now if part.fault else part.state
            if kept is not None:
                kept.keep(part, after)
        if part.fault:
            mended = setup.mended(part)
            if mended is None:
                raise failure(now, parameters, hindrance, box, setup, part, time)
            setup = mended
            continue
        yield part
        now, time = after, time + setup.duration


@partial(jax.jit, static_argnames=("box", "setup"))
def _part(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: Setup
) -> Run:
    """The next frames."""
    return attempt(state, parameters, hindrance, box, setup)


def _recorded(part: Run) -> dict[str, Array]:
    """All arrays of a part but its state."""
    found = {name: getattr(part, name) for name in RECORDED}
    if part.trajectory is not None:
        moved = part.trajectory
        found |= {f"trajectory_{one.name}": getattr(moved, one.name) for one in fields(moved)}
    return found


def _as_recorded(arrays: dict[str, np.ndarray], state: State, box: Box, setup: Setup) -> Run:
    """The part of which these arrays were recorded, with a state."""
    moved = None
    if setup.trajectory:
        moved = Trajectory(
            *(jnp.asarray(arrays[f"trajectory_{one.name}"]) for one in fields(Trajectory))
        )
    return Run(
        **{name: jnp.asarray(arrays[name]) for name in RECORDED},
        state=state,
        box=box,
        time_step=setup.duration / setup.cuts.total,
        steps=setup.cuts.total,
        trajectory=moved,
    )


def ready(state: State, box: Box, setup: Setup) -> State:
    """The state with room for the memory that the run will give it: one program for all parts."""
    if state.contacts is not None:
        return state
    blank = history.blank(
        state.particles,
        setup.plan.capacity + 2 * len(box.walled_axes),
        state.position.dtype,
        sliding=setup.laws.sliding,
        rolling=setup.laws.rolling,
    )
    return replace(state, contacts=blank)


def joined(parts: list[Run], setup: Setup) -> Run:
    """One run of parts that follow each other."""

    def along(name: str) -> Any:
        return jax.tree.map(
            lambda first, *others: jnp.concatenate([first, *(rows[1:] for rows in others)]),
            *(getattr(part, name) for part in parts),
        )

    def deepest(name: str) -> Any:
        return jnp.max(jnp.stack([getattr(part, name) for part in parts]))

    last, frames = parts[-1], len(parts) * setup.cuts.frames
    times = np.linspace(0.0, len(parts) * setup.duration, frames + 1)
    return replace(
        last,
        times=jnp.asarray(times, last.times.dtype),
        **{name: along(name) for name in ALONG},
        **{name: deepest(name) for name in ("deepest_overlap", "coating_overlap")},
        steps=sum(part.steps for part in parts),
    )
