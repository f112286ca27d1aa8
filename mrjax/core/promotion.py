"""Room for libraries that mix dtypes and ranks, where the caller has made JAX strict."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def relaxed_promotion() -> Iterator[None]:
    """JAX's default promotion of dtypes and ranks, for calls into jax-md and optax."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
