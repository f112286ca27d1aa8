"""Plans a run: chooses the step, buffers and laws that are left open, and refuses bad input."""

from dataclasses import replace
from functools import partial

import jax
import numpy as np

from mrjax.core import checks
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.dem import schedule
from mrjax.dem.force_bounds import beside_weight, force_bounds, plan_reach
from mrjax.dem.kick_bounds import RandomMotion
from mrjax.dem.neighbours import ListPlan
from mrjax.dem.plan import RunPlan, System
from mrjax.laws import particle, time_scales
from mrjax.laws.hindrance import BED_FRACTION
from mrjax.laws.time_scales import ForceBounds, Mode
from mrjax.simulation.options import RunOptions


def plan_run(
    system: System,
    options: RunOptions,
    *,
    duration: float,
    frames: int,
    touch: bool | None = None,
) -> RunPlan:
    """The plan of a run.

    Args:
      system: the system to be run.
      options: choices of the caller.
      duration: duration of the run, s.
      frames: number of times at which observables are recorded, beside the start.
      touch: whether particles touch before the end; by default judged from positions and speeds.

    Raises:
      InputError: an argument cannot be used, a step would be unstable, or a value is traced where a
        concrete one is needed.
    """
    state, parameters, _, box, _ = system
    frames = checks.whole(frames, "frames")
    duration = checks.positive(duration, "duration", "s")
    skin = checks.positive(options.skin, "skin", "contact diameters")
    checks.refuse_bad_parameters(
        parameters, state.particles, state.material, contacts=system.in_contact
    )
    for force in system.forces:
        force.refuse(state)
    checks.refuse_overflow(state)
    position, velocity = value_or_none(state.position), value_or_none(state.velocity)
    checks.refuse_outside(position, box)
    numbers = drop_tracers(parameters)
    radius = evaluated_or_none(particle.outer_radius, numbers)
    diameter = schedule.contact_diameter(state, radius, slack=skin / 4)
    reach = plan_reach(system, numbers)
    bounds = force_bounds(system, numbers, reach)
    speed = schedule.greatest_speed(velocity, numbers, box, duration, bounds.acceleration)
    random = RandomMotion.of_run(system.forces, numbers, system.hindrance)
    farthest = max(reach, default=0.0)
    if touch is None:
        kick = random.kick(duration) if random is not None else 0.0
        travel = None if speed is None or kick is None else 2 * (speed * duration + kick)
        # The speed is bounded only for particles that nothing but weight moves.
        touch = (
            farthest > 0.0
            or bool(beside_weight(system))
            or state.contacts is not None
            or checks.may_touch(position, radius, box, travel, diameter)
        )
    largest = hopeless = None
    if touch:
        largest, hopeless = _stable_steps(system, numbers, diameter, speed, bounds, random)
    if options.time_step is None:
        # Eq. 29 leaves out dissipation, which may need a shorter step.
        limits = (_step_of_eq_29(numbers, touch and system.in_contact), largest)
        time_step = min((limit for limit in limits if limit is not None), default=duration)
    else:
        time_step = checks.positive(options.time_step, "time_step", "s")
    time_step = min(duration / frames, time_step)
    neighbour_list = _list_plan(system, options, radius, diameter, skin, farthest)
    if largest is not None and hopeless is not None and time_step > hopeless:
        raise InputError(
            f"time_step = {time_step:.4g} s is unstable for contacts this stiff; the largest that "
            f"would do is {0.995 * largest:.3g} s"
        )
    rebuild_every = options.rebuild_every
    if rebuild_every is None:
        rebuild_every = schedule.steps_within_skin(speed, time_step, skin * diameter, random)
    steps = schedule.plan_steps(
        duration, time_step, frames, checks.whole(rebuild_every, "rebuild_every")
    )
    return RunPlan(duration, diameter / 2, neighbour_list, steps, reach, touch, options.trajectory)


def _stable_steps(
    system: System,
    numbers: Parameters,
    diameter: float,
    speed: float | None,
    bounds: ForceBounds,
    random: RandomMotion | None,
) -> tuple[float | None, float | None]:
    """Largest stable steps of a close packing and of a pair, s; None if they are traced.

    That of a pair leaves out random forces, whose kicks rarely reach their bounds.
    """
    if system.hindrance is not None:
        with jax.ensure_compile_time_eval():
            numbers = numbers.replace(f_w=drop_tracers(system.hindrance)(BED_FRACTION))
    if not system.in_contact:  # nor need the moduli be known
        soft = numbers.replace(elastic_modulus=1.0, poisson_ratio=0.0)

        def alone(arrangement: tuple[Mode, ...]) -> float | None:
            known = soft, 0.0, arrangement, bounds.stiffness
            step = evaluated_or_none(time_scales.largest_stable_step, *known)
            return None if step is None else float(step)

        return alone(time_scales.CLOSE_PACKED), alone(time_scales.TOUCHING_PAIR)
    law = partial(
        schedule.largest_stable_step,
        numbers,
        system.box,
        diameter,
        speed,
        stiffness=bounds.stiffness,
        pair_force=bounds.pair_force,
    )
    return law(time_scales.CLOSE_PACKED, random=random), law(time_scales.TOUCHING_PAIR)


def _list_plan(
    system: System,
    options: RunOptions,
    radius: np.ndarray | None,
    diameter: float,
    skin: float,
    reach: float,
) -> ListPlan:
    """The plan of the neighbour list of a run.

    Raises:
      InputError: a capacity is no whole number, or the box is too narrow for the particles.
    """
    state, box = system.state, system.box
    capacity = options.capacity
    if capacity is not None:
        capacity = checks.whole(capacity, "capacity")
    plan = schedule.plan_neighbour_list(state, radius, box, diameter, skin, capacity, reach)
    if options.cell_capacity is not None:
        room = checks.whole(options.cell_capacity, "cell_capacity")
        plan = replace(plan, cell_capacity=min(room, state.particles))
    checks.refuse_close_walls(box, diameter)
    checks.refuse_short_period(box, state.particles, plan.cutoff * diameter / 2)
    return plan


def _step_of_eq_29(numbers: Parameters, touch: bool) -> float | None:
    """The step of Eq. 29, s, or its part for the rise of velocities if nothing can touch.

    That part is infinite without drag, and None if the parameters are traced.

    Raises:
      InputError: particles can touch, and the parameters are traced.
    """
    if not touch:
        rise = evaluated_or_none(time_scales.rise_time, numbers)
        return None if rise is None else float(rise) / time_scales.REFINEMENT
    step = evaluated_or_none(time_scales.time_step, numbers)
    if step is None:
        raise InputError(
            "the parameters are traced by jit or vmap, so simulate cannot choose a step; give "
            "time_step=float(mrjax.time_step(parameters)), computed outside"
        )
    return float(step)
