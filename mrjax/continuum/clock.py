"""A delay at the start of settling, as a clock that runs more slowly at first.

v(phi, t) = v(phi) (1 - exp(-t / t_d))        particles aggregate, with the time scale t_d

All velocities have the same factor. The column therefore passes through the same states as without
the delay, at the times

tau(t) = INTEGRAL of (1 - exp(-t / t_d)) dt = t - t_d (1 - exp(-t / t_d)),

which is t^2 / (2 t_d) at first and t - t_d at last.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closed_forms import phi_1


def delayed_times(times: ArrayLike, delay: ArrayLike) -> Array:
    """Returns the times at which a column without delay has the same state; s, (T,).

    Args:
      times: times, s, (T,), at least 0.
      delay: time scale t_d of aggregation, s, (), at least 0.

    Example:
      >>> mrjax.delayed_times([0.0, 60.0, 3600.0], delay=60.0).round(1)
      Array([   0. ,   22.1, 3540. ], dtype=float64)
    """
    times = jnp.asarray(times, float)
    delayed = delay > 0.0
    scale = jnp.where(delayed, delay, 1.0)
    return jnp.where(delayed, times * (1.0 - phi_1(times / scale)), times)
