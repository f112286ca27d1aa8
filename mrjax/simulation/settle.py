"""The whole sedimentation curve: a run, or an ensemble of runs, until the bed rests."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

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
from mrjax.core.tracing import drop_tracers, evaluated_or_none
from mrjax.dem.force_bounds import force_bounds, plan_reach
from mrjax.dem.forces import noises
from mrjax.dem.kick_bounds import DEVIATIONS, RandomMotion
from mrjax.dem.plan import RunPlan, System
from mrjax.io import state_file
from mrjax.io.checkpoint import Checkpoint, refuse_foreign
from mrjax.laws import particle
from mrjax.simulation import estimates, processes
from mrjax.simulation.follow import resume, store
from mrjax.simulation.options import RunKeywords, RunOptions, takes_run_options
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run
from mrjax.simulation.progress import announce

ALONG = ("heights", "mean_velocity", "mean_speed", "trajectory")
"""Fields of a run with one entry for every frame, beside the times."""
FRAMES_AT_ONCE = 10
FRAMES_AT_REST = 3
SCATTER = 2.0
"""Fall of the mean height in `FRAMES_AT_ONCE` frames, over the scatter that random kicks give it,
below which a suspension in Brownian motion has come to its equilibrium."""
PATIENCE = 20.0
"""Duration after which a bed is given up, over the expected duration."""
SKIN = 0.05
"""Reach of the neighbour list beyond contact, contact diameters."""
SHORTER = 0.7
"""Factor on a step that turned out too long."""


@takes_run_options
def settle(
    states: State | Sequence[State],
    parameters: Parameters,
    box: Box,
    *,
    frames: int = 200,
    rest: float = 1e-3,
    longest: float | None = None,
    checkpoint: str | Path | None = None,
    **options: Unpack[RunKeywords],
) -> Run:
    """Follows a suspension until its bed rests.

    With random forces it never does. The run then ends at an equilibrium: when the mean height
    falls no more, within ten frames, than by `rest` or by twice its random scatter in that time.

    At the stiffness of real particles this takes 1e12 steps; give parameters from `softened`. The
    call cannot be traced. Gradients of the curve are those of `simulate` with `duration`, `frames`
    and `time_step` of the run that this returns. If `jax.distributed` is initialised, every process
    makes this call with the same states, follows its share of them, and gets all runs.

    Args:
      states: state at which the particles start; or several such states, of equally many particles,
        which are followed together until all of them rest.
      parameters: parameters of particles, fluid and contact.
      box: the container.
      frames: number of frames recorded in the expected duration; a run that takes longer has more.
      rest: mean speed of the particles at rest, over the speed at which a particle falls alone, or
        over the greatest mean speed of the run if that is less.
      longest: duration after which to give up, s; by default 20 times the expected one.
      checkpoint: folder that keeps the runs every ten frames. A second call with this folder and
        the same arguments, on the same machine, continues the runs, which end with the same bits.
        The folder stays until it is removed.
      options: step, neighbour list, local drag, forces, records and progress: `RunOptions`; here
        `skin` is 0.05 by default.

    Returns:
      The run; for several states its arrays have a leading axis.

    Raises:
      InputError: an argument cannot be used, or the checkpoint is of other runs.
      SimulationError: the bed did not come to rest, or the run is not to be trusted; the error
        carries the last good state.
    """
    chosen = RunOptions(**{"skin": SKIN, **options})  # type: ignore[arg-type] # of RunKeywords
    refuse_foreign(checkpoint)
    rest = checks.positive(rest, "rest", "times the falling speed")
    starts = list(states) if isinstance(states, Iterable) else [states]
    systems = [
        System.of(state, parameters, box, chosen.hindrance, chosen.forces) for state in starts
    ]
    settling = _expected(systems, chosen, frames, rest, longest)
    work = None
    if checkpoint is not None:
        work = _checkpoint(Path(checkpoint), systems, chosen, frames, settling)
    runs = _settled(systems, chosen, settling, work)
    return runs[0] if isinstance(states, State) else _stacked(runs)


@dataclass(frozen=True)
class _Settling:
    """Estimates for a settling suspension, and its criterion of rest."""

    interval: float  # between frames, s
    steps: float  # to rest, about
    time_step: float  # longest, s
    rest: float  # mean speed at rest, over the falling speed
    falling: float  # speed of a particle alone, m/s
    longest: float  # duration after which to give up, s
    random: RandomMotion | None  # None without random forces


def _expected(
    systems: list[System], options: RunOptions, frames: int, rest: float, longest: float | None
) -> _Settling:
    """Estimates for these suspensions.

    Raises:
      InputError: an argument cannot be used, or the suspensions do not settle.
    """
    if not systems or len({system.particles for system in systems}) > 1:
        raise InputError("states differ in their number of particles, or there are none")
    _, parameters, hindrance, box, forces = systems[0]
    particles, numbers = systems[0].particles, drop_tracers(parameters)
    ways = [estimates.ways(numbers, box, system.state.position) for system in systems]
    way = estimates.Way(*np.max(ways, axis=0))
    expectation, falling = estimates.duration(numbers, box, particles, way)
    interval = expectation / checks.whole(frames, "frames")
    longest = checks.positive(
        PATIENCE * expectation if longest is None else longest, "longest", "s"
    )
    if options.time_step is not None:
        time_step = checks.positive(options.time_step, "time_step", "s")
    else:
        bounds = force_bounds(systems[0], numbers, plan_reach(systems[0], numbers))
        step = estimates.step(
            numbers, box, particles, falling, hindrance, bounds, drop_tracers(noises(forces))
        )
        time_step = min(interval, step)
    steps = estimates.TIMES_FREE_FALL * expectation / time_step
    random = RandomMotion.of_run(forces, numbers, hindrance)
    return _Settling(interval, steps, time_step, rest, falling, longest, random)


def _checkpoint(
    folder: Path,
    systems: list[System],
    options: RunOptions,
    frames: int,
    settling: _Settling,
) -> Checkpoint:
    """The checkpoint of these runs.

    Raises:
      InputError: the checkpoint is of other runs, or there are several processes.
    """
    if processes.count() > 1:
        raise InputError("checkpoint: is kept by a single process; leave it out")
    _, parameters, hindrance, box, forces = systems[0]
    work = Checkpoint.open(
        folder,
        parameters=parameters,
        box=box,
        frames=frames,
        rest=settling.rest,
        longest=settling.longest,
        time_step=settling.time_step,
        skin=options.skin,
        rebuild_every=options.rebuild_every,
        hindrance=hindrance,
        forces=forces,
        trajectory=options.trajectory,
        states=[state_file.arrays(system.state) for system in systems],
    )
    work.claim()  # once, before threads would do so side by side
    return work


def _settled(
    systems: list[System], options: RunOptions, settling: _Settling, work: Checkpoint | None
) -> list[Run]:
    """All runs to rest, repeated with a shorter step if one is unstable."""
    threads = min(len(systems), processes.usable_cores())
    announce("settle", settling.steps * len(systems) / threads, systems[0].particles)
    attempt, time_step = 0, settling.time_step
    with interruptible() as stop:
        while True:
            plan = plan_run(
                systems[0],
                replace(options, time_step=time_step),
                duration=settling.interval * FRAMES_AT_ONCE,
                frames=FRAMES_AT_ONCE,
                touch=True,
            )
            follow = partial(
                _until_rest, plan, settling, options.progress, work, f"try-{attempt}", stop
            )
            results = processes.divided(partial(_side_by_side, follow, stop), systems)
            runs = [run for run in results if run is not None]
            if len(runs) == len(results):
                return runs
            time_step = SHORTER * plan.time_step
            attempt += 1


def _side_by_side(
    follow: Callable[[int, System], Run | None], stop: Stop, systems: Sequence[System]
) -> list[Run | None]:
    """Follows all suspensions in threads, one on each core; runs compute outside Python."""
    runs = [partial(follow, place, system) for place, system in enumerate(systems)]
    if len(runs) <= 1:
        return [run() for run in runs]
    return side_by_side(runs, processes.usable_cores(), stop)


def _until_rest(
    plan: RunPlan,
    settling: _Settling,
    progress: bool,
    work: Checkpoint | None,
    name: str,
    stop: Stop,
    place: int,
    system: System,
) -> Run | None:
    """The run until the particles rest, ten frames at a time; None if it needs a shorter step."""
    sequence = None if work is None else work.sequence(f"{name}-start-{place}")
    pieces = PiecewiseRun(system, plan, stop=stop)
    resume(pieces, sequence)
    with _bar(progress, place) as bar:
        while not (pieces.place.frame and _rests(pieces, settling, bar)):
            try:
                pieces.advance(FRAMES_AT_ONCE)
            except SimulationError as error:
                if error.faults == Fault.UNSTABLE:
                    return None
                raise
            store(pieces, sequence)
    return pieces.run()


def _rests(pieces: PiecewiseRun, settling: _Settling, bar: tqdm) -> bool:
    """True if the particles rest by now; updates the progress bar.

    Raises:
      SimulationError: they still move after the longest time.
    """
    speed = pieces.mean_speed
    fastest, time = speed.max(), pieces.place.frame * pieces.frame_length
    slow = settling.rest * min(settling.falling, fastest)
    share = speed[-1] / fastest if fastest > 0.0 else 0.0
    bar.set_postfix_str(f"{time:.3g} s, {share:.2%} of the greatest speed", False)
    bar.update(max(bar.n, _share(speed[-1], fastest, slow)) - bar.n)
    if settling.random is not None:
        if _balanced(pieces, settling.random, slow):
            return True
    elif (speed[-FRAMES_AT_REST:] <= slow).all():
        return True
    if time >= settling.longest:
        raise SimulationError(
            f"after {time:.4g} s the particles still move at {speed[-1]:.3g} m/s, more "
            f"than {slow:.3g} m/s: give a larger `longest` or `rest`"
        )
    return False


def _balanced(pieces: PiecewiseRun, random: RandomMotion, slow: float) -> bool:
    """True if the mean height has fallen in the last frames by no more than its scatter.

    Args:
      pieces: the run, with at least `FRAMES_AT_ONCE` frames.
      random: random motion of the particles.
      slow: mean speed of rest, m/s.
    """
    weight = evaluated_or_none(particle.net_weight, pieces.system.parameters)
    downwards = np.sign(np.broadcast_to(weight, pieces.particles))
    before, now = pieces.recording.mean_height(downwards)[[-1 - FRAMES_AT_ONCE, -1]]
    time = FRAMES_AT_ONCE * pieces.frame_length
    deviation = (random.kick(time) or 0.0) / DEVIATIONS
    return before - now <= slow * time + SCATTER * deviation / np.sqrt(pieces.particles)


def _stacked(runs: list[Run]) -> Run:
    """Runs stacked along a leading axis; those that rest early repeat their last frame."""
    longest = max(runs, key=lambda run: len(run.times))
    histories = [run.state.contacts for run in runs]
    slots = max(0 if contacts is None else contacts.partner.shape[1] for contacts in histories)

    def padded_run(run: Run) -> Run:
        missing = len(longest.times) - len(run.times)

        def padded(rows: Array) -> Any:
            return jnp.pad(rows, [(0, missing)] + [(0, 0)] * (rows.ndim - 1), mode="edge")

        return replace(
            run,
            times=longest.times,
            **{name: jax.tree.map(padded, getattr(run, name)) for name in ALONG},
            state=replace(run.state, contacts=widened(run.state.contacts, slots)),
            time_step=longest.time_step,
            steps=longest.steps,
        )

    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(padded_run, runs))


def _share(speed: float, fastest: float, slow: float) -> float:
    """Share of the way to rest: the logarithm of the speed falls about linearly in time."""
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
