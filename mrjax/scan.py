"""One attempt at a run: a compiled scan over frames, looks at the neighbour list, and steps.

Lab units end at the door: the scan works with the contact radius as unit of length and the step as
unit of time. A fault spoils every number, until it is mended or found to be beyond that.
"""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax import (
    forces,
    history,
    leapfrog,
    neighbours,
    order,
    pairs,
    particle,
    stability,
    surfaces,
)
from mrjax.box import Box
from mrjax.forces import Laws
from mrjax.hindrance import Hindrance, hindered
from mrjax.history import Memory, Notes
from mrjax.leapfrog import Kick
from mrjax.neighbours import Plan
from mrjax.pairs import Pairs
from mrjax.parameters import Parameters, per_particle
from mrjax.run import Fault, Run
from mrjax.schedule import Schedule
from mrjax.stability import Swing
from mrjax.state import State
from mrjax.trajectory import Trajectory
from mrjax.units import Units

DEEPEST = 0.25
"""Overlap, as a fraction of the radius, beyond which Hertz's law is not a description."""
ROOM = 2e8
"""Bytes that reverse mode may keep before it computes frames a second time."""
HURRY = 2.0
"""By how much a particle may be faster in the next interval than the fastest is now. One that
becomes faster still outruns the list, which a run does not pass over."""


@dataclass(frozen=True)
class Setup:
    """What is decided before a run and fixes its compiled program."""

    duration: float  # s
    unit_length: float  # largest contact radius, m
    plan: Plan
    cuts: Schedule
    laws: Laws
    trajectory: bool
    spoil: bool = True  # whether a fault makes all numbers NaN

    def mended(self, run: Run) -> "Setup | None":
        """With more room, where the run failed for want of it; None for other faults."""
        fault = int(np.bitwise_or.reduce(np.ravel(run.fault)))
        if overflow := fault & (Fault.PAIRS_DROPPED | Fault.CELLS_OVERFULL):
            return replace(self, plan=self.plan.grown(overflow, run.heights.shape[-1]))
        if fault == Fault.OUTRAN_LIST and self.cuts.steps > 1:
            return replace(self, cuts=self.cuts.rebuilt_more_often())
        return None


def attempt(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: Setup
) -> Run:
    """One run with all decided, whose faults may be mended; of many particles in order of space."""
    if state.particles < order.MANY:
        return _in_reduced_units(state, parameters, hindrance, box, setup)
    places = order.in_space(state.position, box, setup.plan.cell * setup.unit_length)
    state, parameters = order.arranged(state, places), order.of_each(parameters, places)
    run = _in_reduced_units(state, parameters, hindrance, box, setup)
    back = jnp.argsort(places)
    return replace(
        run,
        heights=run.heights[:, back],
        radius=run.radius[back],
        state=order.arranged(run.state, back),
        trajectory=jax.tree.map(lambda rows: rows[:, back], run.trajectory),
    )


def _in_reduced_units(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: Setup
) -> Run:
    """SI to reduced units, scan, and back."""
    duration, unit_length, plan, cuts, laws, trajectory, spoil = (
        getattr(setup, field.name) for field in fields(setup)
    )
    time_step = duration / cuts.total
    units = Units(mass=1000.0 * unit_length**3, length=unit_length, time=time_step)
    dtype = state.position.dtype
    notes = history.recalled(
        state.contacts,
        state.position,
        slots=plan.capacity + 2 * len(box.walled_axes),
        sliding=laws.sliding,
        rolling=laws.rolling,
        unit_length=units.length,
    )
    reduced = parameters.reduced(units).astype(dtype)
    end, notes, heights, descent, speed, moved, overlap, coating, fault = _scan(
        state.position.T / units.length,
        state.velocity.T / units.velocity,
        state.spin.T * units.time,
        notes,
        reduced,
        state.material,
        hindrance,
        box=box.scaled(1 / units.length),
        plan=plan,
        cuts=cuts,
        laws=laws,
        trajectory=trajectory,
    )
    # A factor, not a choice: the derivative of what must not be used is NaN too.
    sound = jnp.where((fault == 0) | (not spoil), 1.0, jnp.nan).astype(dtype)
    last = replace(
        state,
        position=sound * units.length * end.position.T,
        velocity=sound * units.velocity * end.velocity.T,
        spin=sound / units.time * end.spin.T,
        contacts=history.recorded(notes, sound, units.length),
    )
    return Run(
        times=jnp.asarray(np.linspace(0.0, duration, cuts.frames + 1), dtype),
        heights=sound * units.length * heights,
        mean_velocity=sound * units.velocity * descent,
        mean_speed=sound * units.velocity * speed,
        radius=units.length * per_particle(particle.outer_radius(reduced), state.particles),
        state=last,
        deepest_overlap=sound * overlap,
        coating_overlap=sound * coating,
        fault=fault,
        box=box,
        time_step=time_step,
        steps=cuts.total,
        trajectory=None if moved is None else moved.in_lab_units(units, sound),
        rising=particle.rises(reduced),
    )


class Motion(NamedTuple):
    """What one interval hands to the next, in reduced units."""

    listed: Pairs
    origin: Array  # positions when the list was built, (3, N)
    travelled: Array  # since then, (3, N)
    velocity: Array  # (3, N)
    spin: Array  # (3, N)
    memory: Memory
    overlap: Array  # deepest of each particle so far, (N,)
    swing: Swing
    fault: Array  # ()

    @property
    def position(self) -> Array:
        """(3, N)."""
        return self.origin + self.travelled


@partial(jax.jit, static_argnames=("box", "plan", "cuts", "laws", "trajectory"))
def _scan(
    position: Array,
    velocity: Array,
    spin: Array,
    notes: Notes,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    *,
    box: Box,
    plan: Plan,
    cuts: Schedule,
    laws: Laws,
    trajectory: bool,
) -> tuple[Motion, Notes, Array, Array, Array, Trajectory | None, Array, Array, Array]:
    """The compiled loops, in reduced units with steps of length one."""
    particles, dtype = position.shape[1], position.dtype
    law = forces.of_contacts(parameters, laws=laws, material=material)
    pull = forces.pull(parameters, particles)
    radius = per_particle(particle.outer_radius(parameters), particles)
    skin_left = plan.cutoff - 2.0 * jnp.max(radius)

    def kicks(position: Array) -> tuple[Kick, Kick]:
        felt = parameters
        if hindrance is not None:
            felt = hindered(parameters, hindrance, box, position, spacing=2.0)
        return leapfrog.kick(felt, 1.0), leapfrog.spin_kick(felt, 1.0)

    def pushes(position: Array) -> tuple[Array, Array, Array, Array]:
        """What a step keeps of velocities and of spins, its gains, and what gravity adds."""
        straight, turning = kicks(position)
        gains = jnp.stack(jnp.broadcast_arrays(straight.gain, turning.gain))
        return straight.keep, turning.keep, gains, jnp.atleast_2d(straight.gain) * pull

    everywhere = pushes(position)
    # A lone particle has room for every wall, and may go where it likes.
    listed_gap = skin_left if particles > 1 else jnp.asarray(jnp.inf, dtype)

    def listed_at(position: Array) -> Pairs:
        found = neighbours.build(plan, box, position.T)
        return pairs.listed(found, box, position, radius, listed_gap, plan.pairs)

    def begun_at(position: Array) -> tuple[Pairs, Array, Array]:
        """A list, where it was built, and what has been travelled since: nothing.

        All that is differentiated of a position is what is travelled, particle by particle, not
        also the separation of every pair.
        """
        origin = lax.stop_gradient(position)
        return listed_at(origin), origin, position - origin

    def stale(motion: Motion) -> Array:
        """Whether a particle may leave the skin before the end of the next interval."""
        gone, speed = (
            jnp.sqrt(jnp.max(sum(lax.stop_gradient(of) ** 2)))
            for of in (motion.travelled, motion.velocity)
        )
        return (2.0 * (gone + HURRY * cuts.steps * speed) > skin_left) & (gone > 0.0)

    def listed_anew(motion: Motion) -> Motion:
        listed, origin, travelled = begun_at(motion.position)
        return motion._replace(
            listed=listed,
            origin=origin,
            travelled=travelled,
            memory=history.begun(history.noted(motion.memory, motion.listed), listed),
            fault=motion.fault | listed.overflow,
        )

    def observe(motion: Motion) -> tuple[Array, Array, Array, Trajectory | None]:
        speed = jnp.sqrt(lax.stop_gradient(sum(motion.velocity**2)))
        moved = None
        if trajectory:
            moved = Trajectory(motion.position.T, motion.velocity.T, motion.spin.T)
        return motion.position[2], 0.0 - jnp.mean(motion.velocity[2]), jnp.mean(speed), moved

    @partial(jax.checkpoint, prevent_cse=False)
    def interval(motion: Motion, _):
        if particles > 1:
            motion = lax.cond(stale(motion), listed_anew, lambda motion: motion, motion)
        listed, origin = motion.listed, motion.origin
        loads = law(listed)

        def step(carry, looked_at):
            half_way, velocity, spin, memory, deepest, farthest = carry

            def kick(half_way: Array, velocity: Array):
                now = everywhere if hindrance is None else pushes(origin + half_way)
                keep, spin_keep, gains, falling = now
                found = loads(half_way, velocity, spin, memory, deepest, gains)
                return keep, falling + found.force, (found, spin_keep)

            half_way, velocity, (found, spin_keep) = leapfrog.step(half_way, velocity, kick, 1.0)
            spin = leapfrog.kicked(spin, spin_keep, found.torque)
            gone = lax.stop_gradient(sum(half_way**2))
            farthest = jnp.maximum(farthest, jnp.where(looked_at, gone, 0.0))
            return (half_way, velocity, spin, found.memory, found.deepest, farthest), None

        half_way = leapfrog.drifted(motion.travelled, motion.velocity, 0.5)
        begin = (
            half_way,
            motion.velocity,
            motion.spin,
            motion.memory,
            jnp.zeros_like(position, shape=plan.pairs),
            lax.stop_gradient(sum(half_way**2)),
        )
        # Contacts are looked at half-way; where the last step leads, the next interval looks.
        looked_at = np.arange(cuts.steps) < cuts.steps - 1
        (half_way, velocity, spin, memory, deepest, farthest), _ = lax.scan(step, begin, looked_at)
        travelled = leapfrog.drifted(half_way, velocity, -0.5)
        outran = (2.0 * jnp.sqrt(jnp.max(farthest)) > skin_left) & (particles > 1)
        fault = motion.fault | jnp.where(outran, int(Fault.OUTRAN_LIST), 0)
        constants = surfaces.of(parameters, material, listed)
        bed = (motion.swing, listed, constants, deepest, radius, *kicks(origin + travelled))
        swing = stability.swing(*lax.stop_gradient(bed), sliding=laws.sliding)
        fault |= jnp.where(swing.rate > stability.MOST, int(Fault.UNSTABLE), 0)
        deepest = jnp.maximum(motion.overlap, listed.deepest(deepest))
        return Motion(
            listed, origin, travelled, velocity, spin, memory, deepest, swing, fault
        ), None

    def frame(motion: Motion, _):
        motion, _ = lax.scan(interval, motion, length=cuts.intervals)
        return motion, observe(motion)

    listed, origin, travelled = begun_at(position)
    start = Motion(
        listed,
        origin,
        travelled,
        velocity,
        spin,
        history.begun(notes, listed),
        jnp.zeros(particles, dtype),
        stability.unknown(particles, dtype),
        listed.overflow,
    )
    # Reverse mode keeps every interval's beginning where there is room, else every frame's.
    kept = cuts.frames * cuts.intervals * sum(leaf.nbytes for leaf in jax.tree.leaves(start))
    at_start = observe(start)
    end, after = lax.scan(
        frame if kept < ROOM else jax.checkpoint(frame, prevent_cse=False),
        start,
        length=cuts.frames,
    )
    heights, descent, speed, moved = jax.tree.map(
        lambda first, later: jnp.concatenate([first[None], later]), at_start, after
    )
    overlap = jnp.max(end.overlap / radius)
    thickness = particle.coating_thickness(parameters)
    coated = thickness > 0.0
    coating = jnp.max(jnp.where(coated, end.overlap / jnp.where(coated, thickness, 1.0), 0.0))
    fault = end.fault | _faults_of_motion(box, end, overlap, coating)
    notes = history.noted(end.memory, end.listed)
    return end, notes, heights, descent, speed, moved, overlap, coating, fault


def _faults_of_motion(box: Box, end: Motion, deepest: Array, coating: Array) -> Array:
    """What a finished run shows of a step that was too long, ()."""
    escaped = jnp.zeros((), bool)
    for axis in box.walled_axes:
        outside = (end.position[axis] < 0.0) | (end.position[axis] > box.size[axis])
        escaped = escaped | jnp.any(outside)
    moved = (end.position, end.velocity, end.spin)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(part)) for part in moved]))
    found = (
        (deepest > DEEPEST, Fault.TOO_DEEP),
        (escaped, Fault.ESCAPED),
        (coating > 1.0, Fault.THROUGH_COATING),
        (~finite, Fault.NOT_FINITE),
    )
    faults = [jnp.where(here, int(fault), 0) for here, fault in found]
    return sum(faults[1:], faults[0]).astype(jnp.int32)
