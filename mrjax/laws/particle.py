"""The coated particle: its size, masses and weight (Son 2018, Eqs. 3, 9, 11, 20-23).

The only reader of `f_r`. Every function takes `Parameters` and returns shape () or (N,).
"""

from typing import NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.parameters import Parameters

ScalarT = TypeVar("ScalarT", float, Array)
"""Plain numbers of a lab sheet, or arrays of a run."""


class CoatedParticle(NamedTuple):
    """Radius and inertia of the coated particles; () or (N,)."""

    radius: Array  # f_r R, m
    inertia: Array  # mass and added mass, kg
    moment_of_inertia: Array  # kg m^2


def coated_particle(parameters: Parameters) -> CoatedParticle:
    """Radius and inertia of the coated particles, which a run computes once."""
    return CoatedParticle(
        outer_radius(parameters), inertia(parameters), moment_of_inertia(parameters)
    )


def outer_radius(parameters: Parameters) -> Array:
    """f_r R, where fluid and other particles begin; m."""
    return parameters.f_r * parameters.radius


def typical_diameter(radius: np.ndarray) -> float:
    """Diameter of the sphere of mean volume; in the unit of the radii, () or (N,)."""
    return 2.0 * float(np.mean(radius**3)) ** (1 / 3)


def core_volume(parameters: Parameters) -> Array:
    """V = 4/3 pi R^3 of the uncoated particle; m^3."""
    return 4.0 / 3.0 * jnp.pi * parameters.radius**3


def mass_over_core_volume(
    particle_density: ScalarT, coating_density: ScalarT, radius_factor: ScalarT
) -> ScalarT:
    """rho_p + rho_c (f_r^3 - 1) of core and shell together (Eq. 20); kg/m^3."""
    return particle_density + coating_density * (radius_factor**3 - 1.0)


def mass(parameters: Parameters) -> Array:
    """Eq. 20: m = (rho_p + rho_c (f_r^3 - 1)) V; kg."""
    return mass_over_core_volume(
        parameters.particle_density, parameters.coating_density, parameters.f_r
    ) * core_volume(parameters)


def displaced_mass(parameters: Parameters) -> Array:
    """rho_f f_r^3 V, the fluid whose place the coated particle takes; kg."""
    return parameters.fluid_density * parameters.f_r**3 * core_volume(parameters)


def apparent_density(parameters: Parameters) -> Array:
    """Mass of the coated particle over its volume; kg/m^3. The rho_c that Eq. 27 needs."""
    return mass(parameters) / (parameters.f_r**3 * core_volume(parameters))


def inertia(parameters: Parameters) -> Array:
    """M + m_a of Eqs. 2 and 19, with the added mass of Eqs. 11 and 21; kg."""
    return mass(parameters) + parameters.added_mass * displaced_mass(parameters)


def moment_of_inertia(parameters: Parameters) -> Array:
    """8/15 pi (rho_p + rho_c (f_r^5 - 1)) R^5 of core and shell about the centre; kg m^2.

    A sphere that spins carries no fluid along: there is no added moment of inertia.
    """
    shell = parameters.coating_density * (parameters.f_r**5 - 1.0)
    return 8.0 / 15.0 * jnp.pi * (parameters.particle_density + shell) * parameters.radius**5


def coating_thickness(parameters: Parameters) -> Array:
    """(f_r - 1) R, of the layer on the core; m."""
    return (parameters.f_r - 1.0) * parameters.radius


def rises(parameters: Parameters) -> Array:
    """True if the net weights of all particles together point upwards, (): they cream."""
    return jnp.sum(net_weight(parameters)) < 0.0


def net_weight(parameters: Parameters) -> Array:
    """Weight less buoyancy (Eqs. 22 and 23), downwards; N.

    The paper labels Eq. 9 F_G and gives it the sign of a weight; buoyancy acts against gravity,
    as Eq. 23 has it.
    """
    return (mass(parameters) - displaced_mass(parameters)) * parameters.gravity
