"""Runs of a given time that can be kept on disk part by part."""

from pathlib import Path
from typing import Unpack

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.interruption import interruptible
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.dem.plan import System
from mrjax.io import state_file
from mrjax.io.checkpoint import Checkpoint, Sequence, refuse_foreign
from mrjax.simulation.options import RunKeywords, RunOptions, takes_run_options
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run
from mrjax.simulation.progress import watched

STEPS_IN_A_PART = 10**8
"""Steps times particles in a part that is kept on disk; it takes some seconds."""


@takes_run_options
def follow(
    state: State,
    parameters: Parameters,
    box: Box,
    *,
    duration: float,
    frames: int = 1,
    checkpoint: str | Path | None = None,
    **options: Unpack[RunKeywords],
) -> Run:
    """Follows the particles for a given time, as `simulate` does, and can keep the run on disk.

    The run has the same bits as that of `simulate`. The call cannot be traced.

    Args:
      state, parameters, box, duration, frames: as for `simulate`.
      checkpoint: folder that keeps the run every few seconds. A second call with this folder and
        the same arguments, on the same machine, continues the run, which ends with the same bits.
        The folder stays until it is removed.
      options: step, neighbour list, local drag, forces, records and progress: `RunOptions`.

    Raises:
      InputError: an argument cannot be used, or the checkpoint is of another run.
      SimulationError: the run is not to be trusted. The error says when and to which particle it
        happened, and carries the state at the beginning of that frame.
    """
    chosen = RunOptions(**options)
    refuse_foreign(checkpoint)
    system = System.of(state, parameters, box, chosen.hindrance, chosen.forces)
    with interruptible() as stop:
        plan = plan_run(system, chosen, duration=duration, frames=frames)
        sequence = None
        if checkpoint is not None:
            work = Checkpoint.open(
                Path(checkpoint),
                parameters=parameters,
                box=box,
                duration=duration,
                frames=frames,
                time_step=chosen.time_step,
                hindrance=system.hindrance,
                forces=system.forces,
                state=state_file.arrays(state),
                setup=plan,
            )
            sequence = work.sequence("part")
        pieces = PiecewiseRun(system, plan, stop=stop)
        resume(pieces, sequence)
        with watched("follow", pieces, chosen.progress) as watch:
            while pieces.place.frame < plan.schedule.frames:
                pieces.advance_to(*_end_of_part(pieces), watch)
                store(pieces, sequence)
        return pieces.run()


def resume(pieces: PiecewiseRun, sequence: Sequence | None) -> None:
    """Continues from the stored parts of a run, if there are any.

    Raises:
      InputError: the parts are of another version.
    """
    if sequence is not None:
        recorded, place = sequence.resumed()
        try:
            if place is not None:
                pieces.restore(recorded, place)
        except KeyError as error:
            raise InputError(
                f"a checkpoint without {error} is of another version of mrjax; take it away"
            ) from None


def store(pieces: PiecewiseRun, sequence: Sequence | None) -> None:
    """Adds a part to the stored parts of a run, if it is kept on disk."""
    if sequence is not None:
        sequence.append(*pieces.kept())


def _end_of_part(pieces: PiecewiseRun) -> tuple[int, int]:
    """Frame and interval at which the present part ends: whole frames, or a part of one."""
    schedule, place = pieces.plan.schedule, pieces.place
    most = max(1, STEPS_IN_A_PART // (schedule.steps * pieces.particles))
    remaining = schedule.intervals - place.interval
    if most < remaining:
        return place.frame, place.interval + most
    frames = 1 if place.interval else max(1, most // schedule.intervals)
    return min(place.frame + frames, pieces.frames), 0
