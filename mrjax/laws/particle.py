"""The coated particle: its size, masses and weight (Son 2018, Eqs. 3, 9, 11, 20-23).

No other module reads `f_r`. The functions take `Parameters` and return shape () or (N,).
"""

from typing import NamedTuple, TypeVar

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.parameters import Parameters

ScalarT = TypeVar("ScalarT", float, Array)
"""A plain number of a lab sheet, or an array of a run."""


class CoatedParticle(NamedTuple):
    """Radius, inertia and moment of inertia of the coated particles; () or (N,)."""

    radius: Array
    """Radius f_r R of the coated particle, m."""
    inertia: Array
    """Mass and added mass, kg."""
    moment_of_inertia: Array
    """Moment of inertia about the centre, kg m^2."""


def coated_particle(parameters: Parameters) -> CoatedParticle:
    """Returns the radius and inertia of the coated particles, which a run computes once."""
    return CoatedParticle(
        outer_radius(parameters), inertia(parameters), moment_of_inertia(parameters)
    )


def outer_radius(parameters: Parameters) -> Array:
    """Radius f_r R of the coated particle; m."""
    return parameters.f_r * parameters.radius


def typical_diameter(radius: np.ndarray) -> float:
    """Returns the diameter of the sphere of mean volume, in the unit of the radii, () or (N,)."""
    return 2.0 * float(np.mean(radius**3)) ** (1 / 3)


def core_volume(parameters: Parameters) -> Array:
    """Volume V = 4/3 pi R^3 of the uncoated particle; m^3."""
    return 4.0 / 3.0 * jnp.pi * parameters.radius**3


def mass_over_core_volume(
    particle_density: ScalarT, coating_density: ScalarT, radius_factor: ScalarT
) -> ScalarT:
    """Mass of core and coating over the volume of the core, rho_p + rho_c (f_r^3 - 1); kg/m^3."""
    return particle_density + coating_density * (radius_factor**3 - 1.0)


def mass(parameters: Parameters) -> Array:
    """Mass m = (rho_p + rho_c (f_r^3 - 1)) V of the coated particle (Eq. 20); kg."""
    return mass_over_core_volume(
        parameters.particle_density, parameters.coating_density, parameters.f_r
    ) * core_volume(parameters)


def displaced_mass(parameters: Parameters) -> Array:
    """Mass rho_f f_r^3 V of the fluid that the coated particle displaces; kg."""
    return parameters.fluid_density * parameters.f_r**3 * core_volume(parameters)


def apparent_density(parameters: Parameters) -> Array:
    """Mass of the coated particle over its volume, which stands for rho_c in Eq. 27; kg/m^3."""
    return mass(parameters) / (parameters.f_r**3 * core_volume(parameters))


def inertia(parameters: Parameters) -> Array:
    """Inertia m + m_a of Eqs. 2 and 19, mass and added mass (Eqs. 11 and 21); kg."""
    return mass(parameters) + parameters.added_mass * displaced_mass(parameters)


def moment_of_inertia(parameters: Parameters) -> Array:
    """Moment of inertia 8/15 pi (rho_p + rho_c (f_r^5 - 1)) R^5 about the centre; kg m^2.

    A spinning sphere displaces no fluid, so there is no added moment of inertia.
    """
    shell = parameters.coating_density * (parameters.f_r**5 - 1.0)
    return 8.0 / 15.0 * jnp.pi * (parameters.particle_density + shell) * parameters.radius**5


def coating_thickness(parameters: Parameters) -> Array:
    """Thickness (f_r - 1) R of the coating; m."""
    return (parameters.f_r - 1.0) * parameters.radius


def rises(parameters: Parameters) -> Array:
    """True, (), if the sum of all net weights points upwards, so that the suspension creams."""
    return jnp.sum(net_weight(parameters)) < 0.0


def net_weight_density(parameters: Parameters) -> Array:
    """Net weight of the coated particles over their volume, Delta rho g; N/m^3."""
    excess = apparent_density(parameters) - parameters.fluid_density
    return excess * parameters.gravity


def net_weight(parameters: Parameters) -> Array:
    """Net weight: weight less buoyancy (Eqs. 22 and 23), positive downwards; N.

    The paper gives the buoyancy of Eq. 9 the sign of a weight. Buoyancy acts against gravity, as in
    Eq. 23.
    """
    return (mass(parameters) - displaced_mass(parameters)) * parameters.gravity
