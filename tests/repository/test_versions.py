"""The jax that is installed computes right: the computation that jax 0.10.2 gets wrong."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest


@pytest.mark.parametrize("rows, dtype", [(16_385, jnp.float64), (32_769, jnp.float32)])
def test_vmapped_matrix_vector_product_then_reduction(rows, dtype):
    """jax-ml/jax#39103: silently wrong above 16,384 float64 or 32,768 float32 rows.

    A constant matrix, and a sum over each row's product.
    """
    matrix = np.arange(1.0, 10.0).reshape(3, 3) / 10
    vectors = np.random.default_rng(0).random((rows, 3))

    @jax.jit
    def of(vectors):
        constant = jnp.asarray(matrix, dtype)
        return jax.vmap(lambda vector: jnp.sum((constant @ vector) ** 2))(vectors)

    expected = np.sum((vectors @ matrix.T) ** 2, axis=1)
    computed = of(jnp.asarray(vectors, dtype))
    np.testing.assert_allclose(computed, expected, rtol=1e-12 if dtype == jnp.float64 else 1e-5)
