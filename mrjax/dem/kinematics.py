"""Kinematics of pairs: overlap, normal and relative motion of two surfaces.

A vector is a tuple of three components; each is (P,) for P pairs, or a scalar for one pair.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.normal import LEAST_DISTANCE
from mrjax.laws.vectors import Vector, cross, dot, plus, times


class ParticleState(NamedTuple):
    """Motion and radius of one of the two surfaces of a pair; a wall does not move."""

    displacement: Vector  # since the list was built, m
    velocity: Vector  # m/s
    spin: Vector  # rad/s
    radius: Array  # m
    gains: Vector  # two factors, of the force and of the torque


class PairKinematics(NamedTuple):
    """Geometry and motion of pairs at one moment; (P,) each."""

    overlap: Array
    """Overlap d, m; negative if the surfaces are apart."""
    lever_arm: Array
    """Distance from the particle's centre to the middle of the overlap, m."""
    partner_lever_arm: Array
    """Distance from the partner's centre to the middle of the overlap, m."""
    normal: Vector
    """Unit vector from the partner to the particle."""
    normal_velocity: Array
    """Velocity of approach d', m/s; positive on approach."""
    normal_rotation_rate: Vector
    """Rate of change of the normal, 1/s."""
    torsion_rate: Array
    """Mean spin of both surfaces about the normal, rad/s."""
    slip: Vector
    """Tangential velocity of the surface relative to the partner's surface, m/s."""
    rolling: Vector
    """Spin relative to the partner, without the component along the normal, rad/s."""

    @property
    def gap(self) -> Array:
        """Distance between the surfaces, m; negative where they overlap."""
        return -self.overlap


def separation(
    particle: ParticleState, partner: ParticleState, at_build: Vector, axis: Array
) -> Vector:
    """Vector from the partner's centre, or from a wall along its normal, to the particle's; m."""
    moved = plus(particle.displacement, -1.0, partner.displacement)
    return tuple(
        then + jnp.where((axis < 0) | (axis == along), since, 0.0)
        for along, (then, since) in enumerate(zip(at_build, moved, strict=True))
    )


def pair_kinematics(
    particle: ParticleState, partner: ParticleState, at_build: Vector, axis: Array
) -> PairKinematics:
    """Computes overlap, normal and relative motion of two surfaces.

    Two coincident centres overlap by the sum of the radii and have no normal, so no force acts.
    A wall acts as a mirror image of the particle: the lever arm is R - d/2, and the normal does not
    rotate.

    Args:
      particle, partner: the two surfaces.
      at_build: separation when the list of pairs was built, m.
      axis: axis of a wall's normal, 0 to 2; -1 if both surfaces are particles.
    """
    between = separation(particle, partner, at_build, axis)
    square = dot(between, between)
    least = LEAST_DISTANCE * particle.radius
    distance = jnp.sqrt(jnp.where(square > 0.0, square, least**2))
    normal = times(1.0 / distance, between)
    partner_radius = jnp.where(axis < 0, partner.radius, 0.0)
    turns = jnp.where(axis < 0, 1.0 / distance, 0.0)
    overlap = particle.radius + partner_radius - distance
    lever_arm, partner_lever_arm = particle.radius - 0.5 * overlap, partner_radius - 0.5 * overlap
    velocity = plus(particle.velocity, -1.0, partner.velocity)
    normal_velocity = -dot(velocity, normal)
    along = plus(velocity, normal_velocity, normal)
    surface_spin = plus(times(lever_arm, particle.spin), partner_lever_arm, partner.spin)
    relative = plus(particle.spin, -1.0, partner.spin)
    return PairKinematics(
        overlap,
        lever_arm,
        partner_lever_arm,
        normal,
        normal_velocity,
        times(turns, along),
        0.5 * dot(plus(particle.spin, 1.0, partner.spin), normal),
        plus(along, -1.0, cross(surface_spin, normal)),
        plus(relative, -dot(relative, normal), normal),
    )


def time_in_contact(pair: PairKinematics, time_step: ArrayLike) -> Array:
    """Time during which the surfaces touched within the last step, (P,).

    Suppose a spring stretched by the slip of the whole step in which contact begins. Then it would
    not depend on the moment of first contact, nor would the motion after it. The derivative would
    lack a contribution that does not vanish with the step.
    """
    return time_step * share_in_contact(pair, time_step)


def share_in_contact(pair: PairKinematics, time_step: ArrayLike) -> Array:
    """Share of the last step during which the surfaces touched; 1 if they do not touch, (P,)."""
    approach = jnp.maximum(time_step * pair.normal_velocity, pair.overlap)
    touches = pair.overlap > 0.0
    return jnp.where(touches, pair.overlap / jnp.where(touches, approach, 1.0), 1.0)
