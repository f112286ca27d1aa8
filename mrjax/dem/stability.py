"""Stability check of a time step, from the fastest vibration mode of the contact network."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core import randomness
from mrjax.dem.integrator import Kick
from mrjax.dem.pairs import Pairs
from mrjax.kernel import pair_sum
from mrjax.laws.vectors import Vector, cross, dot, plus, times

ITERATIONS = 8
"""Number of power iterations for each estimate."""
STABILITY_LIMIT = 0.95
"""Rate above which a bed counts as unstable; below 1, as the iteration converges from below."""


class ModeEstimate(NamedTuple):
    """Estimate of the fastest mode and of its distance from instability."""

    mode: Array  # displacements and rotations of all particles, (6, N)
    rate: Array  # 1 at the limit of stability, ()


def initial_estimate(particles: int, dtype) -> ModeEstimate:
    """Initial estimate: a random mode, the same in every run, with rate 0."""
    with randomness.ordered():
        mode = jax.random.normal(randomness.key(0), (6, particles), dtype)
    return ModeEstimate(mode, jnp.zeros((), dtype))


def estimate_mode(
    before: ModeEstimate,
    pairs: Pairs,
    stiffness: tuple[Array, Array],
    radius: Array,
    kick: Kick,
    spin_kick: Kick,
) -> ModeEstimate:
    """Estimates the fastest mode of these contacts and its distance from instability.

    A bed with stiffness A and dashpots C is stable at a step dt while the largest eigenvalue of

        Q^1/2 (dt A + 2 C) Q^1/2,    Q = tanh(alpha dt / 2) / gamma of each particle or its spin,

    is less than 2 (`time_scales.largest_stable_step` for one contact). Power iteration finds this
    eigenvalue. It starts from the previous estimate of the mode, and underestimates the eigenvalue
    by some per cent.

    Args:
      before: previous estimate.
      pairs: pairs of the bed.
      stiffness: dt A + 2 C of each pair, normal and tangential, (P,); zero where no force acts.
      radius: radii of the particles, (N,).
      kick, spin_kick: coefficients of the step, from `integrator.kick` and `spin_kick`.
    """
    normal_spring, tangential_spring = stiffness
    square = dot(pairs.separation, pairs.separation)
    square = jnp.where(pairs.present & (square > 0.0), square, 1.0)
    direction = times(1.0 / jnp.sqrt(square), pairs.separation)
    yielding = jnp.sqrt(_compliance(kick) * jnp.ones_like(radius))
    turning = jnp.sqrt(_compliance(spin_kick) * jnp.ones_like(radius)) * radius

    def applied(mode: Array) -> Array:
        moved, turned = mode[:3] * yielding[None, :], mode[3:] * turning[None, :]
        sums, _ = pair_sum(
            _restoring_force,
            lambda _, partner, springs, shared, memory: springs.normal > 0.0,
            pairs.first,
            pairs.second,
            pairs.count,
            particles=_Displacement(moved, turned),
            pairs=_Springs(direction, normal_spring, tangential_spring),
        )
        pushed, spun = sums
        return jnp.concatenate([pushed * yielding[None, :], spun * turning[None, :]])

    def iterated(_, found: ModeEstimate) -> ModeEstimate:
        mode = applied(found.mode)
        size = jnp.sqrt(jnp.sum(mode**2))
        moves = size > 0.0
        mode = jnp.where(moves, mode / jnp.where(moves, size, 1.0), found.mode)
        return ModeEstimate(mode, jnp.where(moves, size, 0.0))

    length = jnp.sqrt(jnp.sum(before.mode**2))
    found = lax.fori_loop(0, ITERATIONS, iterated, ModeEstimate(before.mode / length, before.rate))
    # The estimate of a bed at rest decays; noise keeps components along modes of later contacts.
    noise = initial_estimate(len(radius), radius.dtype).mode
    return ModeEstimate(found.mode + 1e-3 * noise / jnp.sqrt(noise.size), 0.5 * found.rate)


class _Displacement(NamedTuple):
    """Displacement and rotation of a particle in a mode; rotations are in units of length."""

    moved: Vector
    turned: Vector


class _Springs(NamedTuple):
    """Direction and springs of a contact."""

    direction: Vector
    normal: Array
    tangential: Array


def _restoring_force(
    particle: _Displacement, partner: _Displacement, springs: _Springs, *_: None
) -> tuple[list[Vector], list[Vector], None]:
    """Restoring force and moment of a contact on both particles, from their displacements."""
    direction = springs.direction
    apart = plus(particle.moved, -1.0, partner.moved)
    # The lever arms point against the direction.
    slip = plus(apart, -1.0, cross(plus(particle.turned, 1.0, partner.turned), direction))
    along = (springs.normal - springs.tangential) * dot(slip, direction)
    force = plus(times(springs.tangential, slip), along, direction)
    moment = times(-1.0, cross(direction, force))
    return [force, moment], [times(-1.0, force), moment], None


def _compliance(kick: Kick) -> Array:
    """Value of tanh(alpha dt / 2) / gamma, finite without drag."""
    return kick.gain / (1.0 + kick.keep)
