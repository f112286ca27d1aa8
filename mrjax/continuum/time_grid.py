"""Times of implicit steps: equal while the suspension settles, longer and longer afterwards.

t_j = j dt                                        for j <= J_1,
t_j = t_1 + J_2 dt (e^(b y) - 1) / b,  y = (j - J_1) / J_2    afterwards

b follows from the last time, so that a thousand times as long a run takes as many steps.
"""

import jax.numpy as jnp
from jax import Array, lax

SHARE = 0.6
"""Share of the steps that are equal."""
LEAST_STRETCH = 1.001
"""Least mean length of the later steps, in equal steps. For 1 the equation of b is singular."""
ITERATIONS = 40


def time_grid(settled: Array, last: Array, steps: int) -> Array:
    """Returns the times of J steps from 0 to at least the last time; (J + 1,), in any unit.

    Args:
      settled: time up to which the steps are equal, if it is early enough, ().
      last: last time, ().
      steps: number J of steps, at least 2.
    """
    equal = max(1, round(SHARE * steps))
    later = steps - equal
    first = jnp.minimum(settled, last * equal / steps)
    length = first / equal
    stretch = jnp.maximum((last - first) / (length * later), LEAST_STRETCH)
    growth = _growth(stretch)
    place = jnp.arange(1, later + 1, dtype=length.dtype) / later
    longer = first + length * later * jnp.expm1(growth * place) / growth
    return jnp.concatenate([jnp.arange(equal + 1, dtype=length.dtype) * length, longer])


def _growth(stretch: Array) -> Array:
    """Returns the b > 0 of (e^b - 1) / b = stretch > 1; ()."""

    def newton(growth: Array, stretch: Array) -> Array:
        return growth - (jnp.expm1(growth) - stretch * growth) / (jnp.exp(growth) - stretch)

    # From above the root of a convex function, every iterate is above it.
    fixed = lax.stop_gradient(stretch)
    growth = lax.fori_loop(
        0, ITERATIONS, lambda _, growth: newton(growth, fixed), 2.0 * jnp.log(fixed) + 2.0
    )
    slope = lax.stop_gradient(jnp.exp(growth) - stretch)
    return growth - (jnp.expm1(growth) - stretch * growth) / slope
