"""Normal contact: modified Hertz (Son 2018, Eqs. 4-6), with the sign of its dissipation corrected.

F_n = (4/3 E* sqrt(R* d) (d + A d') + c(e) d'), not less than zero         (Eq. 4)

with overlap d, and d' > 0 on approach. The paper prints d - A d', which would add energy in every
impact. A contact cannot pull, so the force is zero instead of tensile.

All functions are elementwise, for any shapes that broadcast.
"""

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

ROUNDING = 1e-14
"""Overlap, as a fraction of R*, below which Hertz's law is smoothed.

Below it the stiffness rises linearly, not as a square root, whose slope at zero overlap is
infinite. At 1e-7 R*, the overlap of a 4 um iron particle at rest, the force changes by 5e-8.
"""


LEAST_DISTANCE = 1e-8
"""Least distance of two centres, in radii, so that no division by zero occurs."""


def effective_modulus(
    modulus_i: ArrayLike, poisson_i: ArrayLike, modulus_j: ArrayLike, poisson_j: ArrayLike
) -> Array:
    """Effective modulus E* of Eq. 5: 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j; Pa."""
    return 1.0 / ((1.0 - poisson_i**2) / modulus_i + (1.0 - poisson_j**2) / modulus_j)


def harmonic(value_i: ArrayLike, value_j: ArrayLike) -> Array:
    """Harmonic combination 1/R* = 1/R_i + 1/R_j (Eq. 6), also for the reduced mass m*.

    The result has the unit of the arguments.
    """
    return value_i * value_j / (value_i + value_j)


def stiffness(modulus: ArrayLike, radius: ArrayLike, overlap: ArrayLike) -> Array:
    """Normal stiffness dF/dd = 2 E* sqrt(R* d) of Hertz's law (Eq. 25); N/m."""
    return 2.0 * modulus * jnp.sqrt(radius * overlap)


def impact_overlap(
    modulus: ArrayLike, radius: ArrayLike, mass: ArrayLike, speed: ArrayLike
) -> Array:
    """Largest overlap of an elastic impact (Hertz), (15 m* v^2 / (16 E* sqrt(R*)))^(2/5); m.

    Args:
      modulus: E* of the pair, Pa.
      radius: R* of the pair, m.
      mass: m* of the pair, kg.
      speed: relative speed before the impact, m/s.
    """
    return (15.0 * mass * speed**2 / (16.0 * modulus * jnp.sqrt(radius))) ** (2 / 5)


@jax.custom_jvp
@jax.jit
def damping_ratio(restitution: ArrayLike) -> Array:
    """Damping ratio z that gives a dry impact the restitution e, 0 < e <= 1; 1.

    With Tsuji's damping, c = z sqrt(5 m* k) d^(1/4) with k = 4/3 E* sqrt(R*), d^(5/4) is a damped
    linear oscillator. The contact ends when the force is zero, not the overlap (Schwager & Poeschel
    2007), which gives

        -ln e = 2 z h(z),    h(z) = arccos(z) / sqrt(1 - z^2).

    The usual form, z = -ln e / sqrt(pi^2 + ln^2 e), assumes that the contact can pull. With a force
    that only pushes, it gives a restitution of 0.550 instead of 0.5.
    """
    loss = -jnp.log(restitution)

    def newton(_: int, ratio: Array) -> Array:
        return ratio + (loss - 2.0 * ratio * _angle_over_sine(ratio)) / _loss_slope(ratio)

    return jax.lax.fori_loop(0, _NEWTON_STEPS, newton, loss / jnp.sqrt(jnp.pi**2 + loss**2))


@damping_ratio.defjvp
def _damping_ratio_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (restitution,), (change,) = primals, tangents
    ratio = damping_ratio(restitution)
    return ratio, -change / (restitution * _loss_slope(ratio))


_NEWTON_STEPS = 8
_NEAR_ONE = 1e-3


def _angle_over_sine(ratio: Array) -> Array:
    """h(z); beyond z = 1 it continues smoothly as arccosh(z) / sqrt(z^2 - 1)."""
    gap = 1.0 - ratio**2
    critical = jnp.abs(gap) < _NEAR_ONE
    below = (gap > 0) & ~critical
    above = (gap < 0) & ~critical
    root = jnp.sqrt(jnp.where(critical, 1.0, jnp.abs(gap)))
    inside = jnp.arctan2(root, jnp.where(below, ratio, 0.5)) / root
    outside = jnp.arccosh(jnp.where(above, ratio, 2.0)) / root
    z = 1.0 - ratio
    series = 1.0 + z / 3.0 + 2.0 * z**2 / 15.0 + 2.0 * z**3 / 35.0 + 8.0 * z**4 / 315.0
    return jnp.where(critical, series, jnp.where(below, inside, outside))


def _loss_slope(ratio: Array) -> Array:
    """d/dz of 2 z h(z), from (1 - z^2) h' = z h - 1."""
    gap = 1.0 - ratio**2
    critical = jnp.abs(gap) < _NEAR_ONE
    angle = _angle_over_sine(ratio)
    slope = (ratio * angle - 1.0) / jnp.where(critical, 1.0, gap)
    z = 1.0 - ratio
    series = -(1.0 / 3.0 + 4.0 * z / 15.0 + 6.0 * z**2 / 35.0 + 32.0 * z**3 / 315.0)
    return 2.0 * angle + 2.0 * ratio * jnp.where(critical, series, slope)


def damping_coefficient(
    modulus: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    overlap: ArrayLike,
    dissipation: ArrayLike,
    damping: ArrayLike,
) -> Array:
    """Normal damping coefficient dF/dd' = 2/3 K A + z sqrt(10/3 m* K), K from Eq. 25; N s/m."""
    spring = stiffness(modulus, radius, overlap)
    return 2 / 3 * spring * dissipation + damping * jnp.sqrt(10 / 3 * mass * spring)


def roots(overlap: ArrayLike, radius: ArrayLike) -> tuple[Array, Array]:
    """d^(1/2) and d^(1/4) of an overlap d, smoothed near zero (`ROUNDING`).

    Args:
      overlap: d, m; negative if the surfaces are apart, which gives zero.
      radius: R*, m.
    """
    depth = jnp.maximum(overlap, 0.0)
    half_power = jnp.sqrt(depth + ROUNDING * radius)
    return depth / half_power, depth / (half_power * jnp.sqrt(half_power))


def normal_force(
    overlap: ArrayLike,
    closing_speed: ArrayLike,
    modulus: ArrayLike,
    radius: ArrayLike,
    mass: ArrayLike,
    dissipation: ArrayLike = 0.0,
    damping: ArrayLike = 0.0,
    *,
    damped: bool = True,
) -> Array:
    """Repulsive normal force of two surfaces: Eq. 4 and Tsuji's damping; N.

    The force and its first two derivatives are finite everywhere; the force is zero if the surfaces
    are apart.

    Args:
      overlap: d, m; negative if the surfaces are apart.
      closing_speed: d', m/s; positive on approach.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
      mass: m*, the reduced mass, kg; used only by `damping`.
      dissipation: A of Eq. 4, s; gives a restitution that falls with the impact speed.
      damping: z of `damping_ratio`; gives a restitution that does not depend on the impact speed.
      damped: False if `dissipation` and `damping` are zero; the compiled program is then shorter.
    """
    root, fourth_root = roots(overlap, radius)
    hertz = 4.0 / 3.0 * modulus * jnp.sqrt(radius)
    depth = jnp.maximum(overlap, 0.0)
    if not damped:
        return hertz * root * depth
    elastic = hertz * root * (depth + dissipation * closing_speed)
    viscous = damping * jnp.sqrt(5.0 * mass * hertz) * fourth_root * closing_speed
    return jnp.maximum(elastic + viscous, 0.0)
