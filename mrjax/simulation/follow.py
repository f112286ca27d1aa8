"""`simulate` for long runs, which can be kept on disk part by part."""

from pathlib import Path

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.interruption import interruptible
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.io import state_file
from mrjax.io.checkpoint import Checkpoint, Sequence, refuse_foreign
from mrjax.laws.hindrance import Hindrance, as_tree
from mrjax.simulation.pieces import Pieces
from mrjax.simulation.progress import watched
from mrjax.simulation.simulate import plan_run

MOST_AT_ONCE = 10**8
"""Steps of one particle in a part that is kept: some seconds."""


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
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> Run:
    """`simulate` for long runs, which can be kept on disk; the same bits.

    Not for traced calls.

    Args:
      state, parameters, box, duration, frames, time_step, skin, rebuild_every, hindrance: as for
        `simulate`.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      progress: whether to show a progress bar, on standard error.
      checkpoint: folder that keeps the run every few seconds. Called again with it and the same
        arguments, on the same machine, the run goes on, and ends with the same bits. It stays until
        it is removed.

    Raises:
      InputError: an argument that cannot be used, or a checkpoint of another run.
      SimulationError: the run is not to be trusted. The error says when and to which particle it
        happened, and carries the state at the beginning of that frame.
    """
    refuse_foreign(checkpoint)
    checks.of_run(state, parameters, box)
    hindrance = as_tree(hindrance)
    with interruptible() as stop:
        setup = plan_run(
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
                setup=setup,
            )
            kept = work.sequence("part")
        pieces = Pieces(state, parameters, hindrance, box, setup, stop=stop)
        resume(pieces, kept)
        with watched("follow", pieces, progress) as watch:
            while pieces.place.frame < setup.cuts.frames:
                pieces.go_to(*_end_of_part(pieces), watch)
                keep(pieces, kept)
        return pieces.run()


def resume(pieces: Pieces, kept: Sequence | None) -> None:
    """Goes on from what is kept of a run, if anything is."""
    if kept is not None:
        recorded, place = kept.resumed()
        try:
            if place is not None:
                pieces.restore(recorded, place)
        except KeyError as error:
            raise InputError(
                f"a checkpoint without {error} is of another version of mrjax; take it away"
            ) from None


def keep(pieces: Pieces, kept: Sequence | None) -> None:
    """Adds to what is kept of a run, if it is to be kept."""
    if kept is not None:
        kept.append(*pieces.kept())


def _end_of_part(pieces: Pieces) -> tuple[int, int]:
    """Frame and interval at which the present part ends: whole frames, or a part of one."""
    cuts, place = pieces.setup.cuts, pieces.place
    most = max(1, MOST_AT_ONCE // (cuts.steps * pieces.particles))
    left = cuts.intervals - place.interval
    if most < left:
        return place.frame, place.interval + most
    frames = 1 if place.interval else max(1, most // cuts.intervals)
    return min(place.frame + frames, pieces.frames), 0
