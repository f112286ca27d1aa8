"""The run of the particles for a given time, as a pure function."""

from typing import Any, Unpack

import jax
import jax.numpy as jnp

from mrjax.core.box import Box
from mrjax.core.interruption import interruptible
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.core.tracing import is_concrete, value_or_none
from mrjax.dem.plan import RunPlan, System
from mrjax.dem.scan import run_once
from mrjax.laws.hindrance import BED_FRACTION
from mrjax.simulation.failure import failure
from mrjax.simulation.options import RunKeywords, RunOptions, takes_run_options
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run
from mrjax.simulation.progress import watched


@takes_run_options
def simulate(
    state: State,
    parameters: Parameters,
    box: Box,
    *,
    duration: float,
    frames: int = 1,
    **options: Unpack[RunKeywords],
) -> Run:
    """Follows the particles for a given time.

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
      options: step, neighbour list, local drag, what is recorded and shown: `RunOptions`.

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
    chosen = RunOptions(**options)
    system = System.of(state, parameters, box, chosen.hindrance, chosen.forces)
    if not _is_plain(system):
        return _traced(system, plan_run(system, chosen, duration=duration, frames=frames))
    with interruptible() as stop:
        plan = plan_run(system, chosen, duration=duration, frames=frames)
        pieces = PiecewiseRun(system, plan, stop=stop)
        with watched("simulate", pieces, chosen.progress) as watch:
            pieces.advance(plan.schedule.frames, watch)
        return pieces.run()


def _is_plain(system: System) -> bool:
    """True if nothing is traced, neither an argument nor what a hindrance closes over."""
    hindrance = system.hindrance
    closed_over = hindrance and not jax.tree.leaves(hindrance)
    value = hindrance(BED_FRACTION) if hindrance and closed_over else None
    return is_concrete((system, value))


def _traced(system: System, plan: RunPlan) -> Run:
    """The run as one program; with larger buffers and again, where a derivative needs that."""
    while True:
        run = run_once(system, plan)
        fault = value_or_none(run.fault)
        if fault is None or not fault.any():
            return run
        faults = int(fault.flat[0])
        larger = plan.with_larger_buffers(faults, system.particles)
        if larger is None:
            raise failure(_values(system), plan, faults, time=0.0)
        plan = larger


def _values(tree: Any) -> Any:
    """Values of a differentiated call, without derivatives."""
    return jax.tree.map(lambda leaf: jnp.asarray(value_or_none(leaf)), tree)
