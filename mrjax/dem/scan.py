"""The compiled loops over intervals and frames: one scan for traced calls, one loop for plain ones.

Lab units end at the door: the loops work with the contact radius as unit of length and the step as
unit of time. In a traced call a fault sets all numbers to NaN; the caller repairs what it can.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.run import Run
from mrjax.dem import sorting
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.engine import Engine, Motion, Observed, Outcome
from mrjax.dem.plan import EngineSettings, Matter, RunPlan, System
from mrjax.dem.reduced_units import reduced, run_in_si
from mrjax.dem.schedule import Schedule

REVERSE_MODE_BYTES = 2e8
"""Bytes that reverse mode may keep before it computes frames a second time."""


def run_once(system: System, plan: RunPlan) -> Run:
    """One run as planned, as one traced program; many particles are sorted in space."""
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
    """SI to reduced units, scan, and back."""
    begin, matter = reduced(system, plan)
    settings = plan.settings(system.box)
    end, observed, outcome = _scan(*begin, matter, settings=settings, schedule=plan.schedule)
    # A factor, not a choice: the derivative of what must not be used is NaN too.
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
    matter: Matter,
    *,
    settings: EngineSettings,
    schedule: Schedule,
) -> tuple[Motion, Observed, Outcome]:
    """The whole run: its end, what was observed at the start and in every frame, its outcome."""
    engine = Engine(matter, settings, position.shape[1], position.dtype)

    @partial(jax.checkpoint, prevent_cse=False)
    def interval(motion: Motion, _):
        return engine.interval(motion), None

    def frame(motion: Motion, _):
        motion, _ = lax.scan(interval, motion, length=schedule.intervals)
        return motion, engine.observed(motion)

    start = engine.begin(position, velocity, spin, history)
    # Reverse mode keeps every interval's beginning where there is room, else every frame's.
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
    matter: Matter,
    *,
    settings: EngineSettings,
) -> tuple[Motion, Observed]:
    """A motion and what is observed of it; (3, N) each, in reduced units."""
    engine = Engine(matter, settings, position.shape[1], position.dtype)
    motion = engine.begin(position, velocity, spin, history)
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
    """The motion after frames x intervals, or after the first interval with a fault.

    Args:
      motion, matter: in reduced units.
      frames, intervals: numbers of them; arguments, so that one program serves all.
      rows: frames that there is room for.
      settings: of the engine.

    Returns:
      the motion; what was observed after every frame, (rows, ...); intervals without a fault.
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
    """The outcome of a motion, in reduced units."""
    return _engine(motion, matter, settings).outcome(motion)


def _engine(motion: Motion, matter: Matter, settings: EngineSettings) -> Engine:
    particles, dtype = motion.travelled.shape[1], motion.travelled.dtype
    return Engine(matter, settings, particles, dtype)
