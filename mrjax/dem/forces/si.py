"""Conversion of forces written in SI to the reduced units of a run."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.core.units import Units
from mrjax.dem.contact_history import Remembered
from mrjax.dem.forces.force import (
    BodyForce,
    Force,
    Memory,
    Noise,
    PairForce,
    Particles,
    Stiffness,
    Wrench,
)
from mrjax.dem.kinematics import PairKinematics
from mrjax.laws import particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import Vector, times


def in_reduced_units(force: Force, units: Units) -> Force:
    """Converts a force to the reduced units of a run."""
    if not force.in_si:
        return force.reduced(units)
    scales = Scales(units.mass, units.length, units.time)
    if isinstance(force, PairForce):
        return ConvertedPairForce(force, scales)
    if isinstance(force, Noise):
        return ConvertedNoise(force, scales)
    assert isinstance(force, BodyForce)
    return ConvertedBodyForce(force, scales)


class Scales(NamedTuple):
    """SI values of the reduced units, as leaves of a force."""

    mass: ArrayLike  # kg
    length: ArrayLike  # m
    time: ArrayLike  # s

    @property
    def velocity(self) -> ArrayLike:
        """Unit of velocity, m/s."""
        return self.length / self.time

    @property
    def force(self) -> ArrayLike:
        """Unit of force, N."""
        return self.mass * self.length / self.time**2

    def parameters(self, parameters: Parameters) -> Parameters:
        """Converts parameters to SI."""
        inverse = Units(1.0 / self.mass, 1.0 / self.length, 1.0 / self.time)
        return parameters.reduced(inverse)

    def particles(self, particles: Particles) -> Particles:
        """Converts positions, velocities and spins to SI; the memory is in SI."""
        return Particles(
            self.length * particles.position,
            self.velocity * particles.velocity,
            particles.spin / self.time,
            particles.memory,
        )

    def kinematics(self, pair: PairKinematics) -> PairKinematics:
        """Converts kinematics to SI."""
        length, velocity, rate = self.length, self.velocity, 1.0 / self.time
        return PairKinematics(
            overlap=length * pair.overlap,
            lever_arm=length * pair.lever_arm,
            partner_lever_arm=length * pair.partner_lever_arm,
            normal=pair.normal,
            normal_velocity=velocity * pair.normal_velocity,
            normal_rotation_rate=times(rate, pair.normal_rotation_rate),
            torsion_rate=rate * pair.torsion_rate,
            slip=times(velocity, pair.slip),
            rolling=times(rate, pair.rolling),
        )


class ConvertedPairForce(PairForce):
    """Wraps a pair force that is written in SI; the contact history stays in SI."""

    force: PairForce
    scales: Scales

    @property
    def greatest_overlap(self) -> float:  # type: ignore[override] # of the force
        """Largest valid overlap of the wrapped force, in radii."""
        return self.force.greatest_overlap

    def coefficients(self, parameters: Parameters, surfaces: SurfacePairs) -> Any:
        """Coefficients of the wrapped force, in SI."""
        parameters = self.scales.parameters(parameters)
        coated = particle.coated_particle(parameters)
        return self.force.coefficients(parameters, surfaces._replace(coated=coated))

    def alike(self, parameters: Parameters, material: Array | None) -> bool:
        """True if the wrapped force has the same coefficients for all pairs of a kind."""
        return self.force.alike(parameters, material)

    def memory(self) -> dict[str, Remembered]:
        """History of the wrapped force, marked as dimensionless so that it is not converted."""
        return {name: kind._replace(unit="1") for name, kind in self.force.memory().items()}

    def __call__(
        self, pair: PairKinematics, coefficients: Any, memory: Memory, time_step: ArrayLike
    ) -> tuple[Wrench, Memory]:
        """Returns the force of one pair in reduced units, and its new history in SI."""
        time = self.scales.time * time_step
        wrench, memory = self.force(self.scales.kinematics(pair), coefficients, memory, time)
        return _reduced(wrench, self.scales), memory

    def stiffness(self, pair: PairKinematics, coefficients: Any, time_step: ArrayLike) -> Stiffness:
        """Springs and dashpots of the wrapped force, in reduced units."""
        scales = self.scales
        unit = scales.mass / scales.time
        normal, tangential = self.force.stiffness(
            scales.kinematics(pair), coefficients, scales.time * time_step
        )
        return Stiffness(normal / unit, tangential / unit)


class ConvertedBodyForce(BodyForce):
    """Wraps a body force that is written in SI."""

    force: BodyForce
    scales: Scales

    @property
    def steady(self) -> bool:  # type: ignore[override] # of the force
        """True if the wrapped force is steady."""
        return self.force.steady

    def __call__(self, parameters: Parameters, particles: Particles) -> Wrench:
        """Returns the force on every particle, in reduced units."""
        scales = self.scales
        in_si = scales.particles(particles)
        return _reduced(self.force(scales.parameters(parameters), in_si), scales)

    def memory(self) -> dict[str, Remembered]:
        """Memory of the wrapped force, marked as dimensionless so that it is not converted."""
        return {name: kind._replace(unit="1") for name, kind in self.force.memory().items()}

    def moved(
        self, parameters: Parameters, particles: Particles, time: float
    ) -> Mapping[str, Array]:
        """Returns the memory of the wrapped force after a time in reduced units; in SI."""
        scales = self.scales
        in_si = scales.particles(particles)
        return self.force.moved(scales.parameters(parameters), in_si, scales.time * time)


class ConvertedNoise(Noise):
    """Wraps a random force that is written in SI."""

    force: Noise
    scales: Scales

    def __call__(self, parameters: Parameters, numbers: Array, time_step: ArrayLike) -> Wrench:
        """Returns the random force on every particle, in reduced units."""
        scales = self.scales
        wrench = self.force(scales.parameters(parameters), numbers, scales.time * time_step)
        return _reduced(wrench, scales)


def _reduced(wrench: Wrench, scales: Scales) -> Wrench:
    """Converts forces and torques from SI to reduced units."""

    def over(unit: ArrayLike, vector: Vector | None) -> Vector | None:
        return None if vector is None else times(1.0 / unit, vector)

    force, torque = scales.force, scales.force * scales.length
    return Wrench(
        times(1.0 / force, wrench.force),
        over(torque, wrench.torque),
        over(torque, wrench.partner_torque),
    )
