"""How a run is cut into frames, rebuilds of the neighbour list, and steps.

Concrete numbers only: they fix the shapes and lengths of the compiled loops.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from mrjax import particle, timestep
from mrjax.box import Box
from mrjax.concrete import concrete
from mrjax.errors import InputError
from mrjax.parameters import Parameters
from mrjax.state import State

MOST_STEPS = 2**31 - 1
MOST_STEPS_BETWEEN_REBUILDS = 64
"""Reverse mode stores one state for each of them, and one for each rebuild."""


@dataclass(frozen=True)
class Schedule:
    """frames x rebuilds x steps, all of one length."""

    frames: int
    rebuilds: int  # in each frame
    steps: int  # between rebuilds

    @property
    def total(self) -> int:
        """Number of steps of the run."""
        return self.frames * self.rebuilds * self.steps

    def rebuilt_more_often(self) -> "Schedule":
        """The same steps, or a few more, with a quarter as many between rebuilds."""
        steps = max(1, self.steps // 4)
        return replace(self, rebuilds=math.ceil(self.rebuilds * self.steps / steps), steps=steps)


def cut(duration: float, time_step: float, frames: int, rebuild_every: int) -> Schedule:
    """The fewest equal steps, none longer than `time_step`, that fill the frames.

    Raises:
      InputError: more steps than can be counted.
    """
    # A duration meant as a whole number of steps may miss it by rounding.
    in_frame = max(1, math.ceil(duration / frames / time_step * (1 - 1e-12)))
    if in_frame * frames > MOST_STEPS:
        raise InputError(
            f"duration = {duration:.4g} s takes {in_frame * frames:.3g} steps of {time_step:.3g} s, "
            f"more than {MOST_STEPS}; give a shorter duration or a longer time_step"
        )
    fewest = math.ceil(in_frame / rebuild_every)
    even = (n for n in range(fewest, 2 * fewest + 1) if in_frame % n == 0)
    rebuilds = next(even, fewest)
    return Schedule(frames, rebuilds, math.ceil(in_frame / rebuilds))


def contact_diameter(state: State, parameters: Parameters, slack: float) -> float:
    """Largest distance of centres at which two particles touch, m.

    The one that came with the state where the radii are traced, or where it holds within `slack`
    (a fraction): so that neighbouring parameter values share one compiled program.

    Raises:
      InputError: neither the state nor concrete parameters tell.
    """
    known = state.contact_diameter
    radius = concrete(particle.outer_radius(parameters))
    if radius is None:
        if known is None:
            raise InputError(
                "radius or f_r is traced, so the reach of the neighbour list is unknown; give "
                "place(..., contact_diameter=...) or a state from disperse"
            )
        return known
    actual = 2.0 * float(radius.max())
    return (
        known
        if known is not None and known <= actual * 1.5 and actual <= known * (1 + slack)
        else actual
    )


def smallest_diameter(parameters: Parameters, largest: float) -> float:
    """Diameter of the smallest coated particle, m; the largest where it is traced."""
    radius = concrete(particle.outer_radius(parameters))
    return largest if radius is None else 2.0 * float(radius.min())


def fastest(state: State, parameters: Parameters, duration: float) -> float | None:
    """Upper bound on the speed of particles that fall freely, m/s; None where it is traced.

    The greatest initial speed plus what gravity adds until drag or the duration ends it.
    """
    velocity = concrete(state.velocity)
    pull = concrete(particle.net_weight(parameters) / particle.inertia(parameters))
    relaxation = concrete(timestep.relaxation_time(parameters))
    if velocity is None or pull is None or relaxation is None:
        return None
    initial = np.sqrt((velocity**2).sum(axis=-1)).max()
    gained = np.max(np.abs(pull) * np.minimum(relaxation, duration))
    return float(initial + gained)


def resting_load(parameters: Parameters, box: Box, diameter: float):
    """Weight of a column of particles as high as the box, on the contact below it; N."""
    return particle.net_weight(parameters) * max(1.0, box.height / diameter)
