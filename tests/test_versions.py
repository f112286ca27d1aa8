"""The jax that is installed computes right: the computation that jax 0.10.2 gets wrong."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest


@pytest.mark.parametrize("rows, dtype", [(20_000, jnp.float64), (40_000, jnp.float32)])
def test_vmapped_matrix_vector_product_then_reduction(rows, dtype):
    """jax-ml/jax#39103: silently wrong above 16,384 float64 or 32,768 float32 rows."""
    generator = np.random.default_rng(0)
    matrices, vectors = generator.random((rows, 3, 3)), generator.random((rows, 3))

    @jax.jit
    def total(matrices, vectors):
        return jnp.sum(jax.vmap(lambda matrix, vector: matrix @ vector)(matrices, vectors), axis=0)

    expected = np.einsum("nij,nj->i", matrices, vectors)
    computed = total(jnp.asarray(matrices, dtype), jnp.asarray(vectors, dtype))
    # Summation in single precision loses a few units of 1e-7 for each power of two of the rows.
    np.testing.assert_allclose(computed, expected, rtol=1e-12 if dtype == jnp.float64 else 1e-5)
