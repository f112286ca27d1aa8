"""Hindered settling (Kynch 1952): f_w of each particle from the local volume fraction.

A suspension settles in layers: clear fluid, suspension, bed. With one f_w for all particles, the
consolidating bed and the falling interface have the same drag. Here the drag on a particle follows
from the volume fraction at its height.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.tree_util import Partial
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters, per_particle
from mrjax.laws import particle
from mrjax.laws.closures.table import valid_range

Hindrance = Callable[[ArrayLike], ArrayLike]
"""f_w as a function of the volume fraction: any JAX function, such as
`lambda phi: (1 - phi) ** -4.65`. The coefficients of a `jax.tree_util.Partial`, such as one of a
closure of `mrjax.laws.drag`, can change without a new compilation."""

BED_FRACTION = 0.55
"""Volume fraction of a bed, whose contacts limit the step."""
LARGEST_FRACTION = 0.7
"""Largest volume fraction passed to a closure; a random packing has less."""


def as_tree(hindrance: Hindrance | None) -> Hindrance | None:
    """Returns the function as a pytree, which a compiled program takes as an argument.

    Raises:
      InputError: `hindrance` is no function.
    """
    if hindrance is None:
        return None
    if not callable(hindrance):
        raise InputError(
            f"hindrance = {shown(hindrance)}: give a function, f_w of volume fractions, such as "
            "recipe.hindrance"
        )
    leaves = jax.tree.leaves(hindrance)
    return Partial(hindrance) if any(leaf is hindrance for leaf in leaves) else hindrance


def refuse_partial(hindrance: Hindrance | None) -> None:
    """Refuses a closure that does not hold at every volume fraction from clear fluid to a bed.

    Raises:
      InputError: the closure holds in a part of this range only.
    """
    holds = valid_range(hindrance)
    fault = holds and (holds.fault(0.0) or holds.fault(LARGEST_FRACTION))
    if fault:
        name = getattr(getattr(hindrance, "func", hindrance), "__name__", "")
        raise InputError(
            f"hindrance = {name} {fault}; particles with local drag pass all volume fractions from "
            f"0 to {LARGEST_FRACTION}: give drag.local = false, or simulate a column"
        )


def hindered_parameters(
    parameters: Parameters, hindrance: Hindrance, box: Box, position: Array, spacing: float
) -> Parameters:
    """Returns the parameters with f_w from the local volume fraction of each particle, (N,).

    Args:
      parameters: parameters, in the same coherent units as the box.
      hindrance: function that gives f_w in place of `parameters.f_w`.
      box: container.
      position: centres, (3, N).
      spacing: spacing of the levels of `local_volume_fraction`.
    """
    fraction = local_volume_fraction(parameters, box, position, spacing)
    return parameters.replace(f_w=hindrance(jnp.minimum(fraction, LARGEST_FRACTION)))


def local_volume_fraction(
    parameters: Parameters, box: Box, position: Array, spacing: float
) -> Array:
    """Returns the volume fraction of coated particles at each particle's height, (N,); 1.

    A cubic B-spline distributes the volume of every particle over horizontal levels, and
    interpolates from the levels to the particles. The result is twice continuously differentiable,
    and an average over about two spacings to either side. The suspension is mirrored at the floor,
    so that the volume fraction of a bed does not fall off there; above its top is clear fluid. If
    the particles rise, the suspension is mirrored at the lid, and the clear fluid is below.

    Args:
      parameters: parameters, in the same coherent units as the box.
      box: container.
      position: centres, (3, N).
      spacing: spacing of the levels, about one particle diameter; it fixes their number.
    """
    levels = max(4, round(box.height / spacing))
    spacing = box.height / levels
    height = position[2] / spacing
    periodic = box.periodic[2]
    # Two levels beyond either end, unless the axis is periodic.
    beyond = 0 if periodic else 2
    nodes = levels + 1 + 2 * beyond

    def levels_and_weights(height: Array) -> tuple[Array, Array]:
        below = jnp.floor(lax.stop_gradient(height))
        level = below.astype(jnp.int32)[None, :] + jnp.arange(-1, 3, dtype=jnp.int32)[:, None]
        weight = jnp.stack(_cubic_b_spline(height - below))
        if periodic:
            return level % levels, weight
        # A negative index would count from the top.
        return jnp.where(level < -beyond, nodes, level + beyond), weight

    volume = per_particle(4 / 3 * jnp.pi * particle.outer_radius(parameters) ** 3, height.shape[0])
    contribution = volume / (box.size[0] * box.size[1] * spacing)
    fraction = jnp.zeros(nodes, height.dtype)
    mirrored = jnp.where(particle.rises(parameters), 2.0 * levels - height, -height)
    for image in (height,) if periodic else (height, mirrored):
        level, weight = levels_and_weights(image)
        fraction = fraction.at[level].add(weight * contribution[None, :], mode="drop")
    level, weight = levels_and_weights(height)
    return jnp.sum(weight * fraction[level], axis=0)


def _cubic_b_spline(offset: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the levels -1, 0, 1 and 2 above the level just below a point."""
    rest = 1.0 - offset
    return (
        rest**3 / 6.0,
        2.0 / 3.0 - 0.5 * offset**2 * (1.0 + rest),
        2.0 / 3.0 - 0.5 * rest**2 * (1.0 + offset),
        offset**3 / 6.0,
    )


# Their names of before.
BED, DENSEST = BED_FRACTION, LARGEST_FRACTION
hindered = hindered_parameters
