"""The schedule of a run: frames, intervals of the neighbour list, and steps.

Concrete numbers only: they fix the shapes and lengths of the compiled loops.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.core.tracing import evaluated_or_none
from mrjax.dem import neighbours
from mrjax.dem.neighbours import ListPlan
from mrjax.laws import particle, time_scales
from mrjax.laws.time_scales import Mode

MOST_STEPS = 2**31 - 1
MOST_STEPS_BETWEEN_REBUILDS = 128
"""Reverse mode stores one state for each of them, and one for each interval."""


@dataclass(frozen=True)
class Schedule:
    """frames x intervals x steps, all of one length."""

    frames: int
    intervals: int  # in each frame, after which the list is rebuilt if need be
    steps: int  # in each interval

    @property
    def total(self) -> int:
        """Number of steps of the run."""
        return self.frames * self.intervals * self.steps

    def rebuilt_more_often(self) -> "Schedule":
        """The same steps, or a few more, with a quarter as many between rebuilds."""
        steps = max(1, self.steps // 4)
        return replace(self, intervals=math.ceil(self.intervals * self.steps / steps), steps=steps)


def plan_steps(duration: float, time_step: float, frames: int, rebuild_every: int) -> Schedule:
    """The fewest equal steps, none longer than `time_step`, that fill the frames.

    Raises:
      InputError: more steps than can be counted.
    """
    # A duration meant as a whole number of steps may miss it by rounding.
    in_frame = max(1.0, duration / frames / time_step * (1 - 1e-12))
    if in_frame * frames <= MOST_STEPS:
        in_frame = math.ceil(in_frame)
    if in_frame * frames > MOST_STEPS:
        raise InputError(
            f"duration = {duration:.4g} s takes {float(in_frame * frames):.3g} steps of "
            f"{time_step:.3g} s, more than {MOST_STEPS}; give a shorter duration or a longer "
            "time_step"
        )
    fewest = math.ceil(in_frame / rebuild_every)
    even = (n for n in range(fewest, 2 * fewest + 1) if in_frame % n == 0)
    rebuilds = next(even, fewest)
    return Schedule(frames, rebuilds, math.ceil(in_frame / rebuilds))


def contact_diameter(state: State, radius: np.ndarray | None, slack: float) -> float:
    """Largest distance of centres at which two particles touch, m.

    The one that came with the state where the radii are traced, or where it holds within `slack`
    (a fraction): so that neighbouring parameter values share one compiled program.

    Args:
      state: its own contact diameter, if any.
      radius: of the coated particles, m; None where it is traced.
      slack: fraction of the skin that the radii may have grown into.

    Raises:
      InputError: neither the state nor concrete parameters tell.
    """
    given = state.contact_diameter
    if radius is None:
        if given is None:
            raise InputError(
                "radius or f_r is traced, so the reach of the neighbour list is unknown; give "
                "place(..., contact_diameter=...) or a state from disperse"
            )
        return given
    actual = 2.0 * float(np.max(radius))
    if given is None:
        return actual
    serves = actual * (1 - slack) <= given and actual <= given * (1 + slack)
    return given if serves else actual


def plan_neighbour_list(
    state: State,
    radius: np.ndarray | None,
    box: Box,
    diameter: float,
    skin: float,
    capacity: int | None = None,
    reach: float = 0.0,
) -> ListPlan:
    """The neighbour list of a state, with contact radii as unit of length.

    Args:
      state: its contacts, if any, must have room.
      radius: of the coated particles, m; None where it is traced.
      box: the container, m.
      diameter: largest contact diameter, m.
      skin: beyond contact, as a fraction of the contact diameter.
      capacity: partners of each particle; left out, for a random close packing.
      reach: largest gap between surfaces at which a force acts, m.
    """
    typical = 1.0 if radius is None else min(1.0, particle.typical_diameter(radius) / diameter)
    plan = neighbours.plan_list(
        box.scaled(2 / diameter),
        state.particles,
        2.0,
        2.0 * typical,
        2.0 * skin,
        2.0 * reach / diameter,
    )
    room = plan.capacity if capacity is None else min(capacity, state.particles - 1)
    if state.contacts is not None:
        room = max(room, state.contacts.partner.shape[1] - 2 * len(box.walled_axes))
    if capacity is not None:  # so many partners for every particle, and every wall
        most = math.ceil(room * state.particles / 2) + len(box.walled_axes) * state.particles
        plan = replace(plan, pairs=max(plan.pairs, most))
    return replace(plan, capacity=room)


def greatest_speed(
    velocity: np.ndarray | None,
    numbers: Parameters,
    box: Box,
    duration: float,
    acceleration: float = 0.0,
) -> float | None:
    """Upper bound on the speed of particles that move freely, m/s; None where it is traced.

    The greatest initial speed plus what their net weight, and another acceleration in m/s^2, adds
    until drag, the duration or a wall ends it.
    """
    found = evaluated_or_none(_pull_and_relaxation, numbers)
    if velocity is None or found is None:
        return None
    pull, relaxation = found
    initial = np.sqrt((velocity**2).sum(axis=-1)).max()
    pull = np.abs(pull) + acceleration
    gained = np.max(pull * np.minimum(relaxation, duration))
    if not box.periodic[2]:
        gained = min(gained, np.sqrt(2.0 * np.max(pull) * box.height))
    return float(initial + gained)


def _pull_and_relaxation(numbers: Parameters) -> tuple[ArrayLike, ArrayLike]:
    """Acceleration by the net weight, m/s^2, and relaxation time, s, of every particle."""
    pull = particle.net_weight(numbers) / particle.inertia(numbers)
    return pull, time_scales.relaxation_time(numbers)


def steps_within_skin(speed: float | None, time_step: float, skin: float) -> int:
    """Steps in which a particle at this speed crosses a quarter of the skin, at least 1."""
    if speed is None or not speed * time_step > 0.25 * skin / MOST_STEPS_BETWEEN_REBUILDS:
        return MOST_STEPS_BETWEEN_REBUILDS
    return max(1, int(0.25 * skin / (speed * time_step)))


def largest_stable_step(
    numbers: Parameters,
    box: Box,
    diameter: float,
    speed: float | None,
    arrangement: tuple[Mode, ...] = time_scales.CLOSE_PACKED,
    *,
    stiffness: float = 0.0,
    pair_force: float = 0.0,
) -> float | None:
    """Largest step that survives the contacts to be expected, s; None where that is traced.

    They carry a column of particles as high as the box, or meet at twice the greatest speed. The
    column presses on the floor or, of particles lighter than the fluid, on the lid. Pair forces of
    this size, N, and stiffness, N/m, act beside contact.
    """
    weight = evaluated_or_none(particle.net_weight, numbers)
    if speed is None or weight is None:
        return None
    load = np.max(np.abs(weight) * max(1.0, box.height / diameter)) + pair_force
    overlap = evaluated_or_none(time_scales.expected_overlap, numbers, load, 2.0 * speed)

    def limit(overlap: float) -> float | None:
        step = evaluated_or_none(
            time_scales.largest_stable_step, numbers, overlap, arrangement, stiffness
        )
        return None if step is None else float(step)

    step = None if overlap is None else limit(float(overlap))
    if step is None or not np.isfinite(step):
        return step
    # The first step into a contact may go deeper than a damped impact ever would.
    return limit(max(float(overlap), 2.0 * speed * step))
