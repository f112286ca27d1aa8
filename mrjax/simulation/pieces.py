"""Runs in pieces of a fraction of a second, which can be watched, stopped, stored and continued.

One compiled program takes the whole motion and advances it. The numbers of frames and intervals are
its arguments, so that the bits of a run do not depend on its pieces.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from mrjax.core.interruption import Stop, in_a_thread
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.dem import scan, sorting
from mrjax.dem.engine import Motion, Observed
from mrjax.dem.plan import Matter, RunPlan, System
from mrjax.dem.reduced_units import reduced, run_in_si
from mrjax.dem.schedule import Schedule
from mrjax.simulation.failure import failure, refuse_deep_start
from mrjax.simulation.recording import Recording, named_arrays, tree_of_arrays

T = TypeVar("T")

PIECE = 0.25
"""Time that a piece takes, s. An interruption waits for the end of a piece."""
FIRST_PIECE = 0.05
"""Time that the first piece takes, s; the pace is a guess there."""
PATIENCE = 1.0
"""Expected time of a piece above which its call runs in a thread, s. An interval of very many
particles takes longer, and an interruption does not wait for it then."""
NUMBERS = 2**18
"""Greatest number of heights that one piece records."""
MOST_ROWS = 1024
"""Greatest number of frames that one piece records."""


class _Pace:
    """Estimate of the time that an interval takes, s."""

    def __init__(self, guess: float) -> None:
        self.seconds, self.measured = guess, False

    def intervals(self) -> int:
        """Number of intervals for a piece."""
        return max(1, int((PIECE if self.measured else FIRST_PIECE) / self.seconds))

    def update(self, seconds: float, intervals: int, compiled: bool) -> None:
        """Updates the estimate after a piece, unless its time includes the compilation."""
        if compiled or not intervals:
            return
        # At most four times as many intervals: a first measurement may be of a quiet moment.
        self.seconds = max(seconds / intervals, 0.25 * self.seconds)
        self.measured = True


class Place(NamedTuple):
    """The place that a run has reached."""

    motion: Motion
    frame: int  # number of complete frames
    interval: int  # number of complete intervals of the next frame


class PiecewiseRun:
    """One run of concrete values, which advances by the number of frames asked for.

    A fault that larger buffers repair takes the run back to the beginning of its frame.
    """

    def __init__(
        self, system: System, plan: RunPlan, *, stop: Stop, stretch: Array | None = None
    ) -> None:
        """Prepares a run at its start.

        Args:
          system: the system, with concrete values.
          plan: plan of the run; its schedule gives the length of a frame.
          stop: request to stop, checked before every piece.
          stretch: edges of the container over those of the system's periodic box, at least 1, (3,);
            runs in containers of many sizes then share one compiled program.

        Raises:
          SimulationError: particles overlap too deeply at the start.
        """
        if stretch is None:
            refuse_deep_start(system)
        self.stretch = stretch
        self.original, self.system, self.plan, self.stop = system, system, plan, stop
        self.back: np.ndarray | None = None
        if system.particles >= sorting.SORT_FROM:
            cell = plan.neighbour_list.cell * plan.unit_length
            order = sorting.spatial_order(system.state.position, system.box, cell)
            self.system = sorting.permute_system(system, order)
            self.back = np.argsort(np.asarray(order))
        self.frames = plan.schedule.frames  # in the duration of the plan
        self.steps = 0
        self.faults: list[int] = []
        self.most_rows = int(np.clip(NUMBERS // self.particles, 1, MOST_ROWS))
        self.pace = _Pace((2e-6 + 8e-8 * self.particles) * plan.schedule.steps)
        self._compiled = False
        motion, at_start = self._begin(self.system.state)
        self.recording = Recording(self._in_si(at_start), self.back)
        self.place = self.at_frame = Place(motion, 0, 0)

    @property
    def particles(self) -> int:
        """N."""
        return self.system.particles

    @property
    def frame_length(self) -> float:
        """Time between two frames, s."""
        return self.plan.frame_duration

    @property
    def done(self) -> float:
        """Number of complete frames, plus the complete share of the next."""
        return self.place.frame + self.place.interval / self.plan.schedule.intervals

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed of the particles at the start and in every frame so far, m/s."""
        return self.recording.mean_speed

    def advance(self, frames: int, watch: Callable[[int], object] = lambda steps: None) -> None:
        """Completes further frames.

        Args:
          frames: number of frames, at least 0.
          watch: function called after every piece with the number of its steps.

        Raises:
          SimulationError: a fault cannot be repaired; the error carries the state at the beginning
            of its frame.
          StoppedError: `stop` asks for it.
        """
        self.advance_to(self.place.frame + frames, 0, watch)

    def advance_to(
        self, frame: int, interval: int, watch: Callable[[int], object] = lambda steps: None
    ) -> None:
        """Advances to an interval of the frame after `frame` complete ones; raises as `advance`."""
        while (self.place.frame, self.place.interval) < (frame, interval):
            self.stop.check()
            before = self.steps
            most = interval if self.place.frame == frame else self.plan.schedule.intervals
            self._piece(frame - self.place.frame, most)
            watch(self.steps - before)

    def run(self) -> Run:
        """The run so far: its complete frames, and the present state."""
        schedule = replace(self.plan.schedule, frames=max(1, self.place.frame))
        plan = replace(self.plan, duration=self.frame_length * schedule.frames, schedule=schedule)
        run = self._run(self.place.motion, self.recording.whole(), plan)
        times = jnp.asarray(self._times(), run.times.dtype)
        run = replace(run, times=times, time_step=self.plan.time_step, steps=self.steps)
        radius = run.radius if self.back is None else run.radius[self.back]
        run = replace(run, state=self._in_original_order(run.state), radius=radius)
        return jax.tree.map(jnp.asarray, run)

    def kept(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Arrays to store on disk: the records since the last call, and the place of the run.

        Positions are in the reduced units of the run, so that it continues with the same bits.
        """
        place = self.place
        arrays = {
            **named_arrays("motion", place.motion),
            **named_arrays("beginning", self.at_frame.motion if place.interval else None),
            "place": np.array([place.frame, place.interval, self.steps]),
            "faults": np.array(self.faults, np.int64),
        }
        return self.recording.new_arrays(), arrays

    def restore(self, recorded: list[dict[str, np.ndarray]], place: dict[str, np.ndarray]) -> None:
        """Continues from the records of all calls of `kept`, and from the place of the last call.

        Raises:
          KeyError: an array is missing.
        """
        for fault in place["faults"]:
            larger = self.plan.with_larger_buffers(int(fault), self.particles)
            assert larger is not None  # the same repair succeeded before
            self.plan = larger
            self.faults.append(int(fault))
        # Velocities are in units of the step.
        begin, self.matter = self._reduced()
        settings = self.plan.settings(self.system.box)
        like, _ = jax.eval_shape(partial(scan.begin, settings=settings), *begin, self.matter)
        frame, interval, self.steps = map(int, place["place"])
        self.place = self.at_frame = Place(tree_of_arrays("motion", place, like), frame, interval)
        if interval:
            self.at_frame = Place(tree_of_arrays("beginning", place, like), frame, 0)
        self.recording.restore(recorded)

    def _times(self) -> np.ndarray:
        """Times of the start and of all frames so far, s, with the same bits in longer runs."""
        duration, frame = self.plan.duration, np.arange(self.place.frame + 1)
        within = np.linspace(0.0, duration, self.frames + 1)
        return duration * (frame // self.frames) + within[frame % self.frames]

    def _begin(self, state: State) -> tuple[Motion, Observed]:
        """The motion at a state by the present plan, and the observables there."""
        self.system = self.system._replace(state=state)
        begin, self.matter = self._reduced()
        settings = self.plan.settings(self.system.box)
        motion, at_start = scan.begin(*begin, self.matter, settings=settings)
        return motion, _on_host(at_start)

    def _reduced(self) -> tuple[tuple, Matter]:
        system = self.system._replace(state=_on_host(self.system.state))
        begin, matter = reduced(system, self.plan)
        return begin, matter._replace(material=self.system.state.material, stretch=self.stretch)

    def _piece(self, frames: int, most: int) -> None:
        """Advances by at most `frames` whole frames, or within one, at most to interval `most`."""
        schedule, (motion, _, interval) = self.plan.schedule, self.place
        fit = self.pace.intervals()
        whole = min(frames, self.most_rows, fit // schedule.intervals) if interval == 0 else 0
        if whole:
            count, intervals = whole, schedule.intervals
        else:
            count, intervals = 1, min(fit, most - interval)
        start = time.perf_counter()
        after, rows, good = self._advanced(motion, count, intervals)
        self.pace.update(time.perf_counter() - start, good, not self._compiled)
        self._compiled = True
        if int(after.fault):
            self._repair(int(after.fault), good)
            return
        complete = count if whole else int(interval + intervals == schedule.intervals)
        self._accept(after, rows, complete, 0 if complete else interval + intervals)
        self.steps += count * intervals * schedule.steps

    def _accept(self, motion: Motion, rows: Observed, frames: int, interval: int) -> None:
        """Accepts a piece without a fault: the frames that it completed, or a part of a frame."""
        self.place = Place(motion, self.place.frame + frames, interval)
        if frames:
            self.recording.add(self._in_si(jax.tree.map(lambda leaf: leaf[:frames], rows)))
            self.at_frame = self.place

    def _repair(self, fault: int, good: int) -> None:
        """Goes back to the beginning of the frame with a fault, with larger buffers.

        Args:
          fault: the fault.
          good: number of intervals of the piece before the fault.

        Raises:
          SimulationError: the fault cannot be repaired.
        """
        schedule, interval = self.plan.schedule, self.place.interval
        if interval == 0 and good >= schedule.intervals:
            whole = good // schedule.intervals
            after, rows, _ = self._advanced(self.place.motion, whole, schedule.intervals)
            self._accept(after, rows, whole, 0)
            self.steps += whole * schedule.intervals * schedule.steps
            good -= whole * schedule.intervals
        self.steps -= interval * schedule.steps
        self.place, good = self.at_frame, interval + good
        larger = self.plan.with_larger_buffers(fault, self.particles)
        if larger is None:
            raise self._failure(fault, good)
        self.faults.append(fault)
        before, state = self.place, self._state(self.place.motion)
        self.plan = larger
        motion, _ = self._begin(state)
        motion = motion._replace(overlap=before.motion.overlap)
        self.place = self.at_frame = Place(motion, before.frame, 0)

    def _failure(self, fault: int, good: int) -> Exception:
        """The error of a fault in the present frame, after `good` intervals without one."""
        (motion, frame, _), steps = self.place, self.plan.schedule.steps
        last_good, time = self._in_original_order(self._state(motion)), frame * self.frame_length
        if good:
            motion, _, _ = self._advanced(motion, 1, good)
        interval = self.plan.with_schedule(Schedule(frames=1, intervals=1, steps=steps))
        state = self._in_original_order(self._state(motion))
        system = self.original._replace(state=state)
        error = failure(system, interval, fault, time + good * interval.duration)
        error.state, error.time = last_good, time
        return error

    def _advanced(
        self, motion: Motion, frames: int, intervals: int
    ) -> tuple[Motion, Observed, int]:
        """The motion after `frames` frames of `intervals` intervals, or after its first fault.

        Returns:
          The motion; the records of its frames, on the host; the number of intervals without fault.
        """

        def call() -> tuple[Motion, Observed, int]:
            after, rows, good = scan.advance(
                motion,
                self.matter,
                np.int32(frames),
                np.int32(intervals),
                rows=self.most_rows,
                settings=self.plan.settings(self.system.box),
            )
            return after, _on_host(rows), int(good)

        expected = frames * intervals * self.pace.seconds
        after, rows, good = in_a_thread(call, self.stop) if expected > PATIENCE else call()
        return after, jax.tree.map(lambda leaf: leaf[:frames], rows), good

    def _run(self, motion: Motion, observed: Observed, plan: RunPlan) -> Run:
        """The run that ends with a motion, in SI, with particles in the order of the motion."""
        outcome = scan.conclude(motion, self.matter, settings=self.plan.settings(self.system.box))
        trusted = _trusted(self.system.state.position.dtype)
        ends = _on_host(motion), observed, _on_host(outcome)
        return run_in_si(self.system, self.matter, *ends, plan, trusted)

    def _state(self, motion: Motion) -> State:
        """The state of a motion, in SI, with particles in the order of the motion."""
        run = self._run(motion, self.recording.empty_row(), self.plan)
        return jax.tree.map(jnp.asarray, run.state)

    def _in_original_order(self, state: State) -> State:
        return state if self.back is None else sorting.permute_state(state, jnp.asarray(self.back))

    def _in_si(self, rows: Observed) -> Observed:
        return rows.in_lab_units(self.plan.units, _trusted(rows.speed.dtype))


def _trusted(dtype: DTypeLike) -> Any:
    """The factor on the numbers of a run without faults, 1, as an array of numpy."""
    return np.ones((), dtype)


def _on_host(tree: T) -> T:
    """The same tree with arrays of numpy."""
    return jax.tree.map(np.asarray, tree)
