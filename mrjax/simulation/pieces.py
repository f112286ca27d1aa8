"""A run in pieces of a fraction of a second: it can be watched, stopped, kept, and gone on with.

One compiled program takes the whole motion and goes on with it. How many frames and intervals it
takes are arguments, so that the bits of a run do not depend on its pieces.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import DTypeLike

from mrjax.core.box import Box
from mrjax.core.interruption import Stop, in_a_thread
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.dem import sorting
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.engine import Engine, Motion, Observed, Outcome
from mrjax.dem.scan import RunPlan, in_lab_units, reduced
from mrjax.dem.schedule import Schedule
from mrjax.laws.hindrance import Hindrance
from mrjax.simulation.failure import failure, refuse_deep_start

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
        self.seconds, self.known = guess, False

    def intervals(self) -> int:
        """As many as a piece should take."""
        return max(1, int((PIECE if self.known else FIRST_PIECE) / self.seconds))

    def told(self, seconds: float, intervals: int, compiled: bool) -> None:
        """What a piece took; the first one was compiled besides."""
        if compiled or not intervals:
            return
        measured = seconds / intervals
        # Four times as many at most: a first measurement may be of a moment's rest.
        self.seconds = max(measured, 0.25 * self.seconds)
        self.known = True


class Place(NamedTuple):
    """How far a run has come."""

    motion: Motion
    frame: int  # frames that are complete
    interval: int  # intervals of the next one that are complete


class Pieces:
    """One run of concrete values, which goes on as far as it is asked to.

    A fault that can be mended takes the run back to the beginning of its frame. What the frames
    recorded is in `rows`, in SI.
    """

    def __init__(
        self,
        state: State,
        parameters: Parameters,
        hindrance: Hindrance | None,
        box: Box,
        setup: RunPlan,
        *,
        stop: Stop,
    ) -> None:
        """A run that is about to begin.

        Args:
          state, parameters, hindrance, box: of the run, concrete.
          setup: of the run; its schedule says how long a frame is.
          stop: looked at after every piece.

        Raises:
          SimulationError: the start overlaps too deeply.
        """
        refuse_deep_start(state, parameters, box)
        self.hindrance, self.box, self.stop = hindrance, box, stop
        self.back: np.ndarray | None = None
        self.given = state, parameters
        if state.particles >= sorting.SORT_FROM:
            places = sorting.spatial_order(state.position, box, setup.plan.cell * setup.unit_length)
            state, parameters = (
                sorting.permute_state(state, places),
                sorting.permute_parameters(parameters, places),
            )
            self.back = np.argsort(np.asarray(places))
        self.parameters, self.setup = parameters, setup
        self.frames = setup.cuts.frames  # those that are wanted
        self.steps = 0
        self.faults: list[int] = []
        self.rows: list[Observed] = []
        self._told = 0
        particles = state.particles
        self.most_rows = int(np.clip(NUMBERS // particles, 1, MOST_ROWS))
        self.pace = _Pace((2e-6 + 8e-8 * particles) * setup.cuts.steps)
        self._compiled = False
        motion, at_start = self._begun(state)
        self._record(jax.tree.map(lambda leaf: leaf[None], at_start))
        self.place = self.at_frame = Place(motion, 0, 0)

    @property
    def particles(self) -> int:
        """N."""
        return self.state.particles

    @property
    def frame_length(self) -> float:
        """Time between two frames, s."""
        return self.setup.duration / self.setup.cuts.frames

    @property
    def done(self) -> float:
        """Frames that are complete, and what is of the next."""
        return self.place.frame + self.place.interval / self.setup.cuts.intervals

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed of the particles at the start and in every frame so far, m/s."""
        return np.concatenate([seen.speed for seen in self.rows])

    def go_on(self, frames: int, watch: Callable[[int], object] = lambda steps: None) -> None:
        """Completes as many further frames.

        Args:
          frames: at least 0.
          watch: told after every piece how many steps it took.

        Raises:
          SimulationError: a fault that cannot be mended; the error carries the state at the
            beginning of its frame.
          StoppedError: as `stop` asks for.
        """
        self.go_to(self.place.frame + frames, 0, watch)

    def go_to(
        self, frame: int, interval: int, watch: Callable[[int], object] = lambda steps: None
    ) -> None:
        """As far as some intervals beyond a number of frames; raises as `go_on`."""
        while (self.place.frame, self.place.interval) < (frame, interval):
            self.stop.look()
            before = self.steps
            most = interval if self.place.frame == frame else self.setup.cuts.intervals
            self._piece(frame - self.place.frame, most)
            watch(self.steps - before)

    def run(self) -> Run:
        """The run so far, whole frames only, with the state of this moment."""
        place = self.place
        cuts = replace(self.setup.cuts, frames=max(1, place.frame))
        setup = replace(self.setup, duration=self.frame_length * cuts.frames, cuts=cuts)
        outcome = self._outcome(place.motion)
        run = in_lab_units(
            self.state,
            self.reduced,
            _on_host(place.motion),
            self._recorded(),
            _on_host(outcome),
            self.box,
            setup,
            _sound(self.state.position.dtype),
        )
        times = jnp.asarray(self._times(), run.times.dtype)
        run = replace(run, times=times, time_step=self.setup.time_step, steps=self.steps)
        run = replace(run, state=self._in_given_order(run.state), radius=self._of_each(run.radius))
        return jax.tree.map(jnp.asarray, run)

    def kept(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """All that is to be kept on disk: what was recorded since the last call; where it stands.

        Positions are those of the run, in reduced units: what goes on from them has the same bits.
        """
        seen: Observed = jax.tree.map(lambda *leaves: np.concatenate(leaves), *self._fresh())
        self._told = len(self.rows)
        place = self.place
        arrays = {
            **_leaves("motion", place.motion),
            **_leaves("beginning", self.at_frame.motion if place.interval else None),
            "place": np.array([place.frame, place.interval, self.steps]),
            "faults": np.array(self.faults, np.int64),
        }
        return _leaves("seen", seen), arrays

    def restore(self, recorded: list[dict[str, np.ndarray]], place: dict[str, np.ndarray]) -> None:
        """Goes on from what `kept` gave, call after call, and from the last place."""
        for fault in place["faults"]:
            mended = self.setup.mended(int(fault), self.particles)
            assert mended is not None  # it was then
            self.setup = mended
            self.faults.append(int(fault))
        # Velocities are in units of the step.
        *begin, self.reduced = reduced(_on_host(self.state), self.parameters, self.box, self.setup)
        like = jax.eval_shape(
            partial(_begun, **self._how),
            *begin,
            self.reduced,
            self.state.material,
            self.hindrance,
        )
        frame, interval, self.steps = map(int, place["place"])
        motion = _tree("motion", place, like[0])
        self.place = self.at_frame = Place(motion, frame, interval)
        if interval:
            self.at_frame = Place(_tree("beginning", place, like[0]), frame, 0)
        row = self.rows[0]
        self.rows = [_tree("seen", seen, row) for seen in recorded]
        self._told = len(self.rows)

    def _fresh(self) -> list[Observed]:
        """What was recorded since `kept` was called last; a row of none at least."""
        nothing = jax.tree.map(lambda leaf: leaf[:0], self.rows[0])
        return [nothing, *self.rows[self._told :]]

    def _times(self) -> np.ndarray:
        """Of the start and of all frames so far, s: the same however many there are."""
        duration, frame = self.setup.duration, np.arange(self.place.frame + 1)
        within = np.linspace(0.0, duration, self.frames + 1)
        return duration * (frame // self.frames) + within[frame % self.frames]

    def _begun(self, state: State) -> tuple[Motion, Observed]:
        """The motion from a state by the present setup, and what is observed there."""
        self.state = state
        *begin, self.reduced = reduced(_on_host(state), self.parameters, self.box, self.setup)
        given = *begin, self.reduced, state.material, self.hindrance
        motion, at_start = _begun(*given, **self._how)
        return motion, _on_host(at_start)

    @property
    def _how(self) -> dict[str, Any]:
        setup = self.setup
        return dict(
            box=self.box.scaled(1 / setup.unit_length),
            plan=setup.plan,
            steps=setup.cuts.steps,
            laws=setup.laws,
            trajectory=setup.trajectory,
        )

    def _piece(self, frames: int, most: int) -> None:
        """Whole frames, at most so many, or some intervals of one, at most up to `most`."""
        cuts, (motion, _, interval) = self.setup.cuts, self.place
        fit = self.pace.intervals()
        whole = min(frames, self.most_rows, fit // cuts.intervals) if interval == 0 else 0
        if whole:
            count, intervals = whole, cuts.intervals
        else:
            count, intervals = 1, min(fit, most - interval)
        began = time.perf_counter()
        after, rows, good = self._advanced(motion, count, intervals)
        took = time.perf_counter() - began
        self.pace.told(took, good, not self._compiled)
        self._compiled = True
        if int(after.fault):
            self._mend(int(after.fault), good)
            return
        complete = count if whole else int(interval + intervals == cuts.intervals)
        self._accept(after, rows, complete, 0 if complete else interval + intervals)
        self.steps += count * intervals * cuts.steps

    def _accept(self, motion: Motion, rows: Observed, frames: int, interval: int) -> None:
        """Whole frames that a piece completed, or a piece of one."""
        self.place = Place(motion, self.place.frame + frames, interval)
        if frames:
            self._record(jax.tree.map(lambda leaf: leaf[:frames], rows))
            self.at_frame = self.place

    def _mend(self, fault: int, good: int) -> None:
        """Back to the beginning of the frame, and with more room where that helps.

        Args:
          fault: that was met.
          good: intervals of the piece before it.
        """
        cuts, interval = self.setup.cuts, self.place.interval
        if interval == 0 and good >= cuts.intervals:
            whole = good // cuts.intervals
            after, rows, _ = self._advanced(self.place.motion, whole, cuts.intervals)
            self._accept(after, rows, whole, 0)
            self.steps += whole * cuts.intervals * cuts.steps
            good -= whole * cuts.intervals
        self.steps -= interval * cuts.steps
        self.place, good = self.at_frame, interval + good
        mended = self.setup.mended(fault, self.particles)
        if mended is None:
            raise self._failure(fault, good)
        self.faults.append(fault)
        before, state = self.place, self._state(self.place.motion)
        self.setup = mended
        motion, _ = self._begun(state)
        motion = motion._replace(overlap=before.motion.overlap)
        self.place = self.at_frame = Place(motion, before.frame, 0)

    def _failure(self, fault: int, good: int) -> Exception:
        """What to tell of a fault in an interval of the present frame, after so many good ones."""
        setup, (motion, frame, _) = self.setup, self.place
        last_good, time = self._in_given_order(self._state(motion)), frame * self.frame_length
        if good:
            motion, _, _ = self._advanced(motion, 1, good)
        cuts = Schedule(frames=1, intervals=1, steps=setup.cuts.steps)
        one = replace(setup, duration=setup.time_step * cuts.steps, cuts=cuts)
        error = failure(
            self._in_given_order(self._state(motion)),
            self.given[1],
            self.hindrance,
            self.box,
            one,
            fault,
            time + good * one.duration,
        )
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
            after, rows, good = _advance(
                motion,
                self.reduced,
                self.state.material,
                self.hindrance,
                np.int32(frames),
                np.int32(intervals),
                rows=self.most_rows,
                **self._how,
            )
            return after, _on_host(rows), int(good)

        expected = frames * intervals * self.pace.seconds
        after, rows, good = in_a_thread(call, self.stop) if expected > PATIENCE else call()
        return after, jax.tree.map(lambda leaf: leaf[:frames], rows), good

    def _outcome(self, motion: Motion) -> Outcome:
        return _outcome(motion, self.reduced, self.state.material, self.hindrance, **self._how)

    def _state(self, motion: Motion) -> State:
        """The state of a motion, in SI, in the order of the motion."""
        nothing = jax.tree.map(lambda leaf: leaf[:1], self.rows[0])
        found = in_lab_units(
            self.state,
            self.reduced,
            _on_host(motion),
            nothing,
            _on_host(self._outcome(motion)),
            self.box,
            self.setup,
            _sound(self.state.position.dtype),
        )
        return jax.tree.map(jnp.asarray, found.state)

    def _in_given_order(self, state: State) -> State:
        return state if self.back is None else sorting.permute_state(state, jnp.asarray(self.back))

    def _of_each(self, values: Any) -> Any:
        return values if self.back is None else values[self.back]

    def _record(self, rows: Observed) -> None:
        """Keeps what frames recorded, in SI."""
        self.rows.append(rows.in_lab_units(self.setup.units, _sound(rows.speed.dtype)))

    def _recorded(self) -> Observed:
        """At the start and in every frame, in SI and in the order in which particles were given."""
        found: Observed = jax.tree.map(lambda *leaves: np.concatenate(leaves), *self.rows)
        if self.back is None:
            return found
        moved = jax.tree.map(lambda leaf: leaf[:, self.back], found.moved)
        return found._replace(heights=found.heights[:, self.back], moved=moved)


def _sound(dtype: DTypeLike) -> Any:
    """The factor on numbers of a run that is to be trusted, by numpy."""
    return np.ones((), dtype)


def _on_host(tree: T) -> T:
    """The same with numpy's arrays."""
    return jax.tree.map(np.asarray, tree)


def _leaves(name: str, tree: Any) -> dict[str, np.ndarray]:
    """The arrays of a tree by name."""
    leaves, _ = jax.tree.flatten_with_path(tree)
    return {f"{name}{jax.tree_util.keystr(path)}": np.asarray(leaf) for path, leaf in leaves}


def _tree(name: str, arrays: Mapping[str, np.ndarray], like: T) -> T:
    """The tree of which `_leaves` gave these arrays, among others."""
    leaves, structure = jax.tree.flatten_with_path(like)
    found = (arrays[f"{name}{jax.tree_util.keystr(path)}"] for path, _ in leaves)
    return jax.tree.unflatten(structure, found)


_STATIC = ("box", "plan", "steps", "laws", "trajectory")


@partial(jax.jit, static_argnames=_STATIC)
def _begun(
    position: Array,
    velocity: Array,
    spin: Array,
    notes: ParticleHistory,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    **how: Any,
) -> tuple[Motion, Observed]:
    """A motion and what is observed of it, in reduced units; (3, N) each."""
    engine = Engine(parameters, material, hindrance, position.shape[1], position.dtype, **how)
    motion = engine.begun(position, velocity, spin, notes)
    return motion, engine.observed(motion)


@partial(jax.jit, static_argnames=("rows", *_STATIC))
def _advance(
    motion: Motion,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    frames: Array,
    intervals: Array,
    *,
    rows: int,
    **how: Any,
) -> tuple[Motion, Observed, Array]:
    """The motion after frames x intervals, or after the first interval with a fault.

    Returns:
      the motion; what was recorded after every frame, (rows, ...); intervals without a fault.
    """
    engine = _engine(motion, parameters, material, hindrance, how)

    def good(motion: Motion) -> Array:
        return motion.fault == 0

    def interval(carry: tuple[Motion, Array]) -> tuple[Motion, Array]:
        motion, count = carry
        motion = engine.checked(engine.interval(motion))
        return motion, count + good(motion).astype(count.dtype)

    def frame(carry: tuple[Motion, Observed, Array, Array]) -> tuple:
        motion, seen, number, count = carry
        most = count + intervals
        motion, count = lax.while_loop(
            lambda carry: good(carry[0]) & (carry[1] < most), interval, (motion, count)
        )
        row = engine.observed(motion)
        seen = jax.tree.map(lambda leaf, now: leaf.at[number].set(now), seen, row)
        return motion, seen, number + 1, count

    nothing = jax.tree.map(
        lambda leaf: jnp.zeros((rows, *leaf.shape), leaf.dtype),
        jax.eval_shape(engine.observed, motion),
    )
    zero = jnp.zeros((), jnp.int32)
    motion, seen, _, count = lax.while_loop(
        lambda carry: good(carry[0]) & (carry[2] < frames), frame, (motion, nothing, zero, zero)
    )
    return motion, seen, count


@partial(jax.jit, static_argnames=_STATIC)
def _outcome(
    motion: Motion,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    **how: Any,
) -> Outcome:
    """What a motion comes to."""
    return _engine(motion, parameters, material, hindrance, how).outcome(motion)


def _engine(
    motion: Motion,
    parameters: Parameters,
    material: Array | None,
    hindrance: Hindrance | None,
    how: Mapping[str, Any],
) -> Engine:
    particles, dtype = motion.travelled.shape[1], motion.travelled.dtype
    return Engine(parameters, material, hindrance, particles, dtype, **how)
