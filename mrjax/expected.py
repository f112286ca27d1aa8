"""What is to be expected of a run to rest before it begins: how long it takes, by which steps."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax import particle, soften, theory, timestep
from mrjax.box import Box
from mrjax.by_numpy import by_numpy
from mrjax.concrete import known
from mrjax.errors import InputError
from mrjax.hindrance import BED, Hindrance
from mrjax.parameters import Parameters, per_particle
from mrjax.timestep import Mode

RANDOM_BED = (Mode(2.8, 2.8, 2.8),)
"""About what the contacts of a random bed of spheres add up to; a run that shows this to be too few
is repeated with shorter steps."""

PACKED = 0.64
"""Volume fraction of a random close packing: what is left to fall through, at most."""
THIN = 0.5
"""Volume fraction of the thinnest layers in which particles touch, over that of all."""
INERTIAL = 8.0
"""How much shorter a step must be where drag does not damp contacts: an impact takes about 20."""


def duration(numbers: Parameters, box: Box, particles: int, top: float) -> tuple[float, float]:
    """About how long the particles fall, s, and how fast, m/s.

    Args:
      numbers: parameters, not a number where they are traced.
      box: the container.
      particles: N.
      top: of the highest particle, m.

    Raises:
      InputError: nothing pulls them down, or parameters that are traced.
    """
    with jax.ensure_compile_time_eval():
        pull, terminal, solid, largest = map(
            float, by_numpy(partial(_falling, particles=particles), numbers)
        )
    if np.isnan(pull) or (np.isnan(terminal) and pull > 0):
        raise InputError("the parameters are traced by jit or vmap; settle cannot be")
    if not pull > 0:
        raise InputError("nothing pulls the particles down: gravity or net weight is not positive")
    fall = max(top - solid / (PACKED * box.size[0] * box.size[1]), largest)
    free = float(np.sqrt(2.0 * pull * fall))
    falling = min(free, terminal)
    return max(fall / terminal, 2.0 * fall / free), falling


def step(
    numbers: Parameters,
    box: Box,
    particles: int,
    falling: float,
    hindrance: Hindrance | None,
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

    Raises:
      InputError: no step would do.
    """
    with jax.ensure_compile_time_eval():
        law = partial(_overlaps, box=box, particles=particles, falling=falling)
        resting, alone, impact, fraction = map(float, by_numpy(law, numbers))
        layers = [(numbers, resting)]
        if hindrance is not None:
            layers = [
                (numbers.replace(f_w=by_numpy(known(hindrance), share)), overlap)
                for share, overlap in ((BED, resting), (THIN * fraction, alone))
            ]
        longest = min(_stable(layer, max(overlap, impact)) for layer, overlap in layers)
    if not longest > 0.0:
        raise InputError(
            "the dashpots of contacts are so strong that no step is stable: give less dissipation"
        )
    return longest


def _stable(numbers: Parameters, overlap: float) -> float:
    """Of a random bed with this deepest overlap, m, that a dry impact is resolved by, too; s."""
    stable, relaxation = map(float, by_numpy(_limits, numbers, overlap))
    return stable if relaxation < stable else stable / INERTIAL


def _falling(numbers: Parameters, particles: int) -> tuple[Array, ...]:
    """Greatest pull, m/s^2, least terminal velocity, m/s, volume, m^3, and largest radius, m."""
    radius = per_particle(particle.outer_radius(numbers), particles)
    return (
        jnp.max(particle.net_weight(numbers) / particle.inertia(numbers)),
        jnp.min(theory.terminal_velocity(numbers)),
        jnp.sum(4 / 3 * jnp.pi * radius**3),
        jnp.max(radius),
    )


def _overlaps(numbers: Parameters, box: Box, particles: int, falling: float) -> tuple[Array, ...]:
    """Of the bed, of a single particle on another and of an impact, m; the volume fraction."""
    radius = per_particle(particle.outer_radius(numbers), particles)
    return (
        soften.resting_overlap(numbers, box, particles),
        timestep.expected_overlap(numbers, jnp.max(particle.net_weight(numbers)), 0.0),
        timestep.expected_overlap(numbers, 0.0, falling),
        4 / 3 * jnp.pi * jnp.sum(radius**3) / box.volume,
    )


def _limits(numbers: Parameters, overlap: float) -> tuple[Array, Array]:
    """The largest stable step and the least relaxation time, s."""
    return (
        timestep.largest_stable_step(numbers, overlap, RANDOM_BED),
        jnp.min(timestep.relaxation_time(numbers)),
    )
