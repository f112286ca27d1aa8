"""A run in pieces of a fraction of a second: watched, stopped, kept on disk and continued.

One compiled program takes the whole motion and advances it. Numbers of frames and intervals are
arguments of it, so that the bits of a run do not depend on its pieces.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
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
"""Length of a piece, s: an interruption waits for the end of one."""
FIRST_PIECE = 0.05
"""Length of the first piece, s, whose pace is a guess."""
PATIENCE = 1.0
"""Time that a piece may take before its call is left to a thread, s: an interval of very many
particles takes longer, and an interruption does not wait for it then."""
NUMBERS = 2**18
"""Heights that one piece may record."""
MOST_ROWS = 1024
"""Frames that one piece may record."""


class _Pace:
    """Seconds that an interval takes, as far as is known."""

    def __init__(self, guess: float) -> None:
        self.seconds, self.measured = guess, False

    def intervals(self) -> int:
        """Intervals that a piece should take."""
        return max(1, int((PIECE if self.measured else FIRST_PIECE) / self.seconds))

    def update(self, seconds: float, intervals: int, compiled: bool) -> None:
        """Takes in what a piece took; the first one was compiled besides."""
        if compiled or not intervals:
            return
        # Four times as many at most: a first measurement may be of a moment's rest.
        self.seconds = max(seconds / intervals, 0.25 * self.seconds)
        self.measured = True


class Place(NamedTuple):
    """The place in a run that it has reached."""

    motion: Motion
    frame: int  # frames that are complete
    interval: int  # intervals of the next one that are complete


class PiecewiseRun:
    """One run of concrete values, which advances as far as it is asked to.

    A fault that larger buffers repair takes the run back to the beginning of its frame.
    """

    def __init__(self, system: System, plan: RunPlan, *, stop: Stop) -> None:
        """A run that is about to begin.

        Args:
          system: what is run, concrete.
          plan: of the run; its schedule says how long a frame is.
          stop: looked at after every piece.

        Raises:
          SimulationError: the start overlaps too deeply.
        """
        refuse_deep_start(system)
        self.given, self.system, self.plan, self.stop = system, system, plan, stop
        self.back: np.ndarray | None = None
        if system.particles >= sorting.SORT_FROM:
            cell = plan.neighbour_list.cell * plan.unit_length
            order = sorting.spatial_order(system.state.position, system.box, cell)
            self.system = sorting.permute_system(system, order)
            self.back = np.argsort(np.asarray(order))
        self.frames = plan.schedule.frames  # those that are wanted
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
        """Frames that are complete, and the share of the next."""
        return self.place.frame + self.place.interval / self.plan.schedule.intervals

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed of the particles at the start and in every frame so far, m/s."""
        return self.recording.mean_speed

    def advance(self, frames: int, watch: Callable[[int], object] = lambda steps: None) -> None:
        """Completes as many further frames.

        Args:
          frames: at least 0.
          watch: called after every piece with the steps that it took.

        Raises:
          SimulationError: a fault that cannot be repaired; the error carries the state at the
            beginning of its frame.
          StoppedError: as `stop` asks for.
        """
        self.advance_to(self.place.frame + frames, 0, watch)

    def advance_to(
        self, frame: int, interval: int, watch: Callable[[int], object] = lambda steps: None
    ) -> None:
        """Advances to some intervals beyond a number of frames; raises as `advance`."""
        while (self.place.frame, self.place.interval) < (frame, interval):
            self.stop.check()
            before = self.steps
            most = interval if self.place.frame == frame else self.plan.schedule.intervals
            self._piece(frame - self.place.frame, most)
            watch(self.steps - before)

    def run(self) -> Run:
        """The run so far, whole frames only, with the state of this moment."""
        schedule = replace(self.plan.schedule, frames=max(1, self.place.frame))
        plan = replace(self.plan, duration=self.frame_length * schedule.frames, schedule=schedule)
        run = self._run(self.place.motion, self.recording.whole(), plan)
        times = jnp.asarray(self._times(), run.times.dtype)
        run = replace(run, times=times, time_step=self.plan.time_step, steps=self.steps)
        radius = run.radius if self.back is None else run.radius[self.back]
        run = replace(run, state=self._in_original_order(run.state), radius=radius)
        return jax.tree.map(jnp.asarray, run)

    def kept(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """All that is to be kept on disk: what was recorded since the last call; where it stands.

        Positions are those of the run, in reduced units: continued from them it has the same bits.
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
        """Continues from what `kept` gave, call after call, and from the last place.

        Raises:
          KeyError: an array that is missing.
        """
        for fault in place["faults"]:
            larger = self.plan.with_larger_buffers(int(fault), self.particles)
            assert larger is not None  # it was then
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
        """Times of the start and of all frames so far, s: the same however many there are."""
        duration, frame = self.plan.duration, np.arange(self.place.frame + 1)
        within = np.linspace(0.0, duration, self.frames + 1)
        return duration * (frame // self.frames) + within[frame % self.frames]

    def _begin(self, state: State) -> tuple[Motion, Observed]:
        """The motion from a state by the present plan, and what is observed there."""
        self.system = self.system._replace(state=state)
        begin, self.matter = self._reduced()
        settings = self.plan.settings(self.system.box)
        motion, at_start = scan.begin(*begin, self.matter, settings=settings)
        return motion, _on_host(at_start)

    def _reduced(self) -> tuple[tuple, Matter]:
        system = self.system._replace(state=_on_host(self.system.state))
        begin, matter = reduced(system, self.plan)
        return begin, matter._replace(material=self.system.state.material)

    def _piece(self, frames: int, most: int) -> None:
        """Whole frames, at most so many, or some intervals of one, at most up to `most`."""
        schedule, (motion, _, interval) = self.plan.schedule, self.place
        fit = self.pace.intervals()
        whole = min(frames, self.most_rows, fit // schedule.intervals) if interval == 0 else 0
        if whole:
            count, intervals = whole, schedule.intervals
        else:
            count, intervals = 1, min(fit, most - interval)
        began = time.perf_counter()
        after, rows, good = self._advanced(motion, count, intervals)
        self.pace.update(time.perf_counter() - began, good, not self._compiled)
        self._compiled = True
        if int(after.fault):
            self._repair(int(after.fault), good)
            return
        complete = count if whole else int(interval + intervals == schedule.intervals)
        self._accept(after, rows, complete, 0 if complete else interval + intervals)
        self.steps += count * intervals * schedule.steps

    def _accept(self, motion: Motion, rows: Observed, frames: int, interval: int) -> None:
        """Takes whole frames that a piece completed, or a piece of one."""
        self.place = Place(motion, self.place.frame + frames, interval)
        if frames:
            self.recording.add(self._in_si(jax.tree.map(lambda leaf: leaf[:frames], rows)))
            self.at_frame = self.place

    def _repair(self, fault: int, good: int) -> None:
        """Goes back to the beginning of the frame, with larger buffers where that helps.

        Args:
          fault: that was met.
          good: intervals of the piece before it.

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
        """The error of a fault in an interval of the present frame, after so many good ones."""
        (motion, frame, _), steps = self.place, self.plan.schedule.steps
        last_good, time = self._in_original_order(self._state(motion)), frame * self.frame_length
        if good:
            motion, _, _ = self._advanced(motion, 1, good)
        one = self.plan.with_schedule(Schedule(frames=1, intervals=1, steps=steps))
        state = self._in_original_order(self._state(motion))
        system = self.given._replace(state=state)
        error = failure(system, one, fault, time + good * one.duration)
        error.state, error.time = last_good, time
        return error

    def _advanced(
        self, motion: Motion, frames: int, intervals: int
    ) -> tuple[Motion, Observed, int]:
        """The motion after so many frames of so many intervals, or after its first fault.

        Returns:
          the motion; what its frames recorded, on the host; how many intervals had no fault.
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
        """The run that ends with a motion, in SI, in the order of the motion."""
        outcome = scan.conclude(motion, self.matter, settings=self.plan.settings(self.system.box))
        trusted = _trusted(self.system.state.position.dtype)
        ends = _on_host(motion), observed, _on_host(outcome)
        return run_in_si(self.system, self.matter, *ends, plan, trusted)

    def _state(self, motion: Motion) -> State:
        """The state of a motion, in SI, in the order of the motion."""
        run = self._run(motion, self.recording.empty_row(), self.plan)
        return jax.tree.map(jnp.asarray, run.state)

    def _in_original_order(self, state: State) -> State:
        return state if self.back is None else sorting.permute_state(state, jnp.asarray(self.back))

    def _in_si(self, rows: Observed) -> Observed:
        return rows.in_lab_units(self.plan.units, _trusted(rows.speed.dtype))


def _trusted(dtype: DTypeLike) -> Any:
    """The factor on numbers of a run that is to be trusted, by numpy."""
    return np.ones((), dtype)


def _on_host(tree: T) -> T:
    """The same with numpy's arrays."""
    return jax.tree.map(np.asarray, tree)
