"""What is to be expected of a run to rest before it begins: how long it takes, by which steps."""

import jax
import numpy as np

from mrjax import particle, soften, theory, timestep
from mrjax.box import Box
from mrjax.concrete import known
from mrjax.errors import InputError
from mrjax.hindrance import BED, Hindrance
from mrjax.parameters import Parameters
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
        radius = np.broadcast_to(particle.outer_radius(numbers), particles)
        pull = float(np.max(particle.net_weight(numbers) / particle.inertia(numbers)))
        terminal = float(np.min(theory.terminal_velocity(numbers)))
    if np.isnan(pull) or (np.isnan(terminal) and pull > 0):
        raise InputError("the parameters are traced by jit or vmap; settle cannot be")
    if not pull > 0:
        raise InputError("nothing pulls the particles down: gravity or net weight is not positive")
    solid = float(np.sum(4 / 3 * np.pi * radius**3))
    fall = max(top - solid / (PACKED * box.size[0] * box.size[1]), float(radius.max()))
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
    """
    with jax.ensure_compile_time_eval():
        resting = soften.resting_overlap(numbers, box, particles)
        layers = [(numbers, resting)]
        if hindrance is not None:
            radius = np.broadcast_to(particle.outer_radius(numbers), particles)
            fraction = 4 / 3 * np.pi * np.sum(radius**3) / box.volume
            weight = np.max(particle.net_weight(numbers))
            alone = float(timestep.expected_overlap(numbers, weight, 0.0))
            layers = [
                (numbers.replace(f_w=known(hindrance)(share)), overlap)
                for share, overlap in ((BED, resting), (THIN * fraction, alone))
            ]
        impact = float(timestep.expected_overlap(numbers, 0.0, falling))
        return min(_stable(layer, max(overlap, impact)) for layer, overlap in layers)


def _stable(numbers: Parameters, overlap: float) -> float:
    """Of a random bed with this deepest overlap, m, that a dry impact is resolved by, too; s."""
    stable = float(timestep.largest_stable_step(numbers, overlap, RANDOM_BED))
    relaxation = float(np.min(timestep.relaxation_time(numbers)))
    return stable if relaxation < stable else stable / INERTIAL
