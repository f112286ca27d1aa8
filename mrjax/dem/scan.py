"""Compiled loops over intervals and frames: a scan for traced calls, `while` loops for other calls.

The loops work in reduced units, with the contact radius as unit of length and the step as unit of
time. In a traced call a fault sets all numbers to NaN. In other calls the caller repeats the run
with larger buffers, or more frequent rebuilds, where that repairs the fault.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.randomness import RandomStream
from mrjax.core.run import Run
from mrjax.dem import sorting
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.engine import Engine, Motion, Observed, Outcome
from mrjax.dem.plan import EngineSettings, Matter, RunPlan, System
from mrjax.dem.reduced_units import reduced, run_in_si
from mrjax.dem.schedule import Schedule

REVERSE_MODE_BYTES = 2e8
"""Memory, in bytes, up to which reverse mode stores every interval; else it recomputes frames."""


def run_once(system: System, plan: RunPlan) -> Run:
    """Runs a plan once, as one traced program; sorts `SORT_FROM` or more particles in space."""
    if system.particles < sorting.SORT_FROM:
        return _run(system, plan)
    cell = plan.neighbour_list.cell * plan.unit_length
    order = sorting.spatial_order(system.state.position, system.box, cell)
    run = _run(sorting.permute_system(system, order), plan)
    back = jnp.argsort(order)
    return replace(
        run,
        heights=run.heights[:, back],
        radius=run.radius[back],
        state=sorting.permute_state(run.state, back),
        trajectory=jax.tree.map(lambda rows: rows[:, back], run.trajectory),
    )


def _run(system: System, plan: RunPlan) -> Run:
    """Converts to reduced units, scans over the frames, and converts back to SI."""
    begin, matter = reduced(system, plan)
    settings = plan.settings(system.box)
    end, observed, outcome = _scan(*begin, matter, settings=settings, schedule=plan.schedule)
    # A factor, not a `where`: so the derivatives of a faulty run are NaN too.
    good = (outcome.fault == 0) | (not plan.nan_on_fault)
    nan_if_faulty = jnp.where(good, 1.0, jnp.nan).astype(system.state.position.dtype)
    observed = observed.in_lab_units(plan.units, nan_if_faulty)
    return run_in_si(system, matter, end, observed, outcome, plan, nan_if_faulty)


@partial(jax.jit, static_argnames=("settings", "schedule"))
def _scan(
    position: Array,
    velocity: Array,
    spin: Array,
    history: ParticleHistory,
    memory: dict[str, Array],
    random: RandomStream | None,
    matter: Matter,
    *,
    settings: EngineSettings,
    schedule: Schedule,
) -> tuple[Motion, Observed, Outcome]:
    """Runs all frames; returns the end, the observables at the start and in frames, the outcome."""
    engine = Engine(matter, settings, position.shape[1], position.dtype)

    @partial(jax.checkpoint, prevent_cse=False)
    def interval(motion: Motion, _):
        return engine.interval(motion), None

    def frame(motion: Motion, _):
        motion, _ = lax.scan(interval, motion, length=schedule.intervals)
        return motion, engine.observed(motion)

    start = engine.begin(position, velocity, spin, history, memory, random)
    # Reverse mode stores the start of every interval if memory allows, else that of every frame.
    bytes_of_start = sum(leaf.nbytes for leaf in jax.tree.leaves(start))
    stored = schedule.frames * schedule.intervals * bytes_of_start
    at_start = engine.observed(start)
    end, after = lax.scan(
        frame if stored < REVERSE_MODE_BYTES else jax.checkpoint(frame, prevent_cse=False),
        start,
        length=schedule.frames,
    )
    observed = jax.tree.map(
        lambda first, later: jnp.concatenate([first[None], later]), at_start, after
    )
    return end, observed, engine.outcome(end)


@partial(jax.jit, static_argnames="settings")
def begin(
    position: Array,
    velocity: Array,
    spin: Array,
    history: ParticleHistory,
    memory: dict[str, Array],
    random: RandomStream | None,
    matter: Matter,
    *,
    settings: EngineSettings,
) -> tuple[Motion, Observed]:
    """Starts a motion and evaluates its observables, in reduced units; arguments (3, N) each."""
    engine = Engine(matter, settings, position.shape[1], position.dtype)
    motion = engine.begin(position, velocity, spin, history, memory, random)
    return motion, engine.observed(motion)


@partial(jax.jit, static_argnames=("rows", "settings"))
def advance(
    motion: Motion,
    matter: Matter,
    frames: Array,
    intervals: Array,
    *,
    rows: int,
    settings: EngineSettings,
) -> tuple[Motion, Observed, Array]:
    """Advances a motion by frames x intervals, or until the first interval with a fault.

    Args:
      motion, matter: motion and matter in reduced units.
      frames, intervals: number of frames, and of intervals in each; traced, so that one compiled
        program serves all values.
      rows: capacity of the output, in frames.
      settings: settings of the engine.

    Returns:
      the motion; the observables after every frame, (rows, ...); number of intervals without fault.
    """
    engine = _engine(motion, matter, settings)

    def good(motion: Motion) -> Array:
        return motion.fault == 0

    def interval(carry: tuple[Motion, Array]) -> tuple[Motion, Array]:
        motion, count = carry
        motion = engine.checked(engine.interval(motion))
        return motion, count + good(motion).astype(count.dtype)

    def frame(carry: tuple[Motion, Observed, Array, Array]) -> tuple:
        motion, observed, number, count = carry
        most = count + intervals
        motion, count = lax.while_loop(
            lambda carry: good(carry[0]) & (carry[1] < most), interval, (motion, count)
        )
        row = engine.observed(motion)
        observed = jax.tree.map(lambda leaf, now: leaf.at[number].set(now), observed, row)
        return motion, observed, number + 1, count

    nothing = jax.tree.map(
        lambda leaf: jnp.zeros((rows, *leaf.shape), leaf.dtype),
        jax.eval_shape(engine.observed, motion),
    )
    zero = jnp.zeros((), jnp.int32)
    motion, observed, _, count = lax.while_loop(
        lambda carry: good(carry[0]) & (carry[2] < frames), frame, (motion, nothing, zero, zero)
    )
    return motion, observed, count


@partial(jax.jit, static_argnames="settings")
def conclude(motion: Motion, matter: Matter, *, settings: EngineSettings) -> Outcome:
    """Evaluates the outcome of a motion, in reduced units."""
    return _engine(motion, matter, settings).outcome(motion)


def _engine(motion: Motion, matter: Matter, settings: EngineSettings) -> Engine:
    particles, dtype = motion.travelled.shape[1], motion.travelled.dtype
    return Engine(matter, settings, particles, dtype)
