"""Random numbers that depend on the seed alone, not on how JAX is configured.

JAX's settings, which environment variables can change, select the generator
(`JAX_DEFAULT_PRNG_IMPL`), the order of its numbers (`JAX_THREEFRY_PARTITIONABLE`) and an offset of
every seed (`JAX_RANDOM_SEED_OFFSET`). The functions here override all three.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike, DTypeLike

GENERATOR = "threefry2x32"


def key(seed: ArrayLike) -> Array:
    """Returns the key of a seed, for `jax.random` inside `ordered`."""
    # JAX adds its offset to every seed; this takes it off again.
    offset: int = jax.config.jax_random_seed_offset  # type: ignore[attr-defined] # made at run time
    return jax.random.key(seed - offset, impl=GENERATOR)


@contextmanager
def ordered() -> Iterator[None]:
    """Context in which random numbers come in JAX's default order."""
    with jax.threefry_partitionable(True):
        yield


KICKS = 1
"""Number folded into a seed for random kicks, whose start has the same seed."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RandomStream:
    """The random numbers of N particles: a key, and the place that they have reached.

    The numbers of a particle follow from the key, the number of the particle and the step alone.
    They do not depend on the order of the particles, nor on how a run is divided.
    """

    key: Array
    """Key of the seed, (2,) of 32 bits."""
    number: Array
    """Number of each particle, (N,); no two particles have the same."""
    step: Array
    """Number of steps with random kicks so far, ()."""

    @staticmethod
    def of_seed(seed: ArrayLike, particles: int) -> "RandomStream":
        """Returns the stream of a seed at its beginning, for N particles."""
        with ordered():
            data = jax.random.key_data(jax.random.fold_in(key(seed), KICKS))
        number = jnp.arange(particles, dtype=jnp.int32)
        return RandomStream(data, number, jnp.zeros((), jnp.int32))

    def normal(self, place: int, steps: ArrayLike, count: int, dtype: DTypeLike) -> Array:
        """Returns standard normal numbers of each particle, (count, N).

        They have 23 bits, so that runs of both precisions get the same numbers but for rounding.
        None is larger than 5.3.

        Args:
          place: place of the force that asks for them in its list; each has numbers of its own.
          steps: number of steps after the present one.
          count: number of random numbers for each particle.
          dtype: dtype of the numbers.
        """

        def of_particle(number: Array) -> Array:
            return jax.random.bits(jax.random.fold_in(at, number), (count,), jnp.uint32)

        with ordered():
            of_force = jax.random.fold_in(jax.random.wrap_key_data(self.key, impl=GENERATOR), place)
            at = jax.random.fold_in(of_force, self.step + steps)
            bits = jax.vmap(of_particle)(self.number).T
        # As jax.random.normal, but exact before the last line: that in single precision depends,
        # in its last digit, on the compiled program.
        uniform = ((bits >> 9).astype(dtype) + 0.5) * 2.0**-22 - 1.0
        return math.sqrt(2.0) * lax.erf_inv(uniform)

    def after(self, steps: int) -> "RandomStream":
        """Returns the stream after further steps."""
        return replace(self, step=self.step + steps)

    def permuted(self, order: Array) -> "RandomStream":
        """Returns the stream with particles permuted: entry i is particle `order[i]`, (N,)."""
        return replace(self, number=self.number[order])
