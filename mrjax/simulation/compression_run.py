"""One random start in a periodic box that is compressed along z, step by step, to rest each time.

At each step the box and all centres are compressed along z by the same factor, after which the
particles move under contact, attraction and drag until they rest. There is no gravity. One compiled
program serves all heights of the box (`stretch` of `PiecewiseRun`).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike

from mrjax.core import randomness
from mrjax.core.box import Box
from mrjax.core.errors import InputError, SimulationError
from mrjax.core.interruption import Stop
from mrjax.core.parameters import Parameters
from mrjax.core.run import Fault, reasons
from mrjax.core.state import State, place
from mrjax.dem.contact_network import network_of
from mrjax.dem.forces import Contact, VanDerWaals
from mrjax.dem.plan import RunPlan, System
from mrjax.dem.schedule import Schedule
from mrjax.observables.coordination import coordination
from mrjax.observables.stress import stress_tensor
from mrjax.simulation.disperse import spread
from mrjax.simulation.options import RunOptions
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run

PERIODIC = (True, True, True)
FRAME = 200
"""Steps between two looks at the speed of the particles."""
INTERVAL = 20
"""Steps between two checks of the neighbour list."""
LOOKS = 5
"""Frames that run before the next decision about rest."""
MOST_FRAMES = 100
"""Frames after which a strain step ends, even if particles still move a little."""
STILL_MOVING = 30.0
"""Unbalanced force, over that of the criterion of rest, with which a strain step may not end."""
SHORTER = 0.7
"""Factor on a step that turned out too long."""


@dataclass(frozen=True)
class Compaction:
    """What all starts share: particles, box, volume fractions and the criterion of rest."""

    parameters: Parameters  # softened, in SI
    box: Box  # at the highest volume fraction, m
    radius: np.ndarray  # contact radii, (N,) in m
    fractions: np.ndarray  # volume fractions, ascending, (K,)
    pull_off: float  # F_c of two mean particles, N
    drag: float  # largest drag coefficient, kg/s
    time_step: float  # longest, s
    rest: float  # mean unbalanced force at rest, over F_c and the load
    dtype: DTypeLike

    def stretch(self, fraction: float) -> np.ndarray:
        """Edges of the box at a volume fraction, over those at the highest; (3,)."""
        return np.array([1.0, 1.0, max(1.0, self.fractions[-1] / fraction)])

    @property
    def area(self) -> float:
        """Square of the mean contact diameter, m^2."""
        return float((2.0 * self.radius.mean()) ** 2)


class Strained(NamedTuple):
    """A packing at rest at one volume fraction."""

    stress: np.ndarray  # contact stress, (3, 3) in Pa
    coordination: float
    unbalanced: float  # mean net force on a particle, over F_c and the load
    overlap: float  # deepest overlap so far in this step, radii


class _Step(PiecewiseRun):
    """The particles in the box of one strain step."""

    def _failure(self, fault: int, good: int) -> Exception:
        error = SimulationError(f"in a compressed box: {reasons(Fault(fault))}")
        error.faults = fault
        return error


def compress(compaction: Compaction, seed: int, stop: Stop) -> list[Strained]:
    """Compresses one random start; returns the packing at rest at each volume fraction.

    Args:
      compaction: what all starts share.
      seed: seed of the random positions.
      stop: request to stop, checked before every piece.

    Raises:
      InputError: the particles cannot be placed without overlap.
      SimulationError: the particles do not come to rest, or overlap too deeply.
    """
    state, plan, load = _start(compaction, seed), None, 0.0
    before = compaction.stretch(compaction.fractions[0])
    packings = []
    for fraction in compaction.fractions:
        stretch = compaction.stretch(fraction)
        moved = state.position * jnp.asarray(stretch / before, state.position.dtype)[None, :]
        still = jnp.zeros_like(state.velocity)
        state = replace(state, position=moved, velocity=still, spin=still)
        state, plan, packing = _to_rest(compaction, state, plan, stretch, load, stop)
        load, before = max(0.0, float(packing.stress[2, 2])) * compaction.area, stretch
        packings.append(packing)
    return packings


def _start(compaction: Compaction, seed: int) -> State:
    """Random positions without overlap at the lowest volume fraction."""
    x, y, z = compaction.box.size
    box = Box((x, y, z * compaction.stretch(compaction.fractions[0])[2]), PERIODIC)
    unit = float(compaction.radius.max())
    position = spread(randomness.key(seed), box.scaled(1 / unit), compaction.radius / unit)
    if position is None:
        raise InputError(
            f"start = {compaction.fractions[0]:.3g}: the particles cannot be placed without "
            "overlap; give a lower volume fraction"
        )
    return place(unit * position, contact_diameter=2 * unit, dtype=compaction.dtype)


def _to_rest(
    compaction: Compaction,
    state: State,
    plan: RunPlan | None,
    stretch: np.ndarray,
    load: float,
    stop: Stop,
) -> tuple[State, RunPlan, Strained]:
    """Runs one strain step to rest, with a shorter time step if it is unstable."""
    system = System.of(
        state, compaction.parameters, compaction.box, forces=[Contact(), VanDerWaals()]
    )
    if plan is None:
        plan = _plan(compaction, system)
    while True:
        run = _Step(system, plan, stop=stop, stretch=jnp.asarray(stretch, compaction.dtype))
        try:
            unbalanced = _advance(compaction, run, load)
            break
        except SimulationError as error:
            if error.faults != Fault.UNSTABLE:
                raise
            plan = replace(run.plan, duration=SHORTER * run.plan.duration)
    if unbalanced > STILL_MOVING * compaction.rest:
        raise SimulationError(
            f"a compressed box does not come to rest: the mean net force on a particle is still "
            f"{unbalanced:.2g} of pull-off force and load; give a larger `rest`, or a smaller "
            "`strain`"
        )
    settled = run.run()
    network = network_of(system._replace(state=settled.state), stretch)
    return (
        settled.state,
        run.plan,
        Strained(
            np.asarray(stress_tensor(network), float),
            float(coordination(network).mean),
            unbalanced,
            float(settled.deepest_overlap),
        ),
    )


def _advance(compaction: Compaction, run: PiecewiseRun, load: float) -> float:
    """Advances until the particles rest; returns the unbalanced force, over F_c and the load."""
    scale = compaction.drag / (compaction.pull_off + load)
    while True:
        run.advance(LOOKS)
        unbalanced = scale * float(run.mean_speed[-1])
        if unbalanced <= compaction.rest or run.place.frame >= MOST_FRAMES:
            return unbalanced


def _plan(compaction: Compaction, system: System) -> RunPlan:
    """Plan of all strain steps: buffers for the densest box, and frames of `FRAME` steps."""
    duration = compaction.time_step * FRAME * LOOKS
    options = RunOptions(time_step=compaction.time_step)
    plan = plan_run(system, options, duration=duration, frames=LOOKS, touch=True)
    schedule = Schedule(frames=LOOKS, intervals=FRAME // INTERVAL, steps=INTERVAL)
    return replace(plan, duration=duration, schedule=schedule)
