"""Values that fix the shapes of a run must be known while it is traced."""

import numpy as np
from jax import errors, lax
from jax.typing import ArrayLike


def concrete(value: ArrayLike) -> np.ndarray | None:
    """The value as a numpy array, also under `grad` and `jvp`; None under `jit` or `vmap` over it.

    Dropping the derivative uncovers the value that a differentiated call carries.
    """
    try:
        return np.asarray(lax.stop_gradient(value))
    except (errors.TracerArrayConversionError, errors.ConcretizationTypeError):
        return None
