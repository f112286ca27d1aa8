"""The run: one compiled scan over frames, looks at the neighbour list, and steps.

Lab units end at the door: the scan works with the contact radius as unit of length and the step as
unit of time. What a fault spoils is NaN in a traced call and an error in a plain one.
"""

from dataclasses import dataclass, fields, replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax import (
    checks,
    forces,
    history,
    leapfrog,
    neighbours,
    order,
    pairs,
    particle,
    schedule,
    stability,
    surfaces,
    timestep,
)
from mrjax.box import Box
from mrjax.concrete import concrete, known
from mrjax.errors import InputError
from mrjax.forces import Laws
from mrjax.hindrance import BED, Hindrance, hindered
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


def simulate(
    state: State,
    parameters: Parameters,
    box: Box,
    *,
    duration: float,
    frames: int = 1,
    time_step: float | None = None,
    skin: float = 0.1,
    rebuild_every: int | None = None,
    capacity: int | None = None,
    cell_capacity: int | None = None,
    hindrance: Hindrance | None = None,
    trajectory: bool = False,
) -> Run:
    """Follows the particles for a while.

    Pure: works under `jit`, `grad`, `jvp` and `vmap`, in the dtype of the state. A plain call
    gives the neighbour list more room, or rebuilds it more often, and repeats where that is what a
    run needs; a traced call cannot, and returns NaN with the reason in `Run.fault`.

    Args:
      state: where the particles start, from `disperse` or `place`.
      parameters: of particles, fluid and contact.
      box: the container.
      duration: s.
      frames: number of times at which observables are recorded, beside the start.
      time_step: longest step, s; shortened so that the steps fill the frames. Left out, it is
        `mrjax.time_step(parameters)` (Eq. 29), or less where contacts are strongly damped, and
        without its t_c where nothing can touch before the end. Never differentiated through.
      skin: reach of the neighbour list beyond contact, as a fraction of the contact diameter.
      rebuild_every: steps after which the list is looked at, and rebuilt if need be; left out,
        chosen so that nothing falls through the skin in between.
      capacity, cell_capacity: room in the neighbour list and its search cells; left out, for a
        random close packing.
      hindrance: f_w for volume fractions, such as `recipe.hindrance`: each particle then feels that
        of its own height (`mrjax.hindrance`) in place of the parameters' f_w.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).

    Raises:
      InputError: an argument that cannot be used, a step that would be unstable, or a traced value
        where a concrete one is needed.
      SimulationError: the run is not to be trusted (plain calls).

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> state = mrjax.disperse(recipe, seed=0)
      >>> run = mrjax.simulate(state, recipe.parameters(), recipe.box, duration=3e-7)
      >>> print(f"{86400e3 * mrjax.settling_velocity(run):.3f} mm/day")
      9.116 mm/day
    """
    setup = prepared(
        state,
        parameters,
        box,
        duration=duration,
        frames=frames,
        time_step=time_step,
        skin=skin,
        hindrance=hindrance,
        rebuild_every=rebuild_every,
        capacity=capacity,
        cell_capacity=cell_capacity,
        trajectory=trajectory,
    )
    while True:
        run = attempt(state, parameters, hindrance, box, setup)
        fault = concrete(run.fault)
        if fault is None or not fault.any():
            return run
        mended = setup.mended(run)
        if mended is None:
            run.check()  # raises
        setup = mended  # type: ignore[assignment] # a fault that cannot be mended has raised


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


def prepared(
    state: State,
    parameters: Parameters,
    box: Box,
    *,
    duration: float,
    frames: int,
    time_step: float | None,
    skin: float,
    hindrance: Hindrance | None = None,
    rebuild_every: int | None = None,
    capacity: int | None = None,
    cell_capacity: int | None = None,
    touch: bool | None = None,
    trajectory: bool = False,
) -> Setup:
    """Refuses what cannot be run, and decides what is left open.

    Args:
      touch: whether particles meet before the end; left out, judged from where they are.
      trajectory: whether the run records it.

    Raises:
      InputError: as `simulate`.
    """
    frames = checks.whole(frames, "frames")
    duration = checks.positive(duration, "duration", "s")
    skin = checks.positive(skin, "skin", "contact diameters")
    checks.meaningful(parameters, state.particles, state.material)
    position, velocity = concrete(state.position), concrete(state.velocity)
    checks.inside_walls(position, box)
    with jax.ensure_compile_time_eval():
        numbers = known(parameters)
        radius = np.asarray(particle.outer_radius(numbers))
        diameter = schedule.contact_diameter(state, radius, slack=skin / 4)
        speed = schedule.fastest(velocity, numbers, box, duration)
        if touch is None:
            touch = state.contacts is not None or checks.may_touch(
                position, radius, box, 2 * speed * duration, diameter
            )
        in_bed = numbers if hindrance is None else numbers.replace(f_w=known(hindrance)(BED))
        largest, hopeless = (
            schedule.largest_stable_step(in_bed, box, diameter, speed, arrangement)
            if touch
            else np.inf
            for arrangement in (timestep.CLOSE_PACKED, timestep.TOUCHING_PAIR)
        )
        if time_step is None:
            # Eq. 29 knows nothing of dissipation, which may ask for less.
            time_step = np.fmin(_chosen_step(numbers, touch), largest)
        else:
            time_step = checks.positive(time_step, "time_step", "s")
        time_step = min(duration / frames, float(time_step))

    if capacity is not None:
        capacity = checks.whole(capacity, "capacity")
    plan = schedule.list_plan(state, radius, box, diameter, skin, capacity)
    if cell_capacity is not None:
        plan = replace(plan, cell_capacity=checks.whole(cell_capacity, "cell_capacity"))
    checks.between_walls(box, diameter)
    checks.wide_enough(box, state.particles, plan.cutoff * diameter / 2)
    if time_step > hopeless:
        raise InputError(
            f"time_step = {time_step:.4g} s is unstable for contacts this stiff; the largest that "
            f"would do is {0.995 * largest:.3g} s"
        )
    if rebuild_every is None:
        rebuild_every = schedule.steps_within_skin(speed, time_step, skin * diameter)
    cuts = schedule.cut(duration, time_step, frames, checks.whole(rebuild_every, "rebuild_every"))

    # Without a contact friction is only compiled.
    laws = forces.laws(parameters) if touch else Laws(sliding=False, rolling=False, damped=False)
    return Setup(duration, diameter / 2, plan, cuts, laws, trajectory)


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
    law = forces.total(parameters, particles, laws=laws, material=material)
    radius = per_particle(particle.outer_radius(parameters), particles)
    skin_left = plan.cutoff - 2.0 * jnp.max(radius)

    def kicks(position: Array) -> tuple[Kick, Kick]:
        felt = parameters
        if hindrance is not None:
            felt = hindered(parameters, hindrance, box, position, spacing=2.0)
        return leapfrog.kick(felt, 1.0), leapfrog.spin_kick(felt, 1.0)

    everywhere = kicks(position)
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

        def step(carry, _):
            travelled, velocity, spin, memory, deepest, farthest = carry

            def acting(half_way: Array, velocity: Array):
                found = loads(half_way, velocity, spin, memory)
                straight, turning = everywhere if hindrance is None else kicks(origin + half_way)
                return found.force, straight, (found, turning)

            travelled, velocity, (found, turning) = leapfrog.step(travelled, velocity, acting, 1.0)
            spin = leapfrog.kicked(spin, found.torque, turning)
            farthest = jnp.maximum(farthest, lax.stop_gradient(sum(travelled**2)))
            deepest = jnp.fmax(deepest, lax.stop_gradient(found.overlap))
            return (travelled, velocity, spin, found.memory, deepest, farthest), None

        begin = (
            motion.travelled,
            motion.velocity,
            motion.spin,
            motion.memory,
            jnp.zeros_like(position, shape=plan.pairs),
            jnp.zeros(particles, dtype),
        )
        (travelled, velocity, spin, memory, deepest, farthest), _ = lax.scan(
            step, begin, length=cuts.steps
        )
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


def _chosen_step(numbers: Parameters, touch: bool) -> float:
    """Eq. 29, or what is left of it where nothing can touch: infinite without drag."""
    if not touch:
        return float(timestep.rise_time(numbers)) / timestep.REFINEMENT
    chosen = float(timestep.time_step(numbers))
    if np.isnan(chosen):
        raise InputError(
            "the parameters are traced by jit or vmap, so simulate cannot choose a step; give "
            "time_step=float(mrjax.time_step(parameters)), computed outside"
        )
    return chosen
