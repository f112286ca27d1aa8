"""Random numbers that a seed decides alone, whatever generator JAX is set to.

Settings of JAX, and so environment variables such as `JAX_DEFAULT_PRNG_IMPL`, would choose another
generator, another order of its numbers (`JAX_THREEFRY_PARTITIONABLE`) or another seed
(`JAX_RANDOM_SEED_OFFSET`).
"""

from collections.abc import Iterator
from contextlib import contextmanager

import jax
from jax import Array

GENERATOR = "threefry2x32"


def key(seed: int) -> Array:
    """The key of a seed, for `jax.random` inside `ordered`."""
    # JAX adds its offset to every seed.
    offset: int = jax.config.jax_random_seed_offset  # type: ignore[attr-defined] # made at run time
    return jax.random.key(seed - offset, impl=GENERATOR)


@contextmanager
def ordered() -> Iterator[None]:
    """Has numbers drawn inside in JAX's default order."""
    with jax.threefry_partitionable(True):
        yield
