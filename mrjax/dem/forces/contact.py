"""Contact: normal force, friction and rolling resistance of two surfaces (Son 2018, Eqs. 4-8).

The law is written for one pair, its vectors kept apart by component. The kernel sums it over all
pairs of a list, each once. Its forces are terms of Eqs. 1, 2 and 19.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.core import Tracer

from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.dem.contact_history import PairHistory, rotate_into_tangent_plane
from mrjax.dem.forces.kinematics import (
    PairKinematics,
    ParticleState,
    pair_kinematics,
    separation,
    time_in_contact,
)
from mrjax.dem.forces.properties import PropertyArrays
from mrjax.dem.pairs import Pairs
from mrjax.kernel import pair_sum
from mrjax.laws import normal, particle, rolling, tangential
from mrjax.laws.effective import PairProperties
from mrjax.laws.particle import CoatedParticle
from mrjax.laws.vectors import Vector, cross, dot, plus, times


@dataclass(frozen=True)
class ActiveLaws:
    """The laws that a run needs; without friction there is no history."""

    sliding: bool
    rolling: bool
    damped: bool


def active_laws(parameters: Parameters) -> ActiveLaws:
    """The laws whose coefficient is not known to be zero, or whose derivative may be wanted."""

    def acts(coefficient: Array, idle: float = 0.0) -> bool:
        return isinstance(coefficient, Tracer) or bool(np.any(value_or_none(coefficient) != idle))

    return ActiveLaws(
        sliding=acts(parameters.friction),
        rolling=acts(parameters.rolling_friction),
        damped=acts(parameters.restitution, 1.0)
        or acts(parameters.dissipation)
        or acts(parameters.tangential_dissipation),
    )


class ContactForces(NamedTuple):
    """Contact forces and torques on every particle at one moment, and the contact history."""

    force: Array  # N, times the gain, (3, N)
    torque: Array  # N m, times the gain, (3, N)
    history: PairHistory
    deepest: Array  # overlap of each pair so far, m; (P,)


ContactLaw = Callable[[Array, Array, Array, PairHistory, Array, Array], ContactForces]


def contact_law(
    parameters: Parameters,
    *,
    laws: ActiveLaws,
    material: Array | None = None,
    coated: CoatedParticle | None = None,
    time_step: float = 1.0,
) -> Callable[[Pairs], ContactLaw]:
    """The contact law of a run, with all that does not change during it computed once.

    Args:
      parameters: in one coherent system of units.
      laws: those that act.
      material: of each particle, (N,); None where all are of one.
      coated: the coated particles; left out, of the parameters.
      time_step: by which the contacts' history advances at every evaluation.

    Returns:
      law(pairs) for the pairs of a list. It returns forces(displacement, velocity, spin, history,
      deepest, gains): displacements since the list was built, velocities and spins, (3, N) each,
      the history of the contacts, the deepest overlap of each pair before, (P,), and by what forces
      and torques are multiplied, (2,) or (2, N). Multiplied by the gains of a step they are what
      the step adds to velocities and spins, and reverse mode has no forces to keep.
    """
    known = particle.coated_particle(parameters) if coated is None else coated

    def law(pairs: Pairs) -> ContactLaw:
        properties = PropertyArrays.of_pairs(parameters, known, material, pairs)
        return _ContactsOfList(pairs, known.radius, properties, laws, time_step).forces

    return law


class _Particles(NamedTuple):
    """Operands of every particle."""

    displacement: Vector
    velocity: Vector
    spin: Vector
    radius: Array | None  # None where all are equal
    gains: Vector | None


class _Pairs(NamedTuple):
    """Operands of every pair."""

    separation: Vector  # when the list was built
    axis: Array
    properties: Vector | None  # None where equal for all, or for all of a kind


class _Shared(NamedTuple):
    """Operands of all pairs."""

    properties: Sequence[Vector]
    gains: Vector | None


class _Memory(NamedTuple):
    """Memory of every pair."""

    history: PairHistory
    deepest: Array


class _ContactsOfList:
    """The contact law on the pairs of one list."""

    def __init__(
        self,
        pairs: Pairs,
        radius: Array,
        properties: PropertyArrays,
        laws: ActiveLaws,
        time_step: float,
    ) -> None:
        self.pairs, self.properties = pairs, properties
        self.laws, self.time_step = laws, time_step
        self.radius = radius if jnp.ndim(radius) else None
        self.separation = jnp.stack(pairs.separation)

    def forces(
        self,
        displacement: Array,
        velocity: Array,
        spin: Array,
        history: PairHistory,
        deepest: Array,
        gains: Array,
    ) -> ContactForces:
        """Forces and torques at one moment, and what the contacts remember of it."""
        alike = gains.ndim == 1
        sums, memory = pair_sum(
            self._law,
            self._touch,
            self.pairs.first,
            self.pairs.second,
            self.pairs.count,
            particles=_Particles(
                displacement, velocity, spin, self.radius, None if alike else gains
            ),
            pairs=_Pairs(self.separation, self.pairs.axis, self.properties.by_pair),
            memory=_Memory(history, deepest),
            shared=_Shared(self.properties.shared, gains if alike else None),
            lasting=_Memory(False, True),  # type: ignore[arg-type] # a truth for each
        )
        torque = sums["torque"] if "torque" in sums else jnp.zeros_like(sums["force"])
        return ContactForces(sums["force"], torque, *memory)

    def _state(self, operands: _Particles, shared: _Shared) -> ParticleState:
        """One of the two surfaces."""
        displacement, velocity, spin, radius, gains = operands
        if radius is None:
            radius = self.properties.equal_radius(shared.properties)
        multiplied = shared.gains if gains is None else gains
        assert multiplied is not None  # by every particle or by all
        return ParticleState(displacement, velocity, spin, radius, multiplied)

    def _touch(
        self, first: _Particles, second: _Particles, pair: _Pairs, shared: _Shared, _: _Memory
    ) -> Array:
        """True if the surfaces overlap."""
        particle, partner = self._state(first, shared), self._state(second, shared)
        between = separation(particle, partner, pair.separation, pair.axis)
        reach = particle.radius + jnp.where(pair.axis < 0, partner.radius, 0.0)
        return dot(between, between) < reach**2

    def _law(
        self, first: _Particles, second: _Particles, pair: _Pairs, shared: _Shared, memory: _Memory
    ) -> tuple[dict[str, Vector], dict[str, Vector], _Memory]:
        """Force and torque of a pair on both particles, times their gains, and its new memory."""
        particle, partner = self._state(first, shared), self._state(second, shared)
        properties = self.properties.of_pair(shared.properties, pair.properties, pair.axis)
        kinematics = pair_kinematics(particle, partner, pair.separation, pair.axis)
        force, torques, history = contact_force(
            kinematics, properties, memory.history, self.laws, self.time_step
        )
        on_particle = {"force": times(particle.gains[0], force)}
        on_partner = {"force": times(-partner.gains[0], force)}
        if torques:
            on_particle["torque"] = times(particle.gains[1], torques[0])
            on_partner["torque"] = times(partner.gains[1], torques[1])
        # Recorded for the observer: no force reads it.
        deepest = lax.stop_gradient(jnp.maximum(memory.deepest, kinematics.overlap))
        return on_particle, on_partner, _Memory(history, deepest)


def contact_force(
    pair: PairKinematics,
    properties: PairProperties,
    history: PairHistory,
    laws: ActiveLaws,
    time_step: float,
) -> tuple[Vector, tuple[Vector, Vector] | tuple[()], PairHistory]:
    """Force on the particle of a pair, torques on both, and the new history.

    Args:
      pair: geometry and relative motion.
      properties: effective properties of the two surfaces.
      history: displacements of the contact before this step.
      laws: those that act.
      time_step: s.

    Returns:
      the force, N; the torques on particle and partner about their centres, N m, none without
      friction and rolling resistance; the history.
    """
    normal_force = normal.normal_force(
        pair.overlap,
        pair.normal_velocity,
        properties.modulus,
        properties.radius,
        properties.mass,
        properties.dissipation,
        properties.damping,
        damped=laws.damped,
    )
    force, sliding, rolled = times(normal_force, pair.normal), history.sliding, history.rolling
    torques: tuple[Vector, Vector] | tuple[()] = ()
    rotation = times(time_step, pair.normal_rotation_rate), time_step * pair.torsion_rate
    duration = time_in_contact(pair, time_step)
    if sliding is not None:
        turned = rotate_into_tangent_plane(sliding, pair.normal, *rotation)
        tangential_force, sliding = tangential.tangential_force(
            plus(turned, duration, pair.slip),
            pair.slip,
            pair.overlap,
            normal_force,
            shear_modulus=properties.shear_modulus,
            radius=properties.radius,
            mass=properties.mass,
            friction=properties.friction,
            dissipation=properties.tangential_dissipation,
            damping=properties.damping,
            damped=laws.damped,
        )
        force = plus(force, 1.0, tangential_force)
        moment = cross(pair.normal, tangential_force)
        torques = times(-pair.lever_arm, moment), times(-pair.partner_lever_arm, moment)
    if rolled is not None:
        turned = rotate_into_tangent_plane(rolled, pair.normal, *rotation)
        resistance, rolled = rolling.rolling_torque(
            plus(turned, duration, pair.rolling),
            pair.rolling,
            pair.overlap,
            normal_force,
            modulus=properties.modulus,
            radius=properties.radius,
            inertia=properties.rolling_inertia,
            friction=properties.rolling_friction,
            damping=properties.rolling_damping,
        )
        on_particle, on_partner = torques or ((0.0,) * 3,) * 2
        torques = plus(on_particle, 1.0, resistance), plus(on_partner, -1.0, resistance)
    return force, torques, PairHistory(sliding, rolled)
