"""Estimates of a run to rest before it begins: its duration and its steps."""

from functools import partial
from typing import NamedTuple

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

RANDOM_BED = (Mode(2.8, 2.8, 2.8),)
"""About what the contacts of a random bed of spheres add up to; a run that shows this to be too few
is repeated with shorter steps."""

TIMES_FREE_FALL = 2.5
"""How much longer beds take to rest than a free fall would, about: case2 and case3 do."""
PACKED = 0.64
"""Volume fraction of a random close packing: what is left to fall through, at most."""
DILUTE_SHARE = 0.5
"""Volume fraction of the thinnest layers in which particles touch, over that of all."""
INERTIAL = 8.0
"""How much shorter a step must be where drag does not damp contacts: an impact takes about 20."""


TRACED = "the parameters are traced by jit or vmap; settle cannot be"


class Way(NamedTuple):
    """Greatest distances of the interfaces of a suspension from where they may rest; m."""

    down: float  # the top of the highest particle that sinks, above the floor
    up: float  # the bottom of the lowest particle that rises, below the lid


def ways(numbers: Parameters, box: Box, centres: ArrayLike) -> Way:
    """Distances for particles at these centres, (N, 3) in m; 0 where none sinks or none rises.

    Raises:
      InputError: centres or parameters that are traced.
    """
    position = value_or_none(centres)
    found = evaluated_or_none(
        lambda: (particle.outer_radius(numbers), particle.net_weight(numbers))
    )
    if found is None or position is None:
        raise InputError(TRACED)
    radius, weight = (np.broadcast_to(of, len(position)) for of in found)
    above_floor, below_lid = position[:, 2] + radius, box.height - position[:, 2] + radius
    return Way(
        float(np.max(above_floor, where=weight > 0.0, initial=0.0)),
        float(np.max(below_lid, where=weight < 0.0, initial=0.0)),
    )


def duration(numbers: Parameters, box: Box, particles: int, way: Way) -> tuple[float, float]:
    """About how long the particles fall, or rise, s, and how fast, m/s.

    Those without a net weight stay where they are.

    Args:
      numbers: of the particles and the fluid.
      box: the container.
      particles: N.
      way: of both interfaces.

    Raises:
      InputError: nothing pulls them, no floor and lid ends their way, or parameters are traced.
    """
    found = evaluated_or_none(evaluate_with_numpy, partial(_falling, particles=particles), numbers)
    if found is None:
        raise InputError(TRACED)
    pull, terminal, sinking, rising, largest = map(float, found)
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
    fall = max(largest, *(far - solid / packed for far, solid in both if solid > 0.0))
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
) -> float:
    """A step that a random bed of these particles is stable at, and that resolves a dry impact; s.

    Where drag is local, a step that the thinnest suspension is stable at, too: its drag is the
    least, while a contact there bears no more than the weight of one particle.

    Args:
      numbers: parameters with the moduli of the run.
      box: the container.
      particles: N.
      falling: speed, m/s.
      hindrance: f_w where drag is local.
      bounds: of forces beside weight and contact.

    Raises:
      InputError: no step would do.
    """
    pulled = bounds.pair_force
    law = partial(_overlaps, box=box, particles=particles, falling=falling, pulled=pulled)
    found = evaluated_or_none(evaluate_with_numpy, law, numbers)
    if found is None:
        raise InputError(TRACED)
    resting, alone, impact, fraction = map(float, found)
    layers = [(numbers, resting)]
    if hindrance is not None:
        layers = [
            (numbers.replace(f_w=_felt(hindrance, share)), overlap)
            for share, overlap in ((BED_FRACTION, resting), (DILUTE_SHARE * fraction, alone))
        ]
    longest = min(
        _stable(layer, max(overlap, impact), bounds.stiffness) for layer, overlap in layers
    )
    if not longest > 0.0:
        raise InputError(
            "the dashpots of contacts are so strong that no step is stable: give less dissipation"
        )
    return longest


def _felt(hindrance: Hindrance, share: float) -> np.ndarray:
    """f_w at a volume fraction.

    Raises:
      InputError: it is traced.
    """
    found = evaluated_or_none(evaluate_with_numpy, drop_tracers(hindrance), share)
    if found is None:
        raise InputError(TRACED)
    return found


def _stable(numbers: Parameters, overlap: float, stiffness: float) -> float:
    """Stable step of a random bed of this deepest overlap, m, that resolves a dry impact, too; s.

    Raises:
      InputError: parameters that are traced.
    """
    found = evaluated_or_none(evaluate_with_numpy, _limits, numbers, overlap, stiffness)
    if found is None:
        raise InputError(TRACED)
    stable, relaxation = map(float, found)
    return stable if relaxation < stable else stable / INERTIAL


def _falling(numbers: Parameters, particles: int) -> tuple[Array, ...]:
    """Greatest pull, m/s^2, and least terminal speed of what is pulled, m/s.

    Then the volume of what sinks and of what rises, m^3, and the largest radius, m.
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
    numbers: Parameters, box: Box, particles: int, falling: float, pulled: float
) -> tuple[Array, ...]:
    """Overlaps of the bed, of one particle on another and of an impact, m; volume fraction."""
    radius = per_particle(particle.outer_radius(numbers), particles)
    weight = jnp.max(jnp.abs(particle.net_weight(numbers)))
    together = time_scales.expected_overlap(numbers, pulled, 0.0) if pulled else 0.0
    return (
        jnp.maximum(softening.resting_overlap(numbers, box, particles), together),
        time_scales.expected_overlap(numbers, weight + pulled, 0.0),
        time_scales.expected_overlap(numbers, 0.0, falling),
        4 / 3 * jnp.pi * jnp.sum(radius**3) / box.volume,
    )


def _limits(numbers: Parameters, overlap: float, stiffness: float) -> tuple[Array, Array]:
    """The largest stable step and the least relaxation time, s."""
    return (
        time_scales.largest_stable_step(numbers, overlap, RANDOM_BED, stiffness),
        jnp.min(time_scales.relaxation_time(numbers)),
    )
