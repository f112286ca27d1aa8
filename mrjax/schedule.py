"""How a run is cut into frames, intervals of the neighbour list, and steps.

Concrete numbers only: they fix the shapes and lengths of the compiled loops.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from mrjax import neighbours, particle, timestep
from mrjax.box import Box
from mrjax.errors import InputError
from mrjax.neighbours import Plan
from mrjax.parameters import Parameters
from mrjax.state import State
from mrjax.timestep import Mode

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


def cut(duration: float, time_step: float, frames: int, rebuild_every: int) -> Schedule:
    """The fewest equal steps, none longer than `time_step`, that fill the frames.

    Raises:
      InputError: more steps than can be counted.
    """
    # A duration meant as a whole number of steps may miss it by rounding.
    in_frame = max(1, math.ceil(duration / frames / time_step * (1 - 1e-12)))
    if in_frame * frames > MOST_STEPS:
        raise InputError(
            f"duration = {duration:.4g} s takes {in_frame * frames:.3g} steps of {time_step:.3g} "
            f"s, more than {MOST_STEPS}; give a shorter duration or a longer time_step"
        )
    fewest = math.ceil(in_frame / rebuild_every)
    even = (n for n in range(fewest, 2 * fewest + 1) if in_frame % n == 0)
    rebuilds = next(even, fewest)
    return Schedule(frames, rebuilds, math.ceil(in_frame / rebuilds))


def contact_diameter(state: State, radius: np.ndarray, slack: float) -> float:
    """Largest distance of centres at which two particles touch, m.

    The one that came with the state where the radii are traced, or where it holds within `slack`
    (a fraction): so that neighbouring parameter values share one compiled program.

    Args:
      state: its own contact diameter, if any.
      radius: of the coated particles, m; NaN where traced.
      slack: fraction of the skin that the radii may have grown into.

    Raises:
      InputError: neither the state nor concrete parameters tell.
    """
    given, actual = state.contact_diameter, 2.0 * float(np.max(radius))
    if np.isnan(actual):
        if given is None:
            raise InputError(
                "radius or f_r is traced, so the reach of the neighbour list is unknown; give "
                "place(..., contact_diameter=...) or a state from disperse"
            )
        return given
    if given is None:
        return actual
    serves = actual * (1 - slack) <= given and actual <= given * (1 + slack)
    return given if serves else actual


def list_plan(
    state: State,
    radius: np.ndarray,
    box: Box,
    diameter: float,
    skin: float,
    capacity: int | None = None,
) -> Plan:
    """The neighbour list of a state, with contact radii as unit of length.

    Args:
      state: its contacts, if any, must have room.
      radius: of the coated particles, m; NaN where traced.
      box: the container, m.
      diameter: largest contact diameter, m.
      skin: beyond contact, as a fraction of the contact diameter.
      capacity: partners of each particle; left out, for a random close packing.
    """
    typical = particle.typical_diameter(radius)
    plan = neighbours.plan(
        box.scaled(2 / diameter),
        state.particles,
        2.0,
        2.0 * (1.0 if np.isnan(typical) else min(1.0, typical / diameter)),
        2.0 * skin,
    )
    room = plan.capacity if capacity is None else min(capacity, state.particles - 1)
    if state.contacts is not None:
        room = max(room, state.contacts.partner.shape[1] - 2 * len(box.walled_axes))
    if capacity is not None:  # so many partners for every particle, and every wall
        most = math.ceil(room * state.particles / 2) + len(box.walled_axes) * state.particles
        plan = replace(plan, pairs=max(plan.pairs, most))
    return replace(plan, capacity=room)


def fastest(velocity: np.ndarray | None, numbers: Parameters, box: Box, duration: float) -> float:
    """Upper bound on the speed of particles that fall freely, m/s; NaN where it is traced.

    The greatest initial speed plus what gravity adds until drag, the duration or the floor ends it.
    """
    if velocity is None:
        return np.nan
    pull = np.asarray(particle.net_weight(numbers) / particle.inertia(numbers))
    relaxation = np.asarray(timestep.relaxation_time(numbers))
    initial = np.sqrt((velocity**2).sum(axis=-1)).max()
    gained = np.max(np.abs(pull) * np.minimum(relaxation, duration))
    if not box.periodic[2]:
        gained = min(gained, np.sqrt(2.0 * np.max(np.abs(pull)) * box.height))
    return float(initial + gained)


def steps_within_skin(speed: float, time_step: float, skin: float) -> int:
    """Steps in which a particle at this speed crosses a quarter of the skin, at least 1."""
    travel = speed * time_step
    if not travel > 0.25 * skin / MOST_STEPS_BETWEEN_REBUILDS:  # also where it is not known
        return MOST_STEPS_BETWEEN_REBUILDS
    return max(1, int(0.25 * skin / travel))


def largest_stable_step(
    numbers: Parameters,
    box: Box,
    diameter: float,
    speed: float,
    arrangement: tuple[Mode, ...] = timestep.CLOSE_PACKED,
) -> float:
    """Largest step that survives the contacts to be expected, s; NaN where that is traced.

    They carry a column of particles as high as the box, or meet at twice the greatest speed.
    """
    if np.isnan(speed):
        return np.nan
    load = np.asarray(particle.net_weight(numbers)) * max(1.0, box.height / diameter)
    overlap = float(timestep.expected_overlap(numbers, np.max(load), 2.0 * speed))
    step = float(timestep.largest_stable_step(numbers, overlap, arrangement))
    if not np.isfinite(step):
        return step
    # The first step into a contact may go deeper than a damped impact ever would.
    deeper = max(overlap, 2.0 * speed * step)
    return float(timestep.largest_stable_step(numbers, deeper, arrangement))
