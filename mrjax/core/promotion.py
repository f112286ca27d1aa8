"""JAX's default promotion, for calls into libraries that mix dtypes and ranks.

A caller may have made JAX strict (`jax_numpy_dtype_promotion`, `jax_numpy_rank_promotion`).
"""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def relaxed_promotion() -> Iterator[None]:
    """Context with JAX's default promotion of dtypes and ranks, for calls into jax-md and optax."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield
