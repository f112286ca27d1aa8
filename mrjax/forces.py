"""The sum of forces and torques on every particle, all but the drag (Son 2018, Eqs. 2 and 19).

The drag is linear in velocity and spin, and integrated exactly by the leapfrog. Arrays are kept
apart by component and by contact slot, (S, N), K for the listed partners and W for the walls: on
a CPU that is worth 3 to 4 times over (N, S, 3).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from mrjax import contact, friction, history, pairs, particle, rolling
from mrjax.box import Box
from mrjax.concrete import concrete
from mrjax.history import Memory
from mrjax.neighbours import Neighbours
from mrjax.pairs import Surfaces
from mrjax.parameters import Parameters, per_particle
from mrjax.vectors import Vector, cross, dot, plus, times


@dataclass(frozen=True)
class Laws:
    """Which tangential laws a run needs; without friction there is nothing to remember."""

    sliding: bool
    rolling: bool


def laws(parameters: Parameters) -> Laws:
    """Those whose coefficient is not known to be zero, or whose derivative may be wanted."""

    def acts(coefficient: Array) -> bool:
        return isinstance(coefficient, Tracer) or bool(concrete(coefficient).any())

    return Laws(acts(parameters.friction), acts(parameters.rolling_friction))


Memories = tuple[Memory, Memory]
"""Of the contacts with partners, and with walls: apart, for what is joined is copied every step."""


class Loads(NamedTuple):
    """What acts on every particle at one moment."""

    force: Array  # N, (3, N)
    torque: Array  # N m, (3, N)
    memory: Memories
    overlap: Array  # deepest of each particle, m; negative where it touches nothing; (N,)


Law = Callable[[Array, Array, Array, Memories], Loads]


def total(
    parameters: Parameters,
    box: Box,
    particles: int,
    *,
    laws: Laws,
    material: Array | None = None,
    time_step: float = 1.0,
) -> Callable[[Array, Neighbours], Law]:
    """The force law of a run, with all that does not change during it computed once.

    Args:
      parameters, box: in one coherent system of units.
      particles: N.
      laws: those that act.
      material: of each particle, (N,); None where all are of one.
      time_step: by which the contacts' memory advances at every evaluation.

    Returns:
      law(reference, neighbours) for the positions of a neighbour list, (3, N). It returns
      loads(displacement, velocity, spin, memory): what has been travelled since, velocities and
      spins, (3, N) each, and the memory of the contacts.
    """
    radius = per_particle(particle.outer_radius(parameters), particles)
    weight = per_particle(particle.net_weight(parameters), particles)
    pull = jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])
    at_wall = pairs.with_walls(parameters, material)

    def law(reference: Array, neighbours: Neighbours) -> Law:
        between = pairs.between_particles(parameters, material, neighbours.partner)

        def loads(displacement, velocity, spin, memory: Memories) -> Loads:
            position = reference + displacement
            meetings = (
                _with_partners(displacement, velocity, spin, neighbours, radius),
                _with_walls(position, velocity, spin, box, radius),
            )
            force, torque = pull, jnp.zeros_like(pull)
            deepest = jnp.full_like(radius, -jnp.inf)
            remembered = []
            for meeting, surfaces, before in zip(meetings, (between, at_wall), memory, strict=True):
                acting, turning, after = _contact(meeting, surfaces, before, laws, time_step)
                force = force + _summed(acting)
                torque = torque if turning is None else torque + _summed(turning)
                deepest = jnp.maximum(deepest, jnp.max(meeting.overlap, axis=0, initial=-jnp.inf))
                remembered.append(after)
            return Loads(force, torque, tuple(remembered), deepest)

        return loads

    return law


class Meeting(NamedTuple):
    """The geometry and motion of contacts at one moment; (S, N) for S slots."""

    overlap: Array  # d, negative where apart
    arm: Array  # from the centre to the middle of the overlap, m
    normal: Vector  # from the partner to the particle
    closing: Array  # d', m/s
    turning: Vector  # d normal/dt, 1/s
    twisting: Array  # mean spin of both about the normal, rad/s
    slip: Vector  # velocity of the surface along the partner's, m/s
    rolling: Vector  # spin relative to the partner's, without its part along the normal, rad/s


def _with_partners(
    displacement: Array, velocity: Array, spin: Array, neighbours: Neighbours, radius: Array
) -> Meeting:
    partner, present = neighbours.partner, neighbours.present

    def difference(components: Array) -> Vector:
        return tuple(component[None, :] - component[partner] for component in components)

    apart = plus(neighbours.separation, 1.0, difference(displacement))
    square = dot(apart, apart)
    distance = jnp.sqrt(jnp.where(present & (square > 0.0), square, 1.0))
    normal = times(1.0 / distance, apart)
    mine, theirs = radius[None, :], radius[partner]
    overlap = jnp.where(present, mine + theirs - distance, -mine)
    arm, their_arm = mine - 0.5 * overlap, theirs - 0.5 * overlap
    velocity = difference(velocity)
    closing = -dot(velocity, normal)
    along = plus(velocity, closing, normal)
    my_spin = tuple(component[None, :] for component in spin)
    their_spin = tuple(component[partner] for component in spin)
    of_surfaces = plus(times(arm, my_spin), their_arm, their_spin)
    relative = plus(my_spin, -1.0, their_spin)
    return Meeting(
        overlap,
        arm,
        normal,
        closing,
        times(1.0 / distance, along),
        0.5 * dot(plus(my_spin, 1.0, their_spin), normal),
        plus(along, -1.0, cross(of_surfaces, normal)),
        plus(relative, -dot(relative, normal), normal),
    )


def _with_walls(position: Array, velocity: Array, spin: Array, box: Box, radius: Array) -> Meeting:
    """The nearer wall of every walled axis, which mirrors the particle: the arm is R - d/2."""
    axes = np.array(box.walled_axes, int)
    size = jnp.asarray(box.size, radius.dtype)[axes, None]
    from_origin = position[axes]
    far = from_origin > 0.5 * size
    overlap = radius[None, :] - jnp.where(far, size - from_origin, from_origin)
    inward = jnp.where(far, -1.0, 1.0).astype(radius.dtype)
    normal = tuple(inward * (axes == along).astype(radius.dtype)[:, None] for along in range(3))
    arm = radius[None, :] - 0.5 * overlap
    velocity, spin = (tuple(part[None, :] for part in moving) for moving in (velocity, spin))
    closing = -dot(velocity, normal)
    along = plus(velocity, closing, normal)
    twisting = dot(spin, normal)
    return Meeting(
        overlap,
        arm,
        normal,
        closing,
        (jnp.zeros_like(overlap),) * 3,
        0.5 * twisting,
        plus(along, -1.0, times(arm, cross(spin, normal))),
        plus(spin, -twisting, normal),
    )


def _contact(
    meeting: Meeting, surfaces: Surfaces, memory: Memory, laws: Laws, time_step: float
) -> tuple[Vector, Vector | None, Memory]:
    """Force and torque on the particle in every slot, and what the contacts remember."""
    normal = meeting.normal
    push = contact.normal_force(
        meeting.overlap,
        meeting.closing,
        surfaces.modulus,
        surfaces.radius,
        surfaces.mass,
        surfaces.dissipation,
        surfaces.damping,
    )
    force, torque, slid, rolled = times(push, normal), None, memory.sliding, memory.rolling
    turn, twist = times(time_step, meeting.turning), time_step * meeting.twisting
    if laws.sliding:
        stretch = plus(history.turned(slid, normal, turn, twist), time_step, meeting.slip)
        grip, slid = friction.tangential_force(
            stretch,
            meeting.slip,
            meeting.overlap,
            push,
            shear_modulus=surfaces.shear_modulus,
            radius=surfaces.radius,
            mass=surfaces.mass,
            friction=surfaces.friction,
            dissipation=surfaces.tangential_dissipation,
            damping=surfaces.damping,
        )
        force = plus(force, 1.0, grip)
        torque = times(-meeting.arm, cross(normal, grip))
    if laws.rolling:
        roll = plus(history.turned(rolled, normal, turn, twist), time_step, meeting.rolling)
        resistance, rolled = rolling.rolling_torque(
            roll,
            meeting.rolling,
            meeting.overlap,
            push,
            modulus=surfaces.modulus,
            radius=surfaces.radius,
            inertia=surfaces.rolling_inertia,
            friction=surfaces.rolling_friction,
            damping=surfaces.rolling_damping,
        )
        torque = resistance if torque is None else plus(torque, 1.0, resistance)
    return force, torque, Memory(memory.partner, slid, rolled)


def _summed(vector: Vector) -> Array:
    return jnp.stack([jnp.sum(component, axis=0) for component in vector])
