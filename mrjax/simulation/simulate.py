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

    The function is pure: it works under `jit`, `grad`, `jvp` and `vmap`, in the dtype of the state.
    A plain call runs in pieces of a fraction of a second, and Ctrl-C ends it after a piece. A
    traced call is one compiled program. If the neighbour list is too small or too old, a plain call
    gives it more room, or rebuilds it more often, and repeats the frame. A traced call cannot do
    so, and returns NaN with the reason in `Run.fault`.

    Args:
      state: state at which the particles start, from `disperse` or `place`.
      parameters: parameters of particles, fluid and contact.
      box: the container.
      duration: duration of the run, s.
      frames: number of times at which observables are recorded, beside the start.
      options: step, neighbour list, local drag, forces, records and progress: `RunOptions`.

    Raises:
      InputError: an argument cannot be used, a step would be unstable, or a value is traced where a
        concrete one is needed.
      SimulationError: the run is not to be trusted (plain calls). The error says when and to which
        particle it happened, and what to change. It carries the state at the beginning of that
        frame.

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
    """True if nothing is traced, neither an argument nor a value that the hindrance closes over."""
    hindrance = system.hindrance
    closed_over = hindrance and not jax.tree.leaves(hindrance)
    value = hindrance(BED_FRACTION) if hindrance and closed_over else None
    return is_concrete((system, value))


def _traced(system: System, plan: RunPlan) -> Run:
    """The run as one program, repeated with larger buffers if its values are known."""
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
    """Values of a call that is being differentiated, without derivatives."""
    return jax.tree.map(lambda leaf: jnp.asarray(value_or_none(leaf)), tree)
