"""Heights of the mudline and of the bed, read off profiles of volume fraction."""

import jax.numpy as jnp
from jax import Array


def mudline(profile: Array, suspended: Array, densest: Array) -> Array:
    """`Column.mudline` in cells, (T,), of profiles (T, cells)."""
    floor, clear = (jnp.full_like(profile[:, :1], value) for value in (densest, 0.0))
    below = jnp.concatenate([floor, profile[:, :-1]], axis=1)
    above = jnp.concatenate([profile[:, 1:], clear], axis=1)
    share = jnp.maximum(profile / jnp.maximum(below, suspended), above / suspended)
    return jnp.sum(jnp.clip(share, 0.0, 1.0), axis=1)


def bed_front(profile: Array, mudline: Array, meets: Array, full: Array) -> Array:
    """`Column.bed_front` in cells, (T,), of profiles (T, cells)."""
    bed = full > meets  # else all of the suspension is one
    excess = (profile - meets) / jnp.where(bed, full - meets, 1.0)
    suspension = mudline - jnp.sum(jnp.clip(excess, 0.0, 1.0), axis=1)
    return mudline - jnp.where(bed, suspension * jnp.clip(suspension - 1.0, 0.0, 1.0), 0.0)
