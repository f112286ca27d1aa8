"""A run as one compiled scan over frames and intervals, for calls that JAX traces.

Lab units end at the door: the scan works with the contact radius as unit of length and the step as
unit of time. A fault spoils every number, until it is mended or found to be beyond that.
"""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.run import Fault, Run
from mrjax.core.state import State
from mrjax.core.units import Units
from mrjax.dem import contact_history, sorting
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.engine import Engine, Motion, Observed, Outcome
from mrjax.dem.forces import ActiveLaws
from mrjax.dem.neighbours import Plan
from mrjax.dem.schedule import Schedule
from mrjax.laws import particle
from mrjax.laws.hindrance import Hindrance

REVERSE_MODE_BYTES = 2e8
"""Bytes that reverse mode may keep before it computes frames a second time."""


@dataclass(frozen=True)
class RunPlan:
    """What is decided before a run and fixes its compiled program."""

    duration: float  # s
    unit_length: float  # largest contact radius, m
    plan: Plan
    cuts: Schedule
    laws: ActiveLaws
    trajectory: bool
    spoil: bool = True  # whether a fault makes all numbers NaN

    @property
    def time_step(self) -> float:
        """Length of a step, s."""
        return self.duration / self.cuts.total

    @property
    def units(self) -> Units:
        """The largest contact radius as unit of length, the step as unit of time."""
        length = self.unit_length
        return Units(mass=1000.0 * length**3, length=length, time=self.time_step)

    def mended(self, fault: int, particles: int) -> "RunPlan | None":
        """With more room, where a run failed for want of it; None for other faults."""
        if overflow := fault & (Fault.PAIRS_DROPPED | Fault.CELLS_OVERFULL):
            return replace(self, plan=self.plan.grown(overflow, particles))
        if fault == Fault.OUTRAN_LIST and self.cuts.steps > 1:
            return replace(self, cuts=self.cuts.rebuilt_more_often())
        return None


def run_once(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: RunPlan
) -> Run:
    """One run with all decided, whose faults may be mended; of many particles in order of space."""
    if state.particles < sorting.SORT_FROM:
        return _in_reduced_units(state, parameters, hindrance, box, setup)
    places = sorting.spatial_order(state.position, box, setup.plan.cell * setup.unit_length)
    state, parameters = (
        sorting.permute_state(state, places),
        sorting.permute_parameters(parameters, places),
    )
    run = _in_reduced_units(state, parameters, hindrance, box, setup)
    back = jnp.argsort(places)
    return replace(
        run,
        heights=run.heights[:, back],
        radius=run.radius[back],
        state=sorting.permute_state(run.state, back),
        trajectory=jax.tree.map(lambda rows: rows[:, back], run.trajectory),
    )


def _in_reduced_units(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: RunPlan
) -> Run:
    """SI to reduced units, scan, and back."""
    begin = reduced(state, parameters, box, setup)
    end, observed, outcome = _scan(
        *begin,
        state.material,
        hindrance,
        box=box.scaled(1 / setup.unit_length),
        plan=setup.plan,
        cuts=setup.cuts,
        laws=setup.laws,
        trajectory=setup.trajectory,
    )
    # A factor, not a choice: the derivative of what must not be used is NaN too.
    good = (outcome.fault == 0) | (not setup.spoil)
    sound = jnp.where(good, 1.0, jnp.nan).astype(state.position.dtype)
    observed = observed.in_lab_units(setup.units, sound)
    return in_lab_units(state, begin[-1], end, observed, outcome, box, setup, sound)


def reduced(
    state: State, parameters: Parameters, box: Box, setup: RunPlan
) -> tuple[Array, Array, Array, ParticleHistory, Parameters]:
    """Positions, velocities and spins, (3, N) each, memories and parameters in reduced units."""
    units = setup.units
    notes = contact_history.from_state(
        state.contacts,
        state.position,
        slots=setup.plan.capacity + 2 * len(box.walled_axes),
        sliding=setup.laws.sliding,
        rolling=setup.laws.rolling,
        unit_length=units.length,
    )
    return (
        state.position.T / units.length,
        state.velocity.T / units.velocity,
        state.spin.T * units.time,
        notes,
        parameters.reduced(units).astype(state.position.dtype),
    )


def in_lab_units(
    state: State,
    parameters: Parameters,
    end: Motion,
    observed: Observed,
    outcome: Outcome,
    box: Box,
    setup: RunPlan,
    sound: Array,
) -> Run:
    """The run, in SI.

    Args:
      state: one that has the materials and the contact diameter of the particles.
      parameters: reduced.
      end: the motion at the end.
      observed: at the start and in every frame, in SI, with a leading axis (frames + 1, ...).
      outcome: of the whole.
      box: the container, m.
      setup: of the run.
      sound: 1, or NaN for a run that is not to be trusted, ().
    """
    units = setup.units
    last = replace(
        state,
        position=sound * units.length * end.position.T,
        velocity=sound * units.velocity * end.velocity.T,
        spin=sound / units.time * end.spin.T,
        contacts=contact_history.to_state(outcome.notes, sound, units.length),
    )
    radius = particle.outer_radius(parameters)
    times = np.linspace(0.0, setup.duration, setup.cuts.frames + 1)
    return Run(
        times=jnp.asarray(times, state.position.dtype),
        heights=observed.heights,
        mean_velocity=observed.descent,
        mean_speed=observed.speed,
        radius=units.length * per_particle(radius, state.particles),
        state=last,
        deepest_overlap=sound * outcome.overlap,
        coating_overlap=sound * outcome.coating,
        fault=outcome.fault,
        box=box,
        time_step=setup.time_step,
        steps=setup.cuts.total,
        trajectory=observed.moved,
        rising=particle.rises(parameters),
    )


@partial(jax.jit, static_argnames=("box", "plan", "cuts", "laws", "trajectory"))
def _scan(
    position: Array,
    velocity: Array,
    spin: Array,
    notes: ParticleHistory,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    *,
    box: Box,
    plan: Plan,
    cuts: Schedule,
    laws: ActiveLaws,
    trajectory: bool,
) -> tuple[Motion, Observed, Outcome]:
    """The compiled loops, in reduced units with steps of length one."""
    engine = Engine(
        parameters,
        material,
        hindrance,
        position.shape[1],
        position.dtype,
        box=box,
        plan=plan,
        steps=cuts.steps,
        laws=laws,
        trajectory=trajectory,
    )

    @partial(jax.checkpoint, prevent_cse=False)
    def interval(motion: Motion, _):
        return engine.interval(motion), None

    def frame(motion: Motion, _):
        motion, _ = lax.scan(interval, motion, length=cuts.intervals)
        return motion, engine.observed(motion)

    start = engine.begun(position, velocity, spin, notes)
    # Reverse mode keeps every interval's beginning where there is room, else every frame's.
    kept = cuts.frames * cuts.intervals * sum(leaf.nbytes for leaf in jax.tree.leaves(start))
    at_start = engine.observed(start)
    end, after = lax.scan(
        frame if kept < REVERSE_MODE_BYTES else jax.checkpoint(frame, prevent_cse=False),
        start,
        length=cuts.frames,
    )
    observed = jax.tree.map(
        lambda first, later: jnp.concatenate([first[None], later]), at_start, after
    )
    return end, observed, engine.outcome(end)
