"""Schedule of a run: its frames, the intervals between rebuilds of the neighbour list, its steps.

All numbers are concrete, because they fix the shapes and lengths of the compiled loops.
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
from mrjax.dem.kick_bounds import RandomMotion
from mrjax.dem.neighbours import ListPlan
from mrjax.laws import particle, time_scales
from mrjax.laws.time_scales import Mode

MOST_STEPS = 2**31 - 1
MOST_STEPS_BETWEEN_REBUILDS = 128
"""Maximum number of steps in an interval.

Reverse mode stores one state for each step of an interval, and one for each interval.
"""


@dataclass(frozen=True)
class Schedule:
    """Equal time steps, grouped in intervals and frames: frames x intervals x steps."""

    frames: int
    intervals: int  # in each frame; the neighbour list is rebuilt between them if necessary
    steps: int  # in each interval

    @property
    def total(self) -> int:
        """Number of steps of the run."""
        return self.frames * self.intervals * self.steps

    def rebuilt_more_often(self) -> "Schedule":
        """Returns a schedule with a quarter of the steps in each interval.

        The number of steps of the run is the same or slightly larger.
        """
        steps = max(1, self.steps // 4)
        return replace(self, intervals=math.ceil(self.intervals * self.steps / steps), steps=steps)


def plan_steps(duration: float, time_step: float, frames: int, rebuild_every: int) -> Schedule:
    """Divides a run into the fewest equal steps that are not longer than `time_step`.

    Args:
      duration: length of the run, s.
      time_step: largest length of a step, s.
      frames: number of frames.
      rebuild_every: largest number of steps in an interval.

    Raises:
      InputError: the run has more than `MOST_STEPS` steps.
    """
    # A duration meant as a whole number of steps may differ from it by rounding.
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

    The value of the state is used if the radii are traced, or if it is correct within the fraction
    `slack`. So parameters that differ slightly share one compiled program.

    Args:
      state: state of the particles, which may have a contact diameter.
      radius: radii of the coated particles, m; None if traced.
      slack: largest relative deviation of the value of the state from the present radii.

    Raises:
      InputError: the radii are traced and the state has no contact diameter.
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
    """Sizes the neighbour list of a state, with the largest contact radius as unit of length.

    Args:
      state: state of the particles; the list has slots for its contact history.
      radius: radii of the coated particles, m; None if traced.
      box: the container, m.
      diameter: largest contact diameter, m.
      skin: skin beyond contact, as a fraction of the contact diameter.
      capacity: slots for partners of each particle; if left out, those of a random close packing.
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
    if capacity is not None:  # every particle may have that many partners, and touch every wall
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
    """Upper bound on the speed of freely moving particles, m/s; None for traced values.

    The bound is the largest initial speed plus the speed gained by the net weight and by a further
    acceleration, until drag, the duration or a wall limits it.

    Args:
      velocity: initial velocities, m/s; None if traced.
      numbers: parameters.
      box: the container, m.
      duration: length of the run, s.
      acceleration: further acceleration, m/s^2.
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
    """Acceleration by the net weight, m/s^2, and velocity relaxation time, s, of every particle."""
    pull = particle.net_weight(numbers) / particle.inertia(numbers)
    return pull, time_scales.relaxation_time(numbers)


def steps_within_skin(
    speed: float | None, time_step: float, skin: float, random: RandomMotion | None = None
) -> int:
    """Number of steps in which a particle at this speed crosses a quarter of the skin.

    With random forces, twice this way and their kicks, which grow as the root of the number, fill
    half of the skin.

    The number is at least 1 and at most `MOST_STEPS_BETWEEN_REBUILDS`, its value at unknown speed.

    Args:
      speed: speed of the particle, m/s; None if unknown.
      time_step: length of a step, s.
      skin: skin of the neighbour list, m.
      random: motion by random forces; None without such forces.
    """
    kick = random.kick(time_step) if random is not None else None
    if speed is not None and kick:
        root = skin / (kick + math.sqrt(kick**2 + 4.0 * speed * time_step * skin))
        return max(1, int(min(root**2, MOST_STEPS_BETWEEN_REBUILDS)))
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
    random: RandomMotion | None = None,
) -> float | None:
    """Largest step that is stable for the expected contacts, s; None for traced values.

    An expected contact carries a column of particles as high as the box, or is an impact at twice
    the largest speed. The column presses on the floor or, if particles are lighter than the fluid,
    on the lid.

    Args:
      numbers: parameters.
      box: the container, m.
      diameter: largest contact diameter, m.
      speed: largest speed of a particle, m/s; None if it depends on traced values.
      arrangement: modes of vibration of the touching particles.
      stiffness: stiffness of other pair forces, N/m.
      pair_force: size of other pair forces, N.
      random: motion by random forces; None without such forces.
    """
    weight = evaluated_or_none(particle.net_weight, numbers)
    agitation = 0.0 if random is None else random.speed
    if speed is None or weight is None or agitation is None:
        return None
    load = np.max(np.abs(weight) * max(1.0, box.height / diameter)) + pair_force
    overlap = evaluated_or_none(
        time_scales.expected_overlap, numbers, load, 2.0 * (speed + agitation)
    )

    def limit(overlap: float) -> float | None:
        step = evaluated_or_none(
            time_scales.largest_stable_step, numbers, overlap, arrangement, stiffness
        )
        return None if step is None else float(step)

    step = None if overlap is None else limit(float(overlap))
    if step is None or not np.isfinite(step):
        return step
    # The first step into a contact may go deeper than any later overlap of a damped impact.
    step = limit(max(float(overlap), 2.0 * speed * step))
    if random is None or step is None:
        return step
    return random.longest_step(step, lambda kick: limit(max(float(overlap), kick)))
