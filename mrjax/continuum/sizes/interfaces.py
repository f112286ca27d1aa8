"""Heights of fronts in profiles of the total volume fraction, located by particle volume.

A front is smeared over a few cells, and its shape changes as it passes from cell to cell. Where a
profile crosses a level is found by linear interpolation to a fraction of a cell, but its derivative
has that change of shape, too. The volume of the particles does not: over a window of cells from the
plateau b below the front to the plateau a above it,

h = bottom of the window + SUM over its cells of (phi - a) / (b - a)

is exact, however a front is smeared. It holds for a front, and the interpolation for a smooth
profile. The height is their mean, weighted by the variance of the place of the rise in the window.
"""

import jax
import jax.numpy as jnp
from jax import Array, lax

HALF = 3
"""Cells of the window on either side of the crossing."""
SHARP, SMOOTH = 1.0, 2.5
"""Variances, in cells squared, below which a rise is a front and above which it is smooth. That of
a straight profile is (7^2 - 1) / 12 = 4."""


def crossing(profile: Array, level: Array, densest: Array) -> Array:
    """Returns the height below which a profile exceeds a level; in cells, ().

    Args:
      profile: total volume fraction of every cell from the lowest, (C,).
      level: volume fraction, ().
      densest: volume fraction of the floor, ().
    """
    ends = jnp.zeros(HALF + 1, profile.dtype)
    padded = jnp.concatenate([ends + densest, profile, ends])
    place = jnp.arange(padded.size)
    last = jnp.max(jnp.where(lax.stop_gradient(padded) >= level, place, HALF))
    window = lax.dynamic_slice(padded, (last - HALF,), (2 * HALF + 2,))
    cell = (last - HALF - 1).astype(profile.dtype)  # index of the highest cell above the level
    drop = window[HALF] - window[HALF + 1]
    by_level = cell + 0.5 + (window[HALF] - level) / jnp.where(drop > 0.0, drop, 1.0)
    rise = window[0] - window[-1]
    front = rise > 0.0
    share = (window - window[-1]) / jnp.where(front, rise, 1.0)
    offset = jnp.sum(share[1:-1]) - (HALF - 1.0)  # above the bottom of the highest cell
    by_volume = cell + offset
    faces = jnp.arange(-HALF, HALF + 1, dtype=profile.dtype)  # from the top of the cell
    spread = jnp.sum(-jnp.diff(share) * (faces + 1.0 - offset) ** 2)
    weight = jnp.where(front, jnp.clip((SMOOTH - spread) / (SMOOTH - SHARP), 0.0, 1.0), 0.0)
    return jnp.maximum(weight * by_volume + (1.0 - weight) * by_level, 0.0)


@jax.jit
def crossings(profiles: Array, level: Array, densest: Array) -> Array:
    """Returns `crossing` of profiles, (T, C); in cells, (T,)."""
    return jax.vmap(crossing, (0, None, None))(profiles, level, densest)


def volume_below(fraction: Array, heights: Array) -> Array:
    """Returns the volume of each class below a height, in cells; (T, K).

    Args:
      fraction: volume fractions, (T, K, C).
      heights: height at each time, in cells, (T,).
    """
    bottoms = jnp.arange(fraction.shape[-1], dtype=fraction.dtype)
    filled = jnp.clip(heights[:, None] - bottoms[None], 0.0, 1.0)
    return jnp.sum(fraction * filled[:, None], axis=-1)


def carried(weight: Array, bed: Array) -> Array:
    """Returns the weight of the bed above the middle of every cell, in cells times density; (T, C).

    A cell that is partly bed has the density of the one below it in that part.

    Args:
      weight: density of the particles in every cell, (T, C).
      bed: height of the top of the bed, in cells, (T,).
    """
    bottoms = jnp.arange(weight.shape[1], dtype=weight.dtype)
    filled = jnp.clip(bed[:, None] - bottoms[None], 0.0, 1.0)
    below = jnp.concatenate([weight[:, :1], weight[:, :-1]], axis=1)
    density = jnp.where(filled < 1.0, below, weight)
    layers = density * filled
    above = jnp.cumsum(layers[:, ::-1], axis=1)[:, ::-1] - layers
    return above + density * jnp.maximum(filled - 0.5, 0.0)
