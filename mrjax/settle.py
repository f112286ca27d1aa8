"""The whole sedimentation curve: a run, or an ensemble of runs, until the bed rests."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from mrjax import checks, expected, history, particle, processes
from mrjax.box import Box
from mrjax.concrete import known
from mrjax.errors import InputError, SimulationError
from mrjax.hindrance import Hindrance
from mrjax.parameters import Parameters
from mrjax.run import Fault, Run
from mrjax.simulate import Setup, attempt, prepared
from mrjax.state import State

FRAMES_AT_ONCE = 10
FRAMES_AT_REST = 3
PATIENCE = 20.0
"""Times the expected duration after which a bed is given up."""
SHORTER = 0.7
"""Factor on a step that turned out too long."""
ALONG = ("heights", "mean_velocity", "mean_speed", "trajectory")
"""What a run has one of for every frame, beside the times."""


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

    Returns:
      The run, its observables with a leading axis for several states.

    Raises:
      InputError: an argument that cannot be used.
      SimulationError: the bed did not come to rest, or the run is not to be trusted.
    """
    rest = checks.positive(rest, "rest", "the falling speed")
    each = [states] if isinstance(states, State) else list(states)
    if not each or len({state.particles for state in each}) > 1:
        raise InputError("states differ in their number of particles, or there are none")
    particles = each[0].particles
    numbers, top = _numbers(parameters, each)
    expectation, falling = expected.duration(numbers, box, particles, top)
    interval = expectation / checks.whole(frames, "frames")
    longest = checks.positive(
        PATIENCE * expectation if longest is None else longest, "longest", "s"
    )
    if time_step is None:
        time_step = min(interval, expected.step(numbers, box, particles, falling, hindrance))
    while True:
        setup = prepared(
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
        speeds = rest, falling
        follow = partial(_until_rest, parameters, hindrance, box, setup, speeds, longest, progress)
        runs = processes.divided(partial(_side_by_side, follow), each)
        if all(int(run.fault) != Fault.UNSTABLE for run in runs):
            break
        time_step = SHORTER * setup.duration / setup.cuts.total
    for run in runs:
        run.check()
    return runs[0] if isinstance(states, State) else _stacked(runs)


def _numbers(parameters: Parameters, states: list[State]) -> tuple[Parameters, float]:
    """What is not traced of the parameters, and the top of the highest particle, m."""
    with jax.ensure_compile_time_eval():
        numbers = known(parameters)
        radius = np.asarray(particle.outer_radius(numbers))
    highest = (float(np.max(np.asarray(state.position)[:, 2] + radius)) for state in states)
    return numbers, max(highest)


def _side_by_side(follow: Callable[[int, State], Run], states: Sequence[State]) -> list[Run]:
    """Every state followed, one on each processor: a run is busy outside Python."""
    if len(states) <= 1:
        return [follow(0, state) for state in states]
    pool = ThreadPoolExecutor(processes.usable_cores())
    try:
        return list(pool.map(follow, range(len(states)), states))
    finally:  # an interruption does not wait for the others
        pool.shutdown(wait=False, cancel_futures=True)


def _until_rest(
    parameters: Parameters,
    hindrance: Hindrance | None,
    box: Box,
    setup: Setup,
    speeds: tuple[float, float],
    longest: float,
    progress: bool,
    place: int,
    state: State,
) -> Run:
    """Part after part until the particles rest; where one has a fault, that part alone."""
    rest, falling = speeds
    now, parts, fastest = _ready(state, box, setup), [], 0.0
    with _bar(progress, place) as bar:
        while True:
            part = _part(now, parameters, hindrance, box, setup)
            if part.fault:
                mended = setup.mended(part)
                if mended is None:
                    return part
                setup = mended
                continue
            parts.append(part)
            now, speed = part.state, np.asarray(part.mean_speed)
            fastest, time = max(fastest, speed.max()), setup.duration * len(parts)
            slow = rest * min(falling, fastest)
            bar.set_postfix_str(
                f"{time:.3g} s, {speed[-1] / fastest:.2%} of the greatest speed", False
            )
            bar.update(max(bar.n, _share(speed[-1], fastest, slow)) - bar.n)
            if (speed[-FRAMES_AT_REST:] < slow).all():
                return _joined(parts, setup)
            if time >= longest:
                raise SimulationError(
                    f"after {time:.4g} s the particles still move at {speed[-1]:.3g} m/s, more "
                    f"than {slow:.3g} m/s: give a larger `longest` or `rest`"
                )


@partial(jax.jit, static_argnames=("box", "setup"))
def _part(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: Setup
) -> Run:
    """The next frames."""
    return attempt(state, parameters, hindrance, box, setup)


def _ready(state: State, box: Box, setup: Setup) -> State:
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


def _joined(parts: list[Run], setup: Setup) -> Run:
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
            state=replace(run.state, contacts=history.widened(run.state.contacts, slots)),
            time_step=longest.time_step,
            steps=longest.steps,
        )

    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *map(alike, runs))


def _share(speed: float, fastest: float, slow: float) -> float:
    """Share of the way to rest: speeds fall by about as much in every second, in logarithms."""
    return float(np.clip(np.log(fastest / speed) / np.log(fastest / slow), 0.0, 1.0))


def _bar(progress: bool, place: int) -> tqdm:
    return tqdm(
        total=1.0,
        position=place,
        desc="settling",
        disable=not progress,
        bar_format="{desc} {percentage:3.0f} % |{bar:20}| {remaining} left{postfix}",
    )
