"""Hindered settling by the local volume fraction (Kynch 1952): f_w of each particle's own height.

A suspension settles in layers: clear fluid above, the suspension, the bed. With one f_w for all,
the bed consolidates and the interface falls with the same drag; here each particle feels that of
its layer.
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

Hindrance = Callable[[ArrayLike], ArrayLike]
"""f_w for volume fractions: any function of JAX, such as `lambda phi: (1 - phi) ** -4.65`. Given as
`jax.tree_util.Partial` of a closure of `mrjax.laws.drag` and its coefficients, these can change
without a new program."""

BED_FRACTION = 0.55
"""Volume fraction of a bed, where the contacts are that decide how long a step may be."""
LARGEST_FRACTION = 0.7
"""Volume fraction beyond which none is believed: more than a random packing has."""


def as_tree(hindrance: Hindrance | None) -> Hindrance | None:
    """The same, as what can be handed to a compiled program.

    Raises:
      InputError: it is no function.
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


def hindered_parameters(
    parameters: Parameters, hindrance: Hindrance, box: Box, position: Array, spacing: float
) -> Parameters:
    """The parameters with the f_w that each particle feels, (N,).

    Args:
      parameters, box: in one coherent system of units.
      hindrance: in place of `parameters.f_w`.
      position: centres, (3, N).
      spacing: of `local_volume_fraction`.
    """
    fraction = local_volume_fraction(parameters, box, position, spacing)
    return parameters.replace(f_w=hindrance(jnp.minimum(fraction, LARGEST_FRACTION)))


def local_volume_fraction(
    parameters: Parameters, box: Box, position: Array, spacing: float
) -> Array:
    """Volume fraction of coated particles at the height of each, over the width of the box; (N,).

    Every particle is spread over levels by a cubic B-spline and reads from them by the same: twice
    continuously differentiable, an average over some two spacings to either side. The floor
    mirrors the suspension, so that a bed is as dense there as above; over its top is clear fluid.
    Where particles rise it is the lid that mirrors, and the clear fluid is below.

    Args:
      parameters, box: in one coherent system of units.
      position: centres, (3, N).
      spacing: of the levels, about one particle diameter; fixes the number of levels.
    """
    levels = max(4, round(box.height / spacing))
    spacing = box.height / levels
    height = position[2] / spacing
    periodic = box.periodic[2]
    # Two levels beyond either end, where nothing is periodic.
    beyond = 0 if periodic else 2
    nodes = levels + 1 + 2 * beyond

    def reached(height: Array) -> tuple[Array, Array]:
        below = jnp.floor(lax.stop_gradient(height))
        level = below.astype(jnp.int32)[None, :] + jnp.arange(-1, 3, dtype=jnp.int32)[:, None]
        weight = jnp.stack(_cubic_b_spline(height - below))
        if periodic:
            return level % levels, weight
        # A negative index would count from the top.
        return jnp.where(level < -beyond, nodes, level + beyond), weight

    volume = per_particle(4 / 3 * jnp.pi * particle.outer_radius(parameters) ** 3, height.shape[0])
    share = volume / (box.size[0] * box.size[1] * spacing)
    fraction = jnp.zeros(nodes, height.dtype)
    mirrored = jnp.where(particle.rises(parameters), 2.0 * levels - height, -height)
    for image in (height,) if periodic else (height, mirrored):
        level, weight = reached(image)
        fraction = fraction.at[level].add(weight * share[None, :], mode="drop")
    level, weight = reached(height)
    return jnp.sum(weight * fraction[level], axis=0)


def _cubic_b_spline(offset: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the levels below and above a point, at -1, 0, 1 and 2 from the one below it."""
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
