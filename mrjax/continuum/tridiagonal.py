"""Nonlinear tridiagonal equations of an implicit step, solved with exact derivatives.

F(y, p) = 0, with a tridiagonal Jacobian J = dF/dy. Newton's method finds y without derivatives with
respect to the parameters p. One further step y - J^-1 F(y, p), with y and J held constant, then has
the derivative -J^-1 dF/dp of the implicit function (Dini).

Where F has a kink, an iteration that crosses it stops just behind it. Without this rule iterations
may go to and fro between two branches.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jax import Array, lax

P = TypeVar("P")

MOST_ITERATIONS = 50
"""Greatest number of iterations. Five to ten suffice."""
BEHIND = 4.0
"""Distance behind a kink at which an iteration stops, in roundings of its place."""
FULL_STEPS = 12
"""Number of iterations after which every third one is halved."""
ROUNDINGS = 64.0
"""Change of an unknown at which the iterations end, in roundings of the largest unknown."""


class Linearised(NamedTuple):
    """A residual F and the three diagonals of its Jacobian; (cells,) each."""

    residual: Array
    lower: Array  # d F_i / d y_(i-1); the first is zero
    diagonal: Array
    upper: Array  # d F_i / d y_(i+1); the last is zero


def root(
    equations: Callable[[Array, P], Linearised],
    start: Array,
    given: P,
    fallback: P,
    kinks: tuple[Array, Array],
) -> tuple[Array, Array]:
    """Returns the root y of F(y, p) = 0 by Newton's method, without derivatives.

    Args:
      equations: function from y and p to F and its Jacobian. It takes all traced values through p.
      start: first iterate, (cells,).
      given: p, a pytree.
      fallback: the p that takes its place if the iterations do not come to an end.
      kinks: values of an unknown at which F has a kink, the lower first, () each.

    Returns:
      The root, (cells,), and True if it is that of the fallback, ().
    """
    given, fallback, start, (low, high) = lax.stop_gradient((given, fallback, start, kinks))
    (below_low, above_low), (below_high, above_high) = _beside(low), _beside(high)
    tolerance = ROUNDINGS * jnp.finfo(start.dtype).eps

    def unfinished(carry: tuple[Array, Array, Array]) -> Array:
        root, change, iterations = carry
        # `not <=`, so that iterations that have become NaN have not come to an end.
        moves = ~(jnp.max(jnp.abs(change)) <= tolerance * jnp.max(jnp.abs(root)))
        return moves & (iterations < 2 * MOST_ITERATIONS)

    def iterate(carry: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        root, _, iterations = carry
        root = jnp.where(iterations == MOST_ITERATIONS, start, root)
        least = jnp.where(root > high, below_high, jnp.where(root > low, below_low, -jnp.inf))
        most = jnp.where(root <= low, above_low, jnp.where(root <= high, above_high, jnp.inf))
        # A cycle between the two sides of kinks ends in its middle.
        number = iterations % MOST_ITERATIONS
        share = jnp.where((number > FULL_STEPS) & (number % 3 == 0), 0.5, 1.0)
        now = select(iterations >= MOST_ITERATIONS, fallback, given)
        change = share.astype(root.dtype) * newton_step(equations(root, now))
        moved = jnp.clip(root - change, least, most)
        return moved, root - moved, iterations + 1

    begin = start, jnp.full_like(start, jnp.inf), jnp.zeros((), jnp.int32)
    root, _, iterations = lax.while_loop(unfinished, iterate, begin)
    return root, iterations > MOST_ITERATIONS


def select(condition: Array, chosen: P, otherwise: P) -> P:
    """Returns one of two pytrees, by a condition; leaves that are the same stay as they are."""
    return jax.tree.map(
        lambda one, other: one if one is other else jnp.where(condition, one, other),
        chosen,
        otherwise,
    )


def with_derivatives(
    equations: Callable[[Array, P], Linearised], root: Array, given: P
) -> tuple[Array, Array]:
    """Returns a root of F(y, p) = 0 with the derivatives of the implicit function.

    Args:
      equations: as for `root`.
      root: the root, (cells,).
      given: p, a pytree.

    Returns:
      The root, (cells,), and its error: the greatest change by a further iteration over the
      greatest unknown, ().
    """
    root = lax.stop_gradient(root)
    residual, *jacobian = equations(root, given)
    change = newton_step(Linearised(residual, *lax.stop_gradient(jacobian)))
    fixed = lax.stop_gradient(change)
    error = jnp.max(jnp.abs(fixed)) / jnp.max(jnp.abs(root))
    return root - (change - fixed), error


def _beside(kink: Array) -> tuple[Array, Array]:
    """Returns the values just below and just above a kink."""
    distance = BEHIND * jnp.finfo(kink.dtype).eps * jnp.abs(kink)
    return kink - distance, kink + distance


def newton_step(linearised: Linearised) -> Array:
    """Returns J^-1 F; (cells,)."""
    residual, lower, diagonal, upper = linearised
    return lax.linalg.tridiagonal_solve(lower, diagonal, upper, residual[:, None])[:, 0]
