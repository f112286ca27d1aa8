"""Heights of the mudline and of the bed from profiles of volume fraction."""

import jax.numpy as jnp
from jax import Array


def mudline(profile: Array, suspended: Array, densest: Array) -> Array:
    """Computes `Column.mudline` from profiles (T, cells); in cells, (T,)."""
    return jnp.sum(filled_parts(profile, suspended, densest), axis=1)


def filled_parts(profile: Array, suspended: Array, densest: Array) -> Array:
    """Returns the filled part of every cell; 1, (T, cells).

    Args:
      profile: volume fractions, (T, cells).
      suspended: volume fraction of the uniform suspension, () or (T, 1).
      densest: phi_m, ().
    """
    floor, clear = (jnp.full_like(profile[:, :1], value) for value in (densest, 0.0))
    below = jnp.concatenate([floor, profile[:, :-1]], axis=1)
    above = jnp.concatenate([profile[:, 1:], clear], axis=1)
    filled = jnp.maximum(profile / jnp.maximum(below, suspended), above / suspended)
    return jnp.clip(filled, 0.0, 1.0)


def bed_front(profile: Array, mudline: Array, meets: Array, full: Array) -> Array:
    """Computes `Column.bed_front` from profiles (T, cells); in cells, (T,)."""
    bed = full > meets  # False: the suspension is as dense as the bed
    excess = (profile - meets) / jnp.where(bed, full - meets, 1.0)
    suspension = mudline - jnp.sum(jnp.clip(excess, 0.0, 1.0), axis=1)
    return mudline - jnp.where(bed, suspension * jnp.clip(suspension - 1.0, 0.0, 1.0), 0.0)
