"""The sum of forces and torques on every particle, all but the drag (Son 2018, Eqs. 2 and 19).

The drag is linear in velocity and spin, and integrated exactly by the leapfrog. Arrays are kept
apart by component, (P,) for the P possible contacts, each once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.core import Tracer

from mrjax import contact, friction, history, particle, rolling, surfaces
from mrjax.concrete import concrete
from mrjax.history import Memory
from mrjax.pairs import Pairs
from mrjax.parameters import Parameters, per_particle
from mrjax.surfaces import Surfaces
from mrjax.vectors import Vector, cross, dot, plus, times


@dataclass(frozen=True)
class Laws:
    """Which laws a run needs; without friction there is nothing to remember."""

    sliding: bool
    rolling: bool
    damped: bool


def laws(parameters: Parameters) -> Laws:
    """Those whose coefficient is not known to be zero, or whose derivative may be wanted."""

    def acts(coefficient: Array, idle: float = 0.0) -> bool:
        return isinstance(coefficient, Tracer) or bool((concrete(coefficient) != idle).any())

    return Laws(
        sliding=acts(parameters.friction),
        rolling=acts(parameters.rolling_friction),
        damped=acts(parameters.restitution, 1.0)
        or acts(parameters.dissipation)
        or acts(parameters.tangential_dissipation),
    )


class Loads(NamedTuple):
    """What acts on every particle at one moment."""

    force: Array  # N, (3, N)
    torque: Array  # N m, (3, N)
    memory: Memory
    overlap: Array  # of the contacts, m; negative where apart; (P,)


Law = Callable[[Array, Array, Array, Memory], Loads]


def total(
    parameters: Parameters,
    particles: int,
    *,
    laws: Laws,
    material: Array | None = None,
    time_step: float = 1.0,
) -> Callable[[Pairs], Law]:
    """The force law of a run, with all that does not change during it computed once.

    Args:
      parameters: in one coherent system of units.
      particles: N.
      laws: those that act.
      material: of each particle, (N,); None where all are of one.
      time_step: by which the contacts' memory advances at every evaluation.

    Returns:
      law(listed) for the pairs of a list. It returns loads(displacement, velocity, spin, memory):
      what has been travelled since it was built, velocities and spins, (3, N) each, and the memory
      of the contacts.
    """
    radius = per_particle(particle.outer_radius(parameters), particles)
    weight = per_particle(particle.net_weight(parameters), particles)
    pull = jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])

    def law(listed: Pairs) -> Law:
        constants = surfaces.of(parameters, material, listed)

        def loads(displacement, velocity, spin, memory: Memory) -> Loads:
            meeting = _meeting(displacement, velocity, spin, listed, radius)
            acting, turning, memory = _contact(meeting, constants, memory, laws, time_step)
            force = pull + jnp.stack([listed.opposed(part) for part in acting])
            torque = jnp.zeros_like(force)
            if turning is not None:
                torque = jnp.stack([listed.summed(*of) for of in zip(*turning, strict=True)])
            return Loads(force, torque, memory, meeting.overlap)

        return loads

    return law


class Meeting(NamedTuple):
    """The geometry and motion of the contacts at one moment; (P,) each."""

    overlap: Array  # d, negative where apart
    arm: Array  # from the centre to the middle of the overlap, m
    their_arm: Array  # from the partner's, m
    normal: Vector  # from the partner to the particle
    closing: Array  # d', m/s
    turning: Vector  # d normal/dt, 1/s
    twisting: Array  # mean spin of both about the normal, rad/s
    slip: Vector  # velocity of the surface along the partner's, m/s
    rolling: Vector  # spin relative to the partner's, without its part along the normal, rad/s


def _meeting(
    displacement: Array, velocity: Array, spin: Array, listed: Pairs, radius: Array
) -> Meeting:
    """A wall mirrors the particle: the arm is R - d/2, and the normal does not turn."""
    apart = listed.separated(displacement)
    square = dot(apart, apart)
    distance = jnp.sqrt(jnp.where(listed.present & (square > 0.0), square, 1.0))
    normal = times(1.0 / distance, apart)
    mine, theirs = radius[listed.first], radius[listed.second]
    turns = 1.0 / distance
    if listed.wall is not None:
        theirs = jnp.where(listed.wall, 0.0, theirs)
        turns = jnp.where(listed.wall, 0.0, turns)
    overlap = jnp.where(listed.present, mine + theirs - distance, -mine)
    arm, their_arm = mine - 0.5 * overlap, theirs - 0.5 * overlap
    velocity = listed.difference(velocity)
    closing = -dot(velocity, normal)
    along = plus(velocity, closing, normal)
    my_spin, their_spin = listed.of_both(spin)
    of_surfaces = plus(times(arm, my_spin), their_arm, their_spin)
    relative = plus(my_spin, -1.0, their_spin)
    return Meeting(
        overlap,
        arm,
        their_arm,
        normal,
        closing,
        times(turns, along),
        0.5 * dot(plus(my_spin, 1.0, their_spin), normal),
        plus(along, -1.0, cross(of_surfaces, normal)),
        plus(relative, -dot(relative, normal), normal),
    )


def _time_in_contact(meeting: Meeting, time_step: float) -> Array:
    """For how long of the last step the surfaces touched: all of it, or since they met; (P,).

    A spring that stretched by the slip of the whole step in which they met would be flat in the
    moment at which they did, and so would all that follows: its derivative would miss a share that
    does not vanish with the step.
    """
    approach = jnp.maximum(time_step * meeting.closing, meeting.overlap)
    met = meeting.overlap > 0.0
    return time_step * jnp.where(met, meeting.overlap / jnp.where(met, approach, 1.0), 1.0)


def _contact(
    meeting: Meeting, surfaces: Surfaces, memory: Memory, laws: Laws, time_step: float
) -> tuple[Vector, tuple[Vector, Vector] | None, Memory]:
    """Force on the particle of every contact, torques on both, and what the contacts remember."""
    normal = meeting.normal
    push = contact.normal_force(
        meeting.overlap,
        meeting.closing,
        surfaces.modulus,
        surfaces.radius,
        surfaces.mass,
        surfaces.dissipation,
        surfaces.damping,
        damped=laws.damped,
    )
    force, torque, slid, rolled = times(push, normal), None, memory.sliding, memory.rolling
    turn, twist = times(time_step, meeting.turning), time_step * meeting.twisting
    touching = _time_in_contact(meeting, time_step)
    if laws.sliding:
        stretch = plus(history.turned(slid, normal, turn, twist), touching, meeting.slip)
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
            damped=laws.damped,
        )
        force = plus(force, 1.0, grip)
        lever = cross(normal, grip)
        torque = times(-meeting.arm, lever), times(-meeting.their_arm, lever)
    if laws.rolling:
        roll = plus(history.turned(rolled, normal, turn, twist), touching, meeting.rolling)
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
        mine, theirs = torque or ((0.0,) * 3,) * 2
        torque = plus(mine, 1.0, resistance), plus(theirs, -1.0, resistance)
    return force, torque, Memory(slid, rolled)
