"""Moments that a field induces in spheres, each in the field of all others.

    m_i = m_r,i + V_i k(|H_i|) H_i,    H_i = H_0 + sum_j T_ij m_j

with the remanent moment m_r, the local field H_i, the field T_ij m_j of a dipole, and k of
`mrjax.laws.magnetism`. Without saturation V k = 4 pi R^3 beta.

The local fields are found by Newton's method, one step without saturation. Its equations are solved
by conjugate gradients on the symmetric operator 1 - C^1/2 T C^1/2, with C = dm/dH of each sphere.
Derivatives are those of the implicit equation. They come from the last two steps alone, whose
derivatives are exact up to the third order.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.laws import dipoles, magnetism

MOST_ITERATIONS = 200
"""Largest number of iterations of conjugate gradients."""
MOST_STEPS = 50
"""Largest number of steps of Newton's method."""
NEAR, COARSE = 1e-6, 1e-3
"""Relative change at which the last two steps follow, and tolerance of the equations before."""


class Sphere(NamedTuple):
    """Volume and magnetic constants of the solid spheres; () or (N,)."""

    volume: ArrayLike
    """V of the magnetic core, m^3."""
    susceptibility: ArrayLike
    """chi of the solid, 1."""
    saturation: ArrayLike | None = None
    """M_s, A/m; None for none."""

    def moment(self, field: Array) -> Array:
        """Moment induced by local fields, V k(|H|) H; (3, N) in A m^2."""
        strength, _ = _strength(field)
        secant = magnetism.secant_susceptibility(strength, self.susceptibility, self.saturation)
        return jnp.atleast_1d(self.volume * secant)[None, :] * field

    def response(self, field: Array) -> "_Response":
        """Derivative dm/dH of the moments at local fields."""
        strength, direction = _strength(field)
        constants = strength, self.susceptibility, self.saturation
        across = self.volume * magnetism.secant_susceptibility(*constants)
        along = self.volume * magnetism.tangent_susceptibility(*constants)
        shape = field.shape[1:]
        return _Response(jnp.broadcast_to(along, shape), jnp.broadcast_to(across, shape), direction)


class _Response(NamedTuple):
    """A symmetric matrix of each particle, by its eigenvalues along and across a direction."""

    along: Array  # (N,)
    across: Array  # (N,)
    direction: Array  # unit vector, (3, N)

    def applied(self, vectors: Array) -> Array:
        """Product with a vector of each particle, (3, N)."""
        parallel = jnp.sum(self.direction * vectors, axis=0)
        difference = (self.along - self.across) * parallel
        return self.across[None, :] * vectors + difference[None, :] * self.direction

    def root(self) -> "_Response":
        """The square root of the matrices."""
        return self._replace(along=jnp.sqrt(self.along), across=jnp.sqrt(self.across))


def _strength(field: Array) -> tuple[Array, Array]:
    """Length (N,) and direction (3, N) of fields; the direction of no field is zero."""
    square = jnp.sum(field**2, axis=0)
    present = square > 0.0
    size = jnp.sqrt(jnp.where(present, square, 1.0))
    direction = jnp.where(present[None, :], field / size[None, :], 0.0)
    return jnp.where(present, size, 0.0), direction


def local_fields(
    position: Array,
    remanent: Array,
    applied: Array,
    sphere: Sphere,
    period: Array | None = None,
) -> Array:
    """Local fields H_i at spheres that magnetise each other; (3, N) in A/m.

    The result is NaN if the iteration does not converge.

    Args:
      position: centres, (3, N) in m; spheres must not overlap by more than a quarter of a radius.
      remanent: remanent moments m_r, (3, N) in A m^2.
      applied: uniform field H_0, (3,) in A/m.
      sphere: volumes, susceptibility and saturation.
      period: as for `mrjax.laws.dipoles.fields`.
    """

    def of_dipoles(moment: Array, position: Array = position) -> Array:
        return dipoles.fields(position, moment, period)

    tolerance = max(1e-12, 10.0 * float(jnp.finfo(position.dtype).eps))
    outside = applied[:, None] + of_dipoles(remanent)
    linear = sphere._replace(saturation=None).response(jnp.zeros_like(outside))
    if sphere.saturation is None:
        return _solved(linear, of_dipoles, outside, tolerance)

    fixed, fixed_position, fixed_outside = lax.stop_gradient((sphere, position, outside))

    def of_fixed(moment: Array) -> Array:
        return of_dipoles(moment, fixed_position)

    def last(field: Array, _: None) -> tuple[Array, None]:
        return _step(field, sphere, of_dipoles, outside, tolerance), None

    found, _ = lax.scan(last, _newton(fixed, of_fixed, fixed_outside), length=2)
    return found


Operator = Callable[[Array], Array]
"""Fields of moments at all particles, (3, N) to (3, N)."""


def _step(
    field: Array, sphere: Sphere, of_dipoles: Operator, outside: Array, tolerance: float
) -> Array:
    """Local fields after one step of Newton's method."""
    residual = outside + of_dipoles(sphere.moment(field)) - field
    return field + _solved(sphere.response(field), of_dipoles, residual, tolerance)


def _newton(sphere: Sphere, of_dipoles: Operator, outside: Array) -> Array:
    """Local fields by Newton's method, without derivative; NaN if it does not converge."""
    most = max(NEAR, 1e3 * float(jnp.finfo(outside.dtype).eps))

    def size(fields: Array) -> Array:
        return jnp.sqrt(jnp.sum(fields**2))

    def unfinished(now: tuple[Array, Array, Array]) -> Array:
        _, change, number = now
        return (change > most) & (number < MOST_STEPS)

    def step(now: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        field, _, number = now
        after = _step(field, sphere, of_dipoles, outside, COARSE)
        total = size(after)
        change = size(after - field) / jnp.where(total > 0.0, total, 1.0)
        return after, change, number + 1

    begin = outside, jnp.asarray(jnp.inf, outside.dtype), jnp.asarray(0)
    found, change, _ = lax.while_loop(unfinished, step, begin)
    return jnp.where(change <= most, found, jnp.nan)


def _solved(response: _Response, of_dipoles: Operator, right: Array, tolerance: float) -> Array:
    """Solves x - T C x = b; (3, N). The result is NaN if it does not converge.

    C may be zero: conjugate gradients solve for C^1/2 x.
    """
    root = lax.stop_gradient(response).root()

    def matrix(fields: Array) -> Array:
        return fields - of_dipoles(response.applied(fields))

    def symmetric(vectors: Array) -> Array:
        return vectors - root.applied(of_dipoles(root.applied(vectors)))

    def solve(_: Operator, right: Array) -> Array:
        return right + of_dipoles(
            root.applied(_conjugate_gradients(symmetric, root.applied(right), tolerance))
        )

    def transposed(_: Operator, right: Array) -> Array:
        moment = root.applied(of_dipoles(right))
        return right + root.applied(_conjugate_gradients(symmetric, moment, tolerance))

    return lax.custom_linear_solve(matrix, right, solve, transposed)


class _Iterate(NamedTuple):
    """Conjugate gradients after a number of iterations."""

    found: Array
    residual: Array
    direction: Array
    square: Array  # of the residual
    number: Array
    definite: Array  # True while the matrix was positive definite along all directions


def _conjugate_gradients(matrix: Operator, right: Array, tolerance: float) -> Array:
    """Solves a symmetric positive definite system; NaN if it is not, or does not converge.

    The method of `jax.scipy.sparse.linalg` does not tell whether it converged.
    """
    least = tolerance**2 * jnp.sum(right**2)

    def unfinished(now: _Iterate) -> Array:
        return (now.square > least) & (now.number < MOST_ITERATIONS) & now.definite

    def iteration(now: _Iterate) -> _Iterate:
        image = matrix(now.direction)
        curvature = jnp.sum(now.direction * image)
        length = now.square / curvature
        residual = now.residual - length * image
        square = jnp.sum(residual**2)
        direction = residual + square / now.square * now.direction
        found = now.found + length * now.direction
        return _Iterate(found, residual, direction, square, now.number + 1, curvature > 0.0)

    square = jnp.sum(right**2)
    begin = _Iterate(jnp.zeros_like(right), right, right, square, jnp.asarray(0), jnp.asarray(True))
    end = lax.while_loop(unfinished, iteration, begin)
    return jnp.where((end.square <= least) & end.definite, end.found, jnp.nan)
