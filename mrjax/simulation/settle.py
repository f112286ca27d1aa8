"""The whole sedimentation curve: a run, or an ensemble of runs, until the bed rests."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError, SimulationError
from mrjax.core.interruption import Stop, interruptible, side_by_side
from mrjax.core.parameters import Parameters
from mrjax.core.run import Fault, Run
from mrjax.core.state import State, widened
from mrjax.core.tracing import drop_tracers
from mrjax.dem.scan import RunPlan
from mrjax.io import state_file
from mrjax.io.checkpoint import Checkpoint, refuse_foreign
from mrjax.laws.hindrance import Hindrance, as_tree
from mrjax.simulation import estimates, processes
from mrjax.simulation.follow import keep, resume
from mrjax.simulation.pieces import Pieces
from mrjax.simulation.progress import announce
from mrjax.simulation.simulate import plan_run

ALONG = ("heights", "mean_velocity", "mean_speed", "trajectory")
"""What a run has one of for every frame, beside the times."""
FRAMES_AT_ONCE = 10
FRAMES_AT_REST = 3
PATIENCE = 20.0
"""Times the expected duration after which a bed is given up."""
SHORTER = 0.7
"""Factor on a step that turned out too long."""


def settle(
    states: State | Sequence[State],
    parameters: Parameters,
    box: Box,
    *,
    frames: int = 200,
    rest: float = 1e-3,
    longest: float | None = None,
    time_step: float | None = None,
    skin: float = 0.05,
    rebuild_every: int | None = None,
    hindrance: Hindrance | None = None,
    progress: bool = False,
    trajectory: bool = False,
    checkpoint: str | Path | None = None,
) -> Run:
    """Follows a suspension until its bed rests.

    At the stiffness of real particles that takes 1e12 steps: give parameters that `softened` made.
    Not for traced calls. Gradients of the curve are those of `simulate` with `duration`, `frames`
    and `time_step` from the run that this returns. Where `jax.distributed` is initialised, every
    process makes this call with the same states, follows its share of them, and gets all runs.

    Args:
      states: where the particles start; or several such states, of as many particles each, which
        are followed together until all of them rest.
      parameters: of particles, fluid and contact.
      box: the container.
      frames: recorded in the expected duration; a run has more where it takes longer.
      rest: mean speed of the particles at which they rest, over that at which one falls alone, or
        over the greatest there was, if that is less.
      longest: duration after which to give up, s; left out, 20 times the expected one.
      time_step: longest step, s; left out, what a random bed under its weight is stable at.
      skin, rebuild_every, hindrance: as for `simulate`.
      progress: whether to show a progress bar, on standard error.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      checkpoint: folder that keeps every ten frames. Called again with it and the same arguments,
        on the same machine, the runs go on, and end with the same bits. It stays until it is
        removed.

    Returns:
      The run, its observables with a leading axis for several states.

    Raises:
      InputError: an argument that cannot be used, or a checkpoint of other runs.
      SimulationError: the bed did not come to rest, or the run is not to be trusted; the error
        carries the last good state.
    """
    refuse_foreign(checkpoint)
    hindrance = as_tree(hindrance)
    rest = checks.positive(rest, "rest", "times the falling speed")
    each = list(states) if isinstance(states, Iterable) else [states]
    for state in each:
        checks.of_run(state, parameters, box)
    if not each or len({state.particles for state in each}) > 1:
        raise InputError("states differ in their number of particles, or there are none")
    particles = each[0].particles
    numbers = drop_tracers(parameters)
    far = [estimates.ways(numbers, box, state.position) for state in each]
    way = estimates.Way(*np.max(far, axis=0))
    expectation, falling = estimates.duration(numbers, box, particles, way)
    interval = expectation / checks.whole(frames, "frames")
    longest = checks.positive(
        PATIENCE * expectation if longest is None else longest, "longest", "s"
    )
    if time_step is not None:
        time_step = checks.positive(time_step, "time_step", "s")
    else:
        time_step = min(interval, estimates.step(numbers, box, particles, falling, hindrance))
    kept = None
    if checkpoint is not None:
        if processes.count() > 1:
            raise InputError("checkpoint: is kept by a single process; leave it out")
        kept = Checkpoint.of_work(
            Path(checkpoint),
            parameters=parameters,
            box=box,
            frames=frames,
            rest=rest,
            longest=longest,
            time_step=time_step,
            skin=skin,
            rebuild_every=rebuild_every,
            hindrance=hindrance,
            trajectory=trajectory,
            states=[state_file.arrays(state) for state in each],
        )
        kept.claim()  # before threads would do so at once
    steps = estimates.TIMES_FREE_FALL * expectation / time_step
    announce("settle", steps * len(each) / min(len(each), processes.usable_cores()), particles)
    tried = 0
    with interruptible() as stop:
        while True:
            setup = plan_run(
                each[0],
                parameters,
                box,
                duration=interval * FRAMES_AT_ONCE,
                frames=FRAMES_AT_ONCE,
                time_step=time_step,
                skin=skin,
                hindrance=hindrance,
                rebuild_every=rebuild_every,
                touch=True,
                trajectory=trajectory,
            )
            at = setup, (rest, falling), longest
            follow = partial(
                _until_rest, parameters, hindrance, box, *at, progress, kept, f"try-{tried}", stop
            )
            found = processes.divided(partial(_side_by_side, follow, stop), each)
            runs = [run for run in found if run is not None]
            if len(runs) == len(found):
                return runs[0] if isinstance(states, State) else _stacked(runs)
            time_step = SHORTER * setup.time_step
            tried += 1


def _side_by_side(
    follow: Callable[[int, State], Run | None], stop: Stop, states: Sequence[State]
) -> list[Run | None]:
    """Every state followed, one on each processor: a run is busy outside Python."""
    runs = [partial(follow, place, state) for place, state in enumerate(states)]
    if len(runs) <= 1:
        return [run() for run in runs]
    return side_by_side(runs, processes.usable_cores(), stop)


def _until_rest(
    parameters: Parameters,
    hindrance: Hindrance | None,
    box: Box,
    setup: RunPlan,
    speeds: tuple[float, float],
    longest: float,
    progress: bool,
    checkpoint: Checkpoint | None,
    called: str,
    stop: Stop,
    place: int,
    state: State,
) -> Run | None:
    """Ten frames after ten until the particles rest; None where that takes a shorter step."""
    kept = None if checkpoint is None else checkpoint.sequence(f"{called}-start-{place}")
    pieces = Pieces(state, parameters, hindrance, box, setup, stop=stop)
    resume(pieces, kept)
    with _bar(progress, place) as bar:
        while not (pieces.place.frame and _rests(pieces, speeds, longest, bar)):
            try:
                pieces.go_on(FRAMES_AT_ONCE)
            except SimulationError as error:
                if error.faults == Fault.UNSTABLE:
                    return None
                raise
            keep(pieces, kept)
    return pieces.run()


def _rests(pieces: Pieces, speeds: tuple[float, float], longest: float, bar: tqdm) -> bool:
    """Whether the particles rest by now, which the bar is told, too.

    Raises:
      SimulationError: they still move after the longest time.
    """
    (rest, falling), speed = speeds, pieces.mean_speed
    fastest, time = speed.max(), pieces.place.frame * pieces.frame_length
    slow = rest * min(falling, fastest)
    left = speed[-1] / fastest if fastest > 0.0 else 0.0
    bar.set_postfix_str(f"{time:.3g} s, {left:.2%} of the greatest speed", False)
    bar.update(max(bar.n, _share(speed[-1], fastest, slow)) - bar.n)
    if (speed[-FRAMES_AT_REST:] <= slow).all():
        return True
    if time >= longest:
        raise SimulationError(
            f"after {time:.4g} s the particles still move at {speed[-1]:.3g} m/s, more "
            f"than {slow:.3g} m/s: give a larger `longest` or `rest`"
        )
    return False


def _stacked(runs: list[Run]) -> Run:
    """Runs side by side; those that rest early keep their last frame."""
    longest = max(runs, key=lambda run: len(run.times))
    held = [run.state.contacts for run in runs]
    slots = max(0 if contacts is None else contacts.partner.shape[1] for contacts in held)

    def alike(run: Run) -> Run:
        missing = len(longest.times) - len(run.times)

        def lasting(rows: Array) -> Any:
            return jnp.pad(rows, [(0, missing)] + [(0, 0)] * (rows.ndim - 1), mode="edge")

        return replace(
            run,
            times=longest.times,
            **{name: jax.tree.map(lasting, getattr(run, name)) for name in ALONG},
            state=replace(run.state, contacts=widened(run.state.contacts, slots)),
            time_step=longest.time_step,
            steps=longest.steps,
        )

    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(alike, runs))


def _share(speed: float, fastest: float, slow: float) -> float:
    """Share of the way to rest: speeds fall by about as much in every second, in logarithms."""
    if not speed > slow:
        return 1.0
    return float(np.clip(np.log(fastest / speed) / np.log(fastest / slow), 0.0, 1.0))


def _bar(progress: bool, place: int) -> tqdm:
    return tqdm(
        total=1.0,
        position=place,
        desc="settling",
        disable=not progress,
        bar_format="{desc} {percentage:3.0f} % |{bar:20}| {remaining} left{postfix}",
    )
