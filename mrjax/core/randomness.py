"""Random numbers that depend on the seed alone, not on how JAX is configured.

JAX's settings, which environment variables can change, select the generator
(`JAX_DEFAULT_PRNG_IMPL`), the order of its numbers (`JAX_THREEFRY_PARTITIONABLE`) and an offset of
every seed (`JAX_RANDOM_SEED_OFFSET`). The functions here override all three.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import jax
from jax import Array

GENERATOR = "threefry2x32"


def key(seed: int) -> Array:
    """Returns the key of a seed, for `jax.random` inside `ordered`."""
    # JAX adds its offset to every seed; this takes it off again.
    offset: int = jax.config.jax_random_seed_offset  # type: ignore[attr-defined] # made at run time
    return jax.random.key(seed - offset, impl=GENERATOR)


@contextmanager
def ordered() -> Iterator[None]:
    """Context in which random numbers come in JAX's default order."""
    with jax.threefry_partitionable(True):
        yield
