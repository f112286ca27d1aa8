"""Estimates of a run to rest before it begins: its duration and its steps."""

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.laws import closed_forms, particle, time_scales
from mrjax.laws.hindrance import BED_FRACTION, Hindrance
from mrjax.laws.time_scales import NO_OTHER_FORCES, ForceBounds, Mode
from mrjax.simulation import softening

if TYPE_CHECKING:
    from mrjax.dem.forces import Noise

RANDOM_BED = (Mode(2.8, 2.8, 2.8),)
"""Approximate fastest mode of a random bed of spheres. A run whose bed has a faster mode is
repeated with shorter steps."""

TIMES_FREE_FALL = 2.5
"""Time until a bed rests over the time of a free fall, about; from case2 and case3."""
PACKED = 0.64
"""Volume fraction of a random close packing, the densest bed; the fall onto it is the longest."""
DILUTE_SHARE = 0.5
"""Volume fraction of the thinnest layers in which particles touch, over that of the whole box."""
INERTIAL = 8.0
"""Factor by which a step is shorter where drag does not damp contacts: an impact takes about 20
steps."""


TRACED = "the parameters are traced by jit or vmap; settle cannot be"


class Way(NamedTuple):
    """Greatest distances of the interfaces of a suspension from where they may rest; m."""

    down: float  # the top of the highest particle that sinks, above the floor
    up: float  # the bottom of the lowest particle that rises, below the lid


def ways(numbers: Parameters, box: Box, centres: ArrayLike) -> Way:
    """Distances of both interfaces for particles at `centres`, (N, 3) in m.

    The first is 0 if no particle sinks, the second if none rises.

    Raises:
      InputError: centres or parameters are traced.
    """
    position = value_or_none(centres)
    values = evaluated_or_none(
        lambda: (particle.outer_radius(numbers), particle.net_weight(numbers))
    )
    if values is None or position is None:
        raise InputError(TRACED)
    radius, weight = (np.broadcast_to(value, len(position)) for value in values)
    above_floor, below_lid = position[:, 2] + radius, box.height - position[:, 2] + radius
    return Way(
        float(np.max(above_floor, where=weight > 0.0, initial=0.0)),
        float(np.max(below_lid, where=weight < 0.0, initial=0.0)),
    )


def duration(numbers: Parameters, box: Box, particles: int, way: Way) -> tuple[float, float]:
    """Approximate time for which the particles fall or rise, s, and their speed, m/s.

    Particles without a net weight stay where they are.

    Args:
      numbers: parameters of the particles and the fluid.
      box: the container.
      particles: N.
      way: greatest distances of both interfaces.

    Raises:
      InputError: gravity or every net weight is zero, the box has no floor and lid, or parameters
        are traced.
    """
    values = evaluated_or_none(evaluate_with_numpy, partial(_falling, particles=particles), numbers)
    if values is None:
        raise InputError(TRACED)
    pull, terminal, sinking, rising, largest = map(float, values)
    if not pull > 0:
        raise InputError(
            "nothing pulls the particles down or up: gravity or the net weight of each is zero"
        )
    if box.periodic[2]:
        raise InputError(
            "the box is periodic along z, where nothing comes to rest; give Box(..., "
            "periodic=(..., ..., False))"
        )
    packed = PACKED * box.size[0] * box.size[1]
    both = zip(way, (sinking, rising), strict=True)
    fall = max(largest, *(distance - solid / packed for distance, solid in both if solid > 0.0))
    free = float(np.sqrt(2.0 * pull * fall))
    falling = min(free, terminal)
    return max(fall / terminal, 2.0 * fall / free), falling


def step(
    numbers: Parameters,
    box: Box,
    particles: int,
    falling: float,
    hindrance: Hindrance | None,
    bounds: ForceBounds = NO_OTHER_FORCES,
    noises: "tuple[Noise, ...]" = (),
) -> float:
    """Step at which a random bed of these particles is stable, and which resolves a dry impact; s.

    With local drag, the step is stable in the thinnest suspension, too. Drag is least there, and a
    contact bears no more than the weight of one particle.

    Args:
      numbers: parameters with the moduli of the run.
      box: the container.
      particles: N.
      falling: speed of the fall, m/s.
      hindrance: f_w against volume fraction; None without local drag.
      bounds: bounds of the forces beside weight and contact.
      noises: random forces, without tracers.

    Raises:
      InputError: no step is stable, or parameters are traced.
    """
    pull = bounds.pair_force
    law = partial(_overlaps, box=box, particles=particles, falling=falling, pull=pull)
    values = evaluated_or_none(evaluate_with_numpy, law, numbers)
    if values is None:
        raise InputError(TRACED)
    resting, alone, impact, fraction = map(float, values)
    layers = [(numbers, resting)]
    if hindrance is not None:
        layers = [
            (numbers.replace(f_w=_factor(hindrance, share)), overlap)
            for share, overlap in ((BED_FRACTION, resting), (DILUTE_SHARE * fraction, alone))
        ]
    longest = min(
        _stable(layer, max(overlap, impact), bounds.stiffness, noises) for layer, overlap in layers
    )
    if not longest > 0.0:
        raise InputError(
            "the dashpots of contacts are so strong that no step is stable: give less dissipation"
        )
    return longest


def _factor(hindrance: Hindrance, share: float) -> np.ndarray:
    """f_w at a volume fraction.

    Raises:
      InputError: f_w is traced.
    """
    factor = evaluated_or_none(evaluate_with_numpy, drop_tracers(hindrance), share)
    if factor is None:
        raise InputError(TRACED)
    return factor


def _stable(
    numbers: Parameters, overlap: float, stiffness: float, noises: "tuple[Noise, ...]"
) -> float:
    """Step at which a random bed is stable, and which resolves a dry impact and kicks; s.

    Args:
      numbers: parameters with the moduli of the run.
      overlap: deepest overlap in the bed, m.
      stiffness: stiffness of the forces beside weight and contact, N/m.
      noises: random forces.

    Raises:
      InputError: parameters are traced.
    """

    def limit(overlap: float) -> float:
        values = evaluated_or_none(evaluate_with_numpy, _limits, numbers, overlap, stiffness)
        if values is None:
            raise InputError(TRACED)
        stable, relaxation = map(float, values)
        return stable if relaxation < stable else stable / INERTIAL

    if not noises:
        return limit(overlap)
    from mrjax.dem.kick_bounds import RandomMotion  # loads what a check does not need

    random = RandomMotion(noises, numbers)
    speed = random.speed
    impact = None
    if speed is not None:
        impact = evaluated_or_none(time_scales.expected_overlap, numbers, 0.0, 2.0 * speed)
    if impact is None:
        raise InputError(TRACED)
    deepest = max(overlap, float(impact))
    step = random.longest_step(limit(deepest), lambda kick: limit(max(deepest, kick)))
    if step is None:
        raise InputError(TRACED)
    return step


def _falling(numbers: Parameters, particles: int) -> tuple[Array, ...]:
    """Greatest acceleration by the net weight, m/s^2, and least terminal speed, m/s.

    Also the volume of the particles that sink and of those that rise, m^3, and the largest radius,
    m. Particles without a net weight do not count for the terminal speed.
    """
    radius = per_particle(particle.outer_radius(numbers), particles)
    volume = 4 / 3 * jnp.pi * radius**3
    weight = per_particle(particle.net_weight(numbers), particles)
    speed = per_particle(jnp.abs(closed_forms.terminal_velocity(numbers)), particles)
    return (
        jnp.max(jnp.abs(particle.net_weight(numbers) / particle.inertia(numbers))),
        jnp.min(jnp.where(weight != 0.0, speed, jnp.inf)),
        jnp.sum(jnp.where(weight > 0.0, volume, 0.0)),
        jnp.sum(jnp.where(weight < 0.0, volume, 0.0)),
        jnp.max(radius),
    )


def _overlaps(
    numbers: Parameters, box: Box, particles: int, falling: float, pull: float
) -> tuple[Array, ...]:
    """Overlaps in the bed, of one particle on another and in an impact, m; volume fraction.

    The greatest force `pull` of the other laws, N, is taken to press surfaces onto each other.
    """
    radius = per_particle(particle.outer_radius(numbers), particles)
    weight = jnp.max(jnp.abs(particle.net_weight(numbers)))
    return (
        softening.resting_overlap(numbers, box, particles, pull),
        time_scales.expected_overlap(numbers, weight + pull, 0.0),
        time_scales.expected_overlap(numbers, 0.0, falling),
        4 / 3 * jnp.pi * jnp.sum(radius**3) / box.volume,
    )


def _limits(numbers: Parameters, overlap: float, stiffness: float) -> tuple[Array, Array]:
    """The largest stable step and the least relaxation time, s."""
    return (
        time_scales.largest_stable_step(numbers, overlap, RANDOM_BED, stiffness),
        jnp.min(time_scales.relaxation_time(numbers)),
    )
