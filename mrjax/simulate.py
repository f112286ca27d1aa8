"""The run: one compiled scan over frames, rebuilds of the neighbour list, and steps.

Lab units end at the door: the scan works with the contact radius as unit of length and the step as
unit of time. What a fault spoils is NaN in a traced call and an error in a plain one.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrjax import checks, forces, history, leapfrog, neighbours, pairs, particle, schedule, timestep
from mrjax.box import Box
from mrjax.concrete import concrete, known
from mrjax.errors import InputError
from mrjax.forces import Laws
from mrjax.history import Notes
from mrjax.neighbours import Plan
from mrjax.parameters import Parameters
from mrjax.run import Fault, Run
from mrjax.schedule import Schedule
from mrjax.state import State
from mrjax.units import Units

DEEPEST = 0.25
"""Overlap, as a fraction of the radius, beyond which Hertz's law is not a description."""


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
      rebuild_every: most steps between rebuilds of the list; left out, chosen so that nothing
        falls through the skin in between.
      capacity, cell_capacity: room in the neighbour list and its search cells; left out, for a
        random close packing.

    Raises:
      InputError: an argument that cannot be used, a step that would be unstable, or a traced value
        where a concrete one is needed.
      SimulationError: the run is not to be trusted (plain calls).
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
        touch = state.contacts is not None or checks.may_touch(
            position, radius, box, 2 * speed * duration, diameter
        )
        largest = schedule.largest_stable_step(numbers, box, diameter, speed) if touch else np.inf
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
    if time_step > largest:
        raise InputError(
            f"time_step = {time_step:.4g} s is unstable for contacts this stiff; the largest that "
            f"would do is {0.995 * largest:.3g} s"
        )
    if rebuild_every is None:
        rebuild_every = schedule.steps_within_skin(speed, time_step, skin * diameter)
    cuts = schedule.cut(duration, time_step, frames, checks.whole(rebuild_every, "rebuild_every"))

    # Without a contact friction is only compiled.
    laws = forces.laws(parameters) if touch else Laws(sliding=False, rolling=False)

    while True:
        run = _run(state, parameters, box, duration, diameter / 2, plan, cuts, laws)
        fault = concrete(run.fault)
        if fault is None or not fault.any():
            return run
        overflow = int(fault) & (Fault.PAIRS_DROPPED | Fault.CELLS_OVERFULL)
        if overflow:
            plan = plan.grown(overflow, state.particles)
        elif int(fault) == Fault.OUTRAN_LIST and cuts.steps > 1:
            cuts = cuts.rebuilt_more_often()
        else:
            run.check()


def _run(
    state: State,
    parameters: Parameters,
    box: Box,
    duration: float,
    unit_length: float,
    plan: Plan,
    cuts: Schedule,
    laws: Laws,
) -> Run:
    """One attempt: SI to reduced units, the scan, and back."""
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
    motion = Motion(
        state.position.T / units.length,
        state.velocity.T / units.velocity,
        state.spin.T * units.time,
        notes,
        jnp.zeros(state.particles, dtype),
        jnp.zeros((), jnp.int32),
    )
    end, mudline, descent, overlap, coating, fault = _scan(
        motion,
        parameters.reduced(units).astype(dtype),
        state.material,
        box=box.scaled(1 / units.length),
        plan=plan,
        cuts=cuts,
        laws=laws,
    )
    # A factor, not a choice: the derivative of what must not be used is NaN too.
    sound = jnp.where(fault == 0, 1.0, jnp.nan).astype(dtype)
    last = replace(
        state,
        position=sound * units.length * end.position.T,
        velocity=sound * units.velocity * end.velocity.T,
        spin=sound / units.time * end.spin.T,
        contacts=history.recorded(end.notes, sound, units.length),
    )
    return Run(
        times=jnp.asarray(np.linspace(0.0, duration, cuts.frames + 1), dtype),
        mudline=sound * units.length * mudline,
        mean_velocity=sound * units.velocity * descent,
        state=last,
        deepest_overlap=sound * overlap,
        coating_overlap=sound * coating,
        fault=fault,
        initial_height=box.height,
        time_step=time_step,
        steps=cuts.total,
    )


class Motion(NamedTuple):
    """What one rebuild of the list hands to the next, in reduced units."""

    position: Array  # (3, N)
    velocity: Array  # (3, N)
    spin: Array  # (3, N)
    notes: Notes
    overlap: Array  # deepest of each particle so far, (N,)
    fault: Array  # ()


@partial(jax.jit, static_argnames=("box", "plan", "cuts", "laws"))
def _scan(
    start: Motion,
    parameters: Parameters,
    material: Array | None,
    *,
    box: Box,
    plan: Plan,
    cuts: Schedule,
    laws: Laws,
) -> tuple[Motion, Array, Array, Array, Array, Array]:
    """The compiled loops, in reduced units with steps of length one."""
    particles = start.position.shape[1]
    law = forces.total(parameters, particles, laws=laws, material=material)
    kick, spin_kick = leapfrog.kick(parameters, 1.0), leapfrog.spin_kick(parameters, 1.0)
    radius = particle.outer_radius(parameters)
    of_each = jnp.broadcast_to(radius, (particles,))
    skin_left = plan.cutoff - 2.0 * jnp.max(radius)

    def observe(motion: Motion) -> tuple[Array, Array]:
        return jnp.max(motion.position[2] + radius), 0.0 - jnp.mean(motion.velocity[2])

    @partial(jax.checkpoint, prevent_cse=False)
    def between_rebuilds(motion: Motion, _):
        found = neighbours.build(plan, box, motion.position.T)
        listed = pairs.listed(found, box, motion.position, of_each, skin_left, plan.pairs)
        loads = law(listed)

        @partial(jax.checkpoint, prevent_cse=False)
        def step(carry, _):
            travelled, velocity, spin, memory, deepest, farthest = carry

            def acting(half_way: Array, velocity: Array):
                found = loads(half_way, velocity, spin, memory)
                return found.force, found

            travelled, velocity, found = leapfrog.step(travelled, velocity, acting, kick, 1.0)
            spin = leapfrog.kicked(spin, found.torque, spin_kick)
            farthest = jnp.maximum(farthest, lax.stop_gradient(sum(travelled**2)))
            deepest = jnp.fmax(deepest, lax.stop_gradient(found.overlap))
            return (travelled, velocity, spin, found.memory, deepest, farthest), None

        still = jnp.zeros(particles, motion.position.dtype)
        memory = history.begun(motion.notes, listed)
        begin = (
            jnp.zeros_like(motion.position),
            motion.velocity,
            motion.spin,
            memory,
            jnp.zeros_like(motion.position, shape=plan.pairs),
            still,
        )
        (travelled, velocity, spin, memory, deepest, farthest), _ = lax.scan(
            step, begin, length=cuts.steps
        )
        outran = (2.0 * jnp.sqrt(jnp.max(farthest)) > skin_left) & (particles > 1)
        fault = motion.fault | listed.overflow | jnp.where(outran, int(Fault.OUTRAN_LIST), 0)
        position = motion.position + travelled
        deepest = jnp.maximum(motion.overlap, listed.deepest(deepest))
        notes = history.noted(memory, listed)
        return Motion(position, velocity, spin, notes, deepest, fault), None

    def frame(motion: Motion, _):
        motion, _ = lax.scan(between_rebuilds, motion, length=cuts.rebuilds)
        return motion, observe(motion)

    at_start = observe(start)
    end, after = lax.scan(frame, start, length=cuts.frames)
    mudline, descent = (
        jnp.concatenate([first[None], later]) for first, later in zip(at_start, after, strict=True)
    )
    overlap = jnp.max(end.overlap / radius)
    thickness = particle.coating_thickness(parameters)
    coated = thickness > 0.0
    coating = jnp.max(jnp.where(coated, end.overlap / jnp.where(coated, thickness, 1.0), 0.0))
    fault = end.fault | _faults_of_motion(parameters, box, end, overlap, coating)
    return end, mudline, descent, overlap, coating, fault


def _faults_of_motion(
    parameters: Parameters, box: Box, end: Motion, deepest: Array, coating: Array
) -> Array:
    """What a finished run shows of a step that was too long, ()."""
    overlap = deepest * jnp.max(particle.outer_radius(parameters))
    limit = timestep.largest_stable_step(parameters, overlap, timestep.TOUCHING_PAIR)
    escaped = jnp.zeros((), bool)
    for axis in box.walled_axes:
        outside = (end.position[axis] < 0.0) | (end.position[axis] > box.size[axis])
        escaped = escaped | jnp.any(outside)
    moved = (end.position, end.velocity, end.spin)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(part)) for part in moved]))
    found = (
        (limit < 1.0, Fault.UNSTABLE),
        (deepest > DEEPEST, Fault.TOO_DEEP),
        (escaped, Fault.ESCAPED),
        (coating > 1.0, Fault.THROUGH_COATING),
        (~finite, Fault.NOT_FINITE),
    )
    return sum(jnp.where(here, int(fault), 0) for here, fault in found).astype(jnp.int32)


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
