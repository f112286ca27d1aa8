"""The run as a call: what is decided before it, and what becomes of a fault.

In a traced call all numbers are NaN then; a plain one is repeated with more room, or raises.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.interruption import interruptible
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.core.tracing import drop_tracers, evaluated_or_none, is_concrete, value_or_none
from mrjax.dem import schedule
from mrjax.dem.forces import ActiveLaws, active_laws
from mrjax.dem.scan import RunPlan, run_once
from mrjax.laws import particle, time_scales
from mrjax.laws.hindrance import BED_FRACTION, Hindrance, as_tree
from mrjax.simulation.failure import failure
from mrjax.simulation.pieces import Pieces
from mrjax.simulation.progress import watched


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
    progress: bool = False,
) -> Run:
    """Follows the particles for a while.

    Pure: works under `jit`, `grad`, `jvp` and `vmap`, in the dtype of the state. A plain call runs
    in pieces of a fraction of a second, after each of which Ctrl-C ends it; a traced call is one
    compiled program. A plain call gives the neighbour list more room, or rebuilds it more often,
    and repeats a frame where that is what a run needs; a traced call cannot, and returns NaN with
    the reason in `Run.fault`.

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
      hindrance: f_w for volume fractions, such as `recipe.hindrance` or
        `lambda phi: (1 - phi) ** -4.65`: each particle then feels that
        of its own height (`mrjax.laws.hindrance`) in place of the parameters' f_w.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      progress: whether to show a progress bar, on standard error (plain calls).

    Raises:
      InputError: an argument that cannot be used, a step that would be unstable, or a traced value
        where a concrete one is needed.
      SimulationError: the run is not to be trusted (plain calls). Says when and to which particle
        it happened, and what to change; carries the state at the beginning of that frame.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> state = mrjax.disperse(recipe, seed=0)
      >>> run = mrjax.simulate(state, recipe.parameters(), recipe.box, duration=3e-7)
      >>> print(f"{86400e3 * mrjax.settling_velocity(run):.3f} mm/day")
      9.116 mm/day
    """
    checks.of_run(state, parameters, box)
    hindrance = as_tree(hindrance)
    prepare = partial(
        plan_run,
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
    # A function may close over what is traced.
    hidden = hindrance(BED_FRACTION) if hindrance and not jax.tree.leaves(hindrance) else None
    if not is_concrete((state, parameters, hindrance, hidden)):
        return _traced(state, parameters, hindrance, box, prepare())
    with interruptible() as stop:
        setup = prepare()
        pieces = Pieces(state, parameters, hindrance, box, setup, stop=stop)
        with watched("simulate", pieces, progress) as watch:
            pieces.go_on(setup.cuts.frames, watch)
        return pieces.run()


def _traced(
    state: State, parameters: Parameters, hindrance: Hindrance | None, box: Box, setup: RunPlan
) -> Run:
    """The run as one program; with more room and again, where a differentiated call needs that."""
    while True:
        run = run_once(state, parameters, hindrance, box, setup)
        fault = value_or_none(run.fault)
        if fault is None or not fault.any():
            return run
        faults = int(fault.flat[0])
        mended = setup.mended(faults, state.particles)
        if mended is None:
            began, grains, law = _values((state, parameters, hindrance))
            raise failure(began, grains, law, box, setup, faults, time=0.0)
        setup = mended


def _values(tree: Any) -> Any:
    """What a differentiated call carries, without what it differentiates."""
    return jax.tree.map(lambda leaf: jnp.asarray(value_or_none(leaf)), tree)


def plan_run(
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
) -> RunPlan:
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
    checks.in_reach(state)
    position, velocity = value_or_none(state.position), value_or_none(state.velocity)
    checks.inside_walls(position, box)
    numbers = drop_tracers(parameters)
    radius = evaluated_or_none(particle.outer_radius, numbers)
    diameter = schedule.contact_diameter(state, radius, slack=skin / 4)
    speed = schedule.fastest(velocity, numbers, box, duration)
    if touch is None:
        travel = None if speed is None else 2 * speed * duration
        touch = state.contacts is not None or checks.may_touch(
            position, radius, box, travel, diameter
        )
    largest = hopeless = None
    if touch:
        in_bed = numbers
        if hindrance is not None:
            with jax.ensure_compile_time_eval():
                in_bed = numbers.replace(f_w=drop_tracers(hindrance)(BED_FRACTION))
        expected = in_bed, box, diameter, speed
        largest = schedule.largest_stable_step(*expected, time_scales.CLOSE_PACKED)
        hopeless = schedule.largest_stable_step(*expected, time_scales.TOUCHING_PAIR)
    if time_step is None:
        # Eq. 29 knows nothing of dissipation, which may ask for less.
        limits = (_chosen_step(numbers, touch), largest)
        time_step = min((limit for limit in limits if limit is not None), default=duration)
    else:
        time_step = checks.positive(time_step, "time_step", "s")
    time_step = min(duration / frames, time_step)

    if capacity is not None:
        capacity = checks.whole(capacity, "capacity")
    plan = schedule.list_plan(state, radius, box, diameter, skin, capacity)
    if cell_capacity is not None:
        room = checks.whole(cell_capacity, "cell_capacity")
        plan = replace(plan, cell_capacity=min(room, state.particles))
    checks.between_walls(box, diameter)
    checks.wide_enough(box, state.particles, plan.cutoff * diameter / 2)
    if largest is not None and hopeless is not None and time_step > hopeless:
        raise InputError(
            f"time_step = {time_step:.4g} s is unstable for contacts this stiff; the largest that "
            f"would do is {0.995 * largest:.3g} s"
        )
    if rebuild_every is None:
        rebuild_every = schedule.steps_within_skin(speed, time_step, skin * diameter)
    cuts = schedule.cut(duration, time_step, frames, checks.whole(rebuild_every, "rebuild_every"))

    # Without a contact friction is only compiled.
    laws = (
        active_laws(parameters) if touch else ActiveLaws(sliding=False, rolling=False, damped=False)
    )
    return RunPlan(duration, diameter / 2, plan, cuts, laws, trajectory)


def _chosen_step(numbers: Parameters, touch: bool) -> float | None:
    """Eq. 29, or what is left of it where nothing can touch: infinite without drag, None if traced.

    Raises:
      InputError: something can touch, and the parameters are traced.
    """
    if not touch:
        rise = evaluated_or_none(time_scales.rise_time, numbers)
        return None if rise is None else float(rise) / time_scales.REFINEMENT
    chosen = evaluated_or_none(time_scales.time_step, numbers)
    if chosen is None:
        raise InputError(
            "the parameters are traced by jit or vmap, so simulate cannot choose a step; give "
            "time_step=float(mrjax.time_step(parameters)), computed outside"
        )
    return float(chosen)
