"""Where a run went wrong: when, and which particle, found by repeating the part that failed.

A good run pays nothing for it. The part is repeated in ever shorter pieces down to a single step,
whose positions are then looked at, spoilt as they are.
"""

from dataclasses import dataclass, replace

import jax
import numpy as np
from scipy.spatial import cKDTree

from mrjax.core.box import AXES, Box
from mrjax.core.errors import SimulationError
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.core.run import Fault, reasons
from mrjax.core.state import State
from mrjax.dem.engine import MAX_OVERLAP
from mrjax.dem.scan import RunPlan, run_once
from mrjax.dem.schedule import Schedule
from mrjax.laws import particle
from mrjax.laws.hindrance import Hindrance

PIECES = 256
"""Into which a part is divided, and each that fails again."""


def failure(
    state: State,
    parameters: Parameters,
    hindrance: Hindrance | None,
    box: Box,
    setup: RunPlan,
    faults: int,
    time: float,
) -> SimulationError:
    """What to tell of a run with faults that cannot be mended.

    Args:
      state: in which the run began: the last good one.
      parameters, hindrance, box, setup: of the run.
      faults: that it has.
      time: at which it began, s.
    """
    span = _Span(state, setup, time, Fault(faults))
    if span.faults != Fault.UNSTABLE:  # that is of the whole bed
        span = _narrowed(span, parameters, hindrance, box)
    where = f"between {span.begins:.6g} and {span.ends:.6g} s"
    if span.end is not None:
        where = f"at {span.ends:.6g} s, {_who(span, span.end, parameters, box)}"
    error = SimulationError(f"{where}: {reasons(span.faults)} (steps of {setup.time_step:.3g} s)")
    error.state, error.time, error.faults = state, time, faults
    return error


def refuse_deep_start(state: State, parameters: Parameters, box: Box) -> None:
    """Refuses a start whose surfaces overlap by more than the contact law describes.

    Args:
      state, parameters: concrete.
      box: the container.

    Raises:
      SimulationError: the deepest contact, and how deep it is.
    """
    position = np.asarray(state.position)
    if not np.isfinite(position).all():
        return  # which the run says
    with jax.ensure_compile_time_eval():
        outer = evaluate_with_numpy(particle.outer_radius, parameters)
    depth, names = _deepest(position, np.broadcast_to(outer, len(position)), box)
    if depth > MAX_OVERLAP:
        error = SimulationError(f"at 0 s, {names}: {reasons(Fault.TOO_DEEP)}")
        error.state, error.time, error.faults = state, 0.0, int(Fault.TOO_DEEP)
        raise error


@dataclass(frozen=True)
class _Span:
    """A piece of a run that has a fault."""

    state: State  # at its beginning
    setup: RunPlan
    begins: float  # s
    faults: Fault
    end: State | None = None  # where it is a single step

    @property
    def ends(self) -> float:
        """Of the piece, s."""
        return self.begins + self.setup.duration


def _narrowed(span: _Span, parameters: Parameters, hindrance: Hindrance | None, box: Box) -> _Span:
    """The shortest piece of it, a single step if possible, that has a fault."""
    while span.end is None:
        setup, state, begins = _piece(span.setup), span.state, span.begins
        while begins < span.ends - 0.5 * setup.duration:
            run = _once(state, parameters, hindrance, box, setup)
            if not run.fault:
                state, begins = run.state, begins + setup.duration
            elif (mended := setup.mended(int(run.fault), state.particles)) is not None:
                setup = mended
            else:
                break
        else:
            return span  # rounded otherwise, it does not come again
        end = run.state if setup.cuts.total == 1 else None
        span = _Span(state, setup, begins, Fault(int(run.fault)), end)
    return span


def _piece(setup: RunPlan) -> RunPlan:
    """Of a run, about one of its PIECES; as many steps between looks at the list, or fewer."""
    cuts = setup.cuts
    most = max(1, cuts.total // PIECES)
    steps = min(cuts.steps, most)
    shorter = Schedule(frames=1, intervals=most // steps, steps=steps)
    duration = setup.duration * shorter.total / cuts.total
    return replace(setup, duration=duration, cuts=shorter, trajectory=False, spoil=False)


_once = jax.jit(run_once, static_argnames=("box", "setup"))


def _who(step: _Span, end: State, parameters: Parameters, box: Box) -> str:
    """The particles to which a single step brought its faults, in words."""
    faults = step.faults
    position, velocity, spin = map(np.asarray, (end.position, end.velocity, end.spin))
    if Fault.NOT_FINITE in faults:
        finite = np.isfinite(np.hstack([position, velocity, spin])).all(axis=1)
        return _named(np.flatnonzero(~finite))
    if Fault.ESCAPED in faults:
        outside = np.maximum(-position, position - np.array(box.size))[:, box.walled_axes]
        return _named(outside.max(axis=1).argmax(keepdims=True))
    if faults & (Fault.TOO_DEEP | Fault.THROUGH_COATING):
        # Contacts are looked at half-way.
        before, drift = np.asarray(step.state.position), np.asarray(step.state.velocity)
        radius = np.asarray(particle.outer_radius(parameters))
        half_way = before + 0.5 * step.setup.duration * drift
        return _deepest(half_way, np.broadcast_to(radius, len(half_way)), box)[1]
    return _named((velocity**2).sum(axis=1).argmax(keepdims=True))


def _named(particles: np.ndarray) -> str:
    """Some particles by number."""
    few = ", ".join(map(str, particles[:3]))
    others = f" and {particles.size - 3} others" if particles.size > 3 else ""
    return f"particle{'s' * (particles.size > 1)} {few}{others}"


def _deepest(position: np.ndarray, radius: np.ndarray, box: Box) -> tuple[float, str]:
    """The greatest overlap, in radii, and the contact that has it with its depth, in words.

    Args:
      position: centres, (N, 3) in m.
      radius: of the coated particles, (N,) in m.
      box: the container.
    """
    size, periodic = np.array(box.size), np.array(box.periodic)
    wrapped = np.where(periodic, position - size * np.floor(position / size), position)
    wrapped = np.where(periodic & (wrapped >= size), 0.0, wrapped)  # by rounding
    tree = cKDTree(wrapped, boxsize=np.where(periodic, size, 0.0))
    first, second = tree.query_pairs(2.0 * radius.max(), output_type="ndarray").T
    contacts = [(0.0, "nothing")]
    if first.size:
        apart = wrapped[first] - wrapped[second]
        apart -= np.where(periodic, size * np.round(apart / size), 0.0)
        overlap = radius[first] + radius[second] - np.sqrt((apart**2).sum(axis=1))
        depth = overlap / np.minimum(radius[first], radius[second])
        who = int(depth.argmax())
        contacts.append((float(depth[who]), f"particles {first[who]} and {second[who]}"))
    for axis in box.walled_axes:
        for end, gap in (("lower", position[:, axis]), ("upper", size[axis] - position[:, axis])):
            depth = 1.0 - gap / radius
            who = int(depth.argmax())
            contacts.append(
                (float(depth[who]), f"particle {who} and the {end} wall in {AXES[axis]}")
            )
    deepest, names = max(contacts)
    return deepest, f"{names}, {deepest:.2g} radii deep"
