"""Residuals whose optimum is at the end of a bent valley."""

from collections import OrderedDict

import jax.numpy as jnp
import numpy as np


def bent(theta):
    """Rosenbrock's valley in logarithms: Gauss-Newton steps leave it."""
    x, y = jnp.log(theta["a"]), jnp.log(theta["b"])
    return jnp.stack([10.0 * (y - x**2), 1.0 - x])


BENT = OrderedDict(a=np.exp(-1.2), b=np.exp(1.0))
"""Where a search begins."""
