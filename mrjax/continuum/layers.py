"""Layers of a tube, over which concentrations are averaged."""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def layer_ends(levels: Array, thickness: ArrayLike, height: ArrayLike) -> tuple[Array, Array]:
    """Returns the lower and upper ends of layers, which end at the floor and at H; m, (Q,) each.

    Args:
      levels: middle of each layer, m above the floor, (Q,).
      thickness: thickness of each layer, m, () or (Q,).
      height: H, m, ().
    """
    low = jnp.clip(levels - 0.5 * thickness, 0.0, height)
    return low, jnp.clip(levels + 0.5 * thickness, 0.0, height)
