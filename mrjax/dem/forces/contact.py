"""Contact: normal force, friction and rolling resistance of two surfaces (Son 2018, Eqs. 4-8).

    F = F_n n + F_t,    M = -a n x F_t + M_r

Here a is the lever arm, from the centre to the middle of the overlap. The forces are terms of
Eqs. 1, 2 and 19. The laws are in `mrjax.laws.normal`, `tangential` and `rolling`.

With attraction the net normal force is N = F_n - F_c, and the limits of friction and rolling
resistance are mu (N + 2 F_c) and mu_r R* (N + 2 F_c) (Thornton 1991).
"""

from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Self

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.dem.contact_history import Remembered, rotate_into_tangent_plane
from mrjax.dem.forces.force import Memory, PairForce, Stiffness, Wrench
from mrjax.dem.forces.van_der_waals import VanDerWaals
from mrjax.dem.kinematics import PairKinematics, time_in_contact
from mrjax.laws import attraction, effective, normal, rolling, tangential
from mrjax.laws.effective import PairProperties, SurfacePairs
from mrjax.laws.vectors import Vector, cross, plus, times


@dataclass(frozen=True)
class ActiveLaws:
    """Selects the contact laws of a run; without friction there is no contact history."""

    sliding: bool
    rolling: bool
    damped: bool
    attraction: str | None = None
    """Law of attraction, whose pull-off force the limits of friction and rolling include."""


def acts(coefficient: ArrayLike | None, idle: float = 0.0) -> bool:
    """True if a coefficient is traced, or is not known to have its value without effect.

    One that is missing, None, has no effect.
    """
    if coefficient is None:
        return False
    return isinstance(coefficient, Tracer) or bool(np.any(value_or_none(coefficient) != idle))


def active_laws(parameters: Parameters) -> ActiveLaws:
    """Selects the laws whose coefficients are traced, or are not known to have no effect."""
    return ActiveLaws(
        sliding=acts(parameters.friction),
        rolling=acts(parameters.rolling_friction),
        damped=acts(parameters.restitution, 1.0)
        or acts(parameters.dissipation)
        or acts(parameters.tangential_dissipation),
    )


class Contact(PairForce):
    """Contact after Hertz and Mindlin, with Coulomb friction, dashpots and rolling resistance.

    Its coefficients are those of `Parameters`: moduli, friction, restitution, dissipation and
    rolling friction.
    """

    laws: ActiveLaws = field(
        default=ActiveLaws(sliding=True, rolling=True, damped=True), metadata={"static": True}
    )
    """Laws that act; a run leaves out laws whose coefficients are zero."""

    greatest_overlap = 0.25
    in_si = False

    def active(self, parameters: Parameters) -> Self:
        """Returns the force without the laws whose coefficients are known to be zero."""
        return type(self)(active_laws(parameters))

    def with_attraction(self, law: str) -> Self:
        """Returns the force with the pull-off force of a law in the limits of friction."""
        return type(self)(replace(self.laws, attraction=law))

    def apart(self) -> Self:
        """Returns the force without friction, damping and history, to compile less code."""
        return type(self)(ActiveLaws(sliding=False, rolling=False, damped=False))

    def coefficients(self, parameters: Parameters, surfaces: SurfacePairs) -> PairProperties:
        """Effective constants E*, G*, R* and m* of pairs, and coefficients from material tables.

        Args:
          parameters: parameters of the run.
          surfaces: surfaces of the pairs.
        """
        properties = effective.of_surfaces(parameters, surfaces)
        law = self.laws.attraction
        if law is None:
            return properties
        return properties._replace(pull_off=attraction.pull_off(parameters, surfaces, law))

    def alike(self, parameters: Parameters, material: Array | None) -> bool:
        """True if all particles have the same material, size and mass.

        Args:
          parameters: parameters of the run.
          material: material index of each particle, (N,); None if all have the same material.
        """
        if self.laws.attraction is not None:
            return VanDerWaals().alike(parameters, material)
        return effective.alike(parameters, material)

    def memory(self) -> dict[str, Remembered]:
        """Contact history: displacement along the partner's surface, and angle rolled on it."""
        sliding = {"sliding": Remembered(3, "m")} if self.laws.sliding else {}
        return sliding | ({"rolling": Remembered(3, "rad")} if self.laws.rolling else {})

    def __call__(
        self,
        pair: PairKinematics,
        coefficients: PairProperties,
        memory: Memory,
        time_step: ArrayLike,
    ) -> tuple[Wrench, Memory]:
        """Force and torques by Eqs. 4 and 7 with rolling resistance, and the new history."""
        properties, new = coefficients, {}
        normal_force = normal.normal_force(
            pair.overlap,
            pair.normal_velocity,
            properties.modulus,
            properties.radius,
            properties.mass,
            properties.dissipation,
            properties.damping,
            damped=self.laws.damped,
        )
        force: Vector = times(normal_force, pair.normal)
        pressing_force = normal_force
        law, pull_off = self.laws.attraction, properties.pull_off
        if law is not None and pull_off is not None:
            attracting = attraction.attraction_in_contact(
                law, pair.overlap, pull_off, properties.modulus, properties.radius
            )
            net_force = normal_force - attracting
            pressing_force = jnp.where(pair.overlap > 0.0, net_force + 2.0 * pull_off, 0.0)
        torques: tuple[Vector, Vector] | tuple[None, None] = (None, None)
        rotation = times(time_step, pair.normal_rotation_rate), time_step * pair.torsion_rate
        duration = time_in_contact(pair, time_step)
        if self.laws.sliding:
            turned = rotate_into_tangent_plane(memory["sliding"], pair.normal, *rotation)
            tangential_force, new["sliding"] = tangential.tangential_force(
                plus(turned, duration, pair.slip),
                pair.slip,
                pair.overlap,
                pressing_force,
                shear_modulus=properties.shear_modulus,
                radius=properties.radius,
                mass=properties.mass,
                friction=properties.friction,
                dissipation=properties.tangential_dissipation,
                damping=properties.damping,
                damped=self.laws.damped,
            )
            force = plus(force, 1.0, tangential_force)
            moment = cross(pair.normal, tangential_force)
            torques = times(-pair.lever_arm, moment), times(-pair.partner_lever_arm, moment)
        if self.laws.rolling:
            turned = rotate_into_tangent_plane(memory["rolling"], pair.normal, *rotation)
            resistance, new["rolling"] = rolling.rolling_torque(
                plus(turned, duration, pair.rolling),
                pair.rolling,
                pair.overlap,
                pressing_force,
                modulus=properties.modulus,
                radius=properties.radius,
                inertia=properties.rolling_inertia,
                friction=properties.rolling_friction,
                damping=properties.rolling_damping,
            )
            first, partner = ((0.0,) * 3 if side is None else side for side in torques)
            torques = plus(first, 1.0, resistance), plus(partner, -1.0, resistance)
        return Wrench(force, *torques), new

    def stiffness(
        self, pair: PairKinematics, coefficients: PairProperties, time_step: ArrayLike
    ) -> Stiffness:
        """Springs of Hertz and Mindlin with their dashpots; sliding contacts count as sticking.

        Args:
          pair: kinematics of the pair, of which only the overlap is used, m.
          coefficients: coefficients of the pair.
          time_step: length of a step, s.
        """
        properties, touching = coefficients, pair.overlap > 0.0
        depth = jnp.where(touching, pair.overlap, 1.0)

        def resolved(law: ModuleType, modulus: Array, dissipation: Array) -> Array:
            spring = law.stiffness(modulus, properties.radius, depth)
            dashpot = law.damping_coefficient(
                modulus, properties.radius, properties.mass, depth, dissipation, properties.damping
            )
            return jnp.where(touching, time_step * spring + 2.0 * dashpot, 0.0)

        in_normal = resolved(normal, properties.modulus, properties.dissipation)
        if not self.laws.sliding:
            return Stiffness(in_normal)
        dissipation = properties.tangential_dissipation
        return Stiffness(in_normal, resolved(tangential, properties.shear_modulus, dissipation))
