"""Forces and torques on every particle, all but the drag (Son 2018, Eqs. 1, 2 and 19).

Of Eq. 1 the magnetic and the weak forces are left out, as in the paper. The drag is linear in
velocity and spin, and integrated exactly by the leapfrog. Arrays are kept
apart by component, (P,) for the P possible contacts, each once.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.core import Tracer

from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.tracing import value_or_none
from mrjax.dem import contact_history
from mrjax.dem.contact_history import PairHistory
from mrjax.dem.pairs import Pairs
from mrjax.kernel.operation import pairwise
from mrjax.laws import effective, particle, rolling, tangential
from mrjax.laws.effective import PairProperties
from mrjax.laws.normal import LEAST_DISTANCE, normal_force
from mrjax.laws.vectors import Vector, cross, dot, plus, times


@dataclass(frozen=True)
class Laws:
    """Which laws a run needs; without friction there is nothing to remember."""

    sliding: bool
    rolling: bool
    damped: bool


def laws(parameters: Parameters) -> Laws:
    """Those whose coefficient is not known to be zero, or whose derivative may be wanted."""

    def acts(coefficient: Array, idle: float = 0.0) -> bool:
        return isinstance(coefficient, Tracer) or bool(np.any(value_or_none(coefficient) != idle))

    return Laws(
        sliding=acts(parameters.friction),
        rolling=acts(parameters.rolling_friction),
        damped=acts(parameters.restitution, 1.0)
        or acts(parameters.dissipation)
        or acts(parameters.tangential_dissipation),
    )


def net_weight(parameters: Parameters, particles: int) -> Array:
    """Weight less buoyancy of every particle, N; (3, N)."""
    weight = per_particle(particle.net_weight(parameters), particles)
    return jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])


class ContactForces(NamedTuple):
    """What its contacts do to every particle at one moment."""

    force: Array  # N, times the gain, (3, N)
    torque: Array  # N m, times the gain, (3, N)
    memory: PairHistory
    deepest: Array  # overlap of each pair so far, m; (P,)


Law = Callable[[Array, Array, Array, PairHistory, Array, Array], ContactForces]


def of_contacts(
    parameters: Parameters,
    *,
    laws: Laws,
    material: Array | None = None,
    time_step: float = 1.0,
) -> Callable[[Pairs], Law]:
    """The law of contacts of a run, with all that does not change during it computed once.

    Args:
      parameters: in one coherent system of units.
      laws: those that act.
      material: of each particle, (N,); None where all are of one.
      time_step: by which the contacts' memory advances at every evaluation.

    Returns:
      law(listed) for the pairs of a list. It returns loads(displacement, velocity, spin, memory,
      deepest, gains): what has been travelled since it was built, velocities and spins, (3, N)
      each, the memory of the contacts, the deepest overlap of each pair before, (P,), and by what
      forces and torques are multiplied, (2,) or (2, N). By the gains of a step they are what it
      adds to velocities and spins, and reverse mode has no forces to keep.
    """
    radius = particle.outer_radius(parameters)

    def remembered(values: Iterator) -> PairHistory:
        return PairHistory(
            *(next(values) if acts else None for acts in (laws.sliding, laws.rolling))
        )

    def law(listed: Pairs) -> Law:
        kinds = effective.per_kind(parameters, material, listed.wall is not None)
        constants = (
            effective.per_pair(parameters, material, *listed.surfaces) if kinds is None else kinds
        )
        each = [i for i, constant in enumerate(constants) if jnp.ndim(constant)]
        same = [i for i in range(len(constants)) if i not in each]
        differing = [jnp.stack([constants[i] for i in each])] if each else []
        by_pair, by_kind = differing, []
        if kinds is not None:
            by_pair, by_kind = [], [row for rows in differing for row in rows.T]
        alike = [constants[i] for i in same] + ([] if jnp.ndim(radius) else [radius])
        of_all = [*by_kind, *([jnp.stack(alike)] if alike else [])]
        separation = jnp.stack(listed.separation)

        def body(own: list, common: list) -> ParticleState:
            displacement, velocity, spin, *left = own
            its_radius = left.pop(0) if jnp.ndim(radius) else common[len(by_kind)][-1]
            return ParticleState(
                displacement, velocity, spin, its_radius, left[0] if left else common[-1]
            )

        def touching(first: list, second: list, pair: list, common: list) -> Array:
            mine, theirs = body(first, common), body(second, common)
            between = separation_of(mine, theirs, *pair[:2])
            reach = mine.radius + jnp.where(pair[1] < 0, theirs.radius, 0.0)
            return dot(between, between) < reach**2

        def acting(first: list, second: list, pair: list, common: list):
            mine, theirs = body(first, common), body(second, common)
            left = iter(pair[2:])
            memory, deepest = remembered(left), next(left)
            values = dict(zip(same, common[len(by_kind)], strict=False)) if same else {}
            own = next(left, ()) if kinds is None else _of_kind(pair[1], *common[: len(by_kind)])
            values |= dict(zip(each, own, strict=True))
            of_pair = PairProperties(*(values[i] for i in range(len(constants))))
            meeting = pair_kinematics(mine, theirs, *pair[:2])
            force, torques, new = _contact(meeting, of_pair, memory, laws, time_step)
            to_first, to_second = [times(mine.gains[0], force)], [times(-theirs.gains[0], force)]
            if torques:
                to_first.append(times(mine.gains[1], torques[0]))
                to_second.append(times(theirs.gains[1], torques[1]))
            kept = [of for of in (new.sliding, new.rolling) if of is not None]
            # To look at: no force reads it.
            deepest = lax.stop_gradient(jnp.maximum(deepest, meeting.overlap))
            return to_first, to_second, [*kept, deepest]

        def loads(displacement, velocity, spin, memory: PairHistory, deepest: Array, gains: Array):
            before = [of for of in (memory.sliding, memory.rolling) if of is not None]
            of_each = [
                *([radius] if jnp.ndim(radius) else []),
                *([gains] if gains.ndim == 2 else []),
            ]
            (force, *torque), kept = pairwise(
                acting,
                touching,
                listed,
                [displacement, velocity, spin, *of_each],
                [separation, listed.axis, *before, deepest, *by_pair],
                [*of_all, *([gains] if gains.ndim == 1 else [])],
                replaced=range(2, 3 + len(before)),
                lasting=1,
            )
            left = iter(kept)
            turning = torque[0] if torque else jnp.zeros_like(force)
            return ContactForces(force, turning, remembered(left), next(left))

        return loads

    return law


def _of_kind(axis: Array, *kinds: tuple[Array, ...]) -> tuple[Array, ...]:
    """The constants of a contact of two particles, or with a wall, whose normal has an axis."""
    if len(kinds) < 2:
        return kinds[0] if kinds else ()
    return tuple(jnp.where(axis < 0, of, at_wall) for of, at_wall in zip(*kinds, strict=True))


class ParticleState(NamedTuple):
    """One of the two that meet; a wall moves nowhere."""

    displacement: Vector  # since the list was built
    velocity: Vector  # m/s
    spin: Vector  # rad/s
    radius: Array  # m
    gains: tuple[Array, Array]  # by what forces and torques are multiplied


class PairKinematics(NamedTuple):
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


def separation_of(
    mine: ParticleState, theirs: ParticleState, separation: Vector, axis: Array
) -> Vector:
    """From the partner to the particle; from a wall, at a right angle."""
    moved = plus(mine.displacement, -1.0, theirs.displacement)
    return tuple(
        then + jnp.where((axis < 0) | (axis == along), since, 0.0)
        for along, (then, since) in enumerate(zip(separation, moved, strict=True))
    )


def pair_kinematics(
    mine: ParticleState, theirs: ParticleState, separation: Vector, axis: Array
) -> PairKinematics:
    """How two bodies meet that may touch.

    Centres at one place overlap by the sum of their radii, and have no normal: they push nowhere.
    A wall mirrors the particle: the arm is R - d/2, and the normal does not turn.

    Args:
      mine, theirs: the bodies.
      separation: from the second to the first when the list was built.
      axis: of a wall's normal, 0 to 2; -1 where both are particles.
    """
    between = separation_of(mine, theirs, separation, axis)
    square = dot(between, between)
    least = LEAST_DISTANCE * mine.radius
    distance = jnp.sqrt(jnp.where(square > 0.0, square, least**2))
    normal = times(1.0 / distance, between)
    their_radius = jnp.where(axis < 0, theirs.radius, 0.0)
    turns = jnp.where(axis < 0, 1.0 / distance, 0.0)
    overlap = mine.radius + their_radius - distance
    arm, their_arm = mine.radius - 0.5 * overlap, their_radius - 0.5 * overlap
    velocity = plus(mine.velocity, -1.0, theirs.velocity)
    closing = -dot(velocity, normal)
    along = plus(velocity, closing, normal)
    of_surfaces = plus(times(arm, mine.spin), their_arm, theirs.spin)
    relative = plus(mine.spin, -1.0, theirs.spin)
    return PairKinematics(
        overlap,
        arm,
        their_arm,
        normal,
        closing,
        times(turns, along),
        0.5 * dot(plus(mine.spin, 1.0, theirs.spin), normal),
        plus(along, -1.0, cross(of_surfaces, normal)),
        plus(relative, -dot(relative, normal), normal),
    )


def _time_in_contact(meeting: PairKinematics, time_step: float) -> Array:
    """For how long of the last step the surfaces touched: all of it, or since they met; (P,).

    A spring that stretched by the slip of the whole step in which they met would be flat in the
    moment at which they did, and so would all that follows: its derivative would miss a share that
    does not vanish with the step.
    """
    approach = jnp.maximum(time_step * meeting.closing, meeting.overlap)
    met = meeting.overlap > 0.0
    return time_step * jnp.where(met, meeting.overlap / jnp.where(met, approach, 1.0), 1.0)


def _contact(
    meeting: PairKinematics,
    surfaces: PairProperties,
    memory: PairHistory,
    laws: Laws,
    time_step: float,
) -> tuple[Vector, tuple[Vector, Vector] | tuple[()], PairHistory]:
    """Force on the particle of every contact, torques on both, and what the contacts remember."""
    normal = meeting.normal
    push = normal_force(
        meeting.overlap,
        meeting.closing,
        surfaces.modulus,
        surfaces.radius,
        surfaces.mass,
        surfaces.dissipation,
        surfaces.damping,
        damped=laws.damped,
    )
    force, slid, rolled = times(push, normal), memory.sliding, memory.rolling
    torques: tuple[Vector, Vector] | tuple[()] = ()
    turn, twist = times(time_step, meeting.turning), time_step * meeting.twisting
    touching = _time_in_contact(meeting, time_step)
    if slid is not None:
        stretch = plus(
            contact_history.rotate_into_tangent_plane(slid, normal, turn, twist),
            touching,
            meeting.slip,
        )
        grip, slid = tangential.tangential_force(
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
        torques = times(-meeting.arm, lever), times(-meeting.their_arm, lever)
    if rolled is not None:
        roll = plus(
            contact_history.rotate_into_tangent_plane(rolled, normal, turn, twist),
            touching,
            meeting.rolling,
        )
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
        mine, theirs = torques or ((0.0,) * 3,) * 2
        torques = plus(mine, 1.0, resistance), plus(theirs, -1.0, resistance)
    return force, torques, PairHistory(slid, rolled)
