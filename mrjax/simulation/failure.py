"""Finds when and with which particle a run went wrong, by repeating the part that failed.

A run without a fault has no cost for it. The part is repeated in ever shorter pieces, down to a
single step. The positions after that step, faulty as they are, show the particles.
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
from mrjax.dem.forces import greatest_overlap
from mrjax.dem.plan import RunPlan, System
from mrjax.dem.scan import run_once
from mrjax.dem.schedule import Schedule
from mrjax.laws import particle

PIECES = 256
"""Number of pieces into which a failed part is divided, and again each piece that fails."""


def failure(system: System, plan: RunPlan, faults: int, time: float) -> SimulationError:
    """The error of a run with faults that cannot be repaired.

    Args:
      system: the system, with the state at which the run began, the last good one.
      plan: plan of the run.
      faults: faults of the run, a `Fault`.
      time: time at which the run began, s.
    """
    span = _Span(system.state, plan, time, Fault(faults))
    if span.faults != Fault.UNSTABLE:  # an instability is one of the whole bed
        span = _narrowed(span, system)
    where = f"between {span.begins:.6g} and {span.ends:.6g} s"
    if span.end is not None:
        where = f"at {span.ends:.6g} s, {_who(span, span.end, system.parameters, system.box)}"
    error = SimulationError(f"{where}: {reasons(span.faults)} (steps of {plan.time_step:.3g} s)")
    error.state, error.time, error.faults = system.state, time, faults
    return error


def refuse_deep_start(system: System) -> None:
    """Refuses a start at which surfaces overlap by more than the contact law describes.

    Args:
      system: the system, with concrete values.

    Raises:
      SimulationError: a contact is too deep; the error names the deepest, and its depth.
    """
    state, parameters, box = system.state, system.parameters, system.box
    position = np.asarray(state.position)
    if not np.isfinite(position).all():
        return  # the run itself reports such positions
    with jax.ensure_compile_time_eval():
        outer = evaluate_with_numpy(particle.outer_radius, parameters)
    depth, names = _deepest(position, np.broadcast_to(outer, len(position)), box)
    if depth > greatest_overlap(system.forces):
        error = SimulationError(f"at 0 s, {names}: {reasons(Fault.TOO_DEEP)}")
        error.state, error.time, error.faults = state, 0.0, int(Fault.TOO_DEEP)
        raise error


@dataclass(frozen=True)
class _Span:
    """A piece of a run that has a fault."""

    state: State  # at its beginning
    plan: RunPlan
    begins: float  # s
    faults: Fault
    end: State | None = None  # at its end, if it is a single step

    @property
    def ends(self) -> float:
        """End of the piece, s."""
        return self.begins + self.plan.duration


def _narrowed(span: _Span, system: System) -> _Span:
    """The shortest piece of a span that has a fault, a single step if possible."""
    while span.end is None:
        plan, state, begins = _piece(span.plan), span.state, span.begins
        while begins < span.ends - 0.5 * plan.duration:
            run = _once(system._replace(state=state), plan)
            if not run.fault:
                state, begins = run.state, begins + plan.duration
                continue
            larger = plan.with_larger_buffers(int(run.fault), system.particles)
            if larger is None:
                break
            plan = larger
        else:
            return span  # pieces round differently, and the fault does not recur
        end = run.state if plan.schedule.total == 1 else None
        span = _Span(state, plan, begins, Fault(int(run.fault)), end)
    return span


def _piece(plan: RunPlan) -> RunPlan:
    """The plan of one of about `PIECES` pieces of a run, with no more steps between rebuilds."""
    schedule = plan.schedule
    most = max(1, schedule.total // PIECES)
    steps = min(schedule.steps, most)
    shorter = Schedule(frames=1, intervals=most // steps, steps=steps)
    duration = plan.duration * shorter.total / schedule.total
    return replace(plan, duration=duration, schedule=shorter, trajectory=False, nan_on_fault=False)


_once = jax.jit(run_once, static_argnames="plan")


def _who(step: _Span, end: State, parameters: Parameters, box: Box) -> str:
    """The particles that are at fault after a single step, in words."""
    faults = step.faults
    position, velocity, spin = map(np.asarray, (end.position, end.velocity, end.spin))
    if Fault.NOT_FINITE in faults:
        finite = np.isfinite(np.hstack([position, velocity, spin])).all(axis=1)
        return _named(np.flatnonzero(~finite))
    if Fault.ESCAPED in faults:
        outside = np.maximum(-position, position - np.array(box.size))[:, box.walled_axes]
        return _named(outside.max(axis=1).argmax(keepdims=True))
    if faults & (Fault.TOO_DEEP | Fault.THROUGH_COATING):
        # Contacts are evaluated at the half-way positions of a step.
        before, drift = np.asarray(step.state.position), np.asarray(step.state.velocity)
        radius = np.asarray(particle.outer_radius(parameters))
        half_way = before + 0.5 * step.plan.duration * drift
        return _deepest(half_way, np.broadcast_to(radius, len(half_way)), box)[1]
    return _named((velocity**2).sum(axis=1).argmax(keepdims=True))


def _named(particles: np.ndarray) -> str:
    """The numbers of the first three particles, and how many others there are, in words."""
    few = ", ".join(map(str, particles[:3]))
    others = f" and {particles.size - 3} others" if particles.size > 3 else ""
    return f"particle{'s' * (particles.size > 1)} {few}{others}"


def _deepest(position: np.ndarray, radius: np.ndarray, box: Box) -> tuple[float, str]:
    """The greatest overlap, in radii, and the contact that has it with its depth, in words.

    Args:
      position: centres, (N, 3) in m.
      radius: radius of the coated particles, (N,) in m.
      box: the container.
    """
    size, periodic = np.array(box.size), np.array(box.periodic)
    wrapped = box.inside(position, below=True)
    tree = cKDTree(wrapped, boxsize=np.where(periodic, size, 0.0))
    first, second = tree.query_pairs(2.0 * radius.max(), output_type="ndarray").T
    contacts = [(0.0, "nothing")]
    if first.size:
        separation = wrapped[first] - wrapped[second]
        separation -= np.where(periodic, size * np.round(separation / size), 0.0)
        overlap = radius[first] + radius[second] - np.sqrt((separation**2).sum(axis=1))
        depth = overlap / np.minimum(radius[first], radius[second])
        index = int(depth.argmax())
        contacts.append((float(depth[index]), f"particles {first[index]} and {second[index]}"))
    for axis in box.walled_axes:
        for end, gap in (("lower", position[:, axis]), ("upper", size[axis] - position[:, axis])):
            depth = 1.0 - gap / radius
            index = int(depth.argmax())
            contacts.append(
                (float(depth[index]), f"particle {index} and the {end} wall in {AXES[axis]}")
            )
    deepest, names = max(contacts)
    return deepest, f"{names}, {deepest:.2g} radii deep"
