"""Velocities and fluxes of several classes of particles, after Masliyah, Lockett and Bassoon.

u_i = F(phi) k_i (r_i - r.Phi)                      slip velocity, relative to the fluid
v_i = u_i - SUM_m phi_m u_m                         velocity, as the total volume flux is zero
f_i = phi_i v_i,   k_i = g d_i^2 / (18 mu f_s f_v),   r_i = rho_i - rho_f,   r.Phi = SUM_m r_m phi_m

All are positive downwards. Phi are the volume fractions phi_i of the classes, and phi is their sum.
A particle is lifted by the density of the suspension, rho_f + r.Phi (Masliyah 1979; Lockett and
Bassoon 1979). F is the factor of hindrance. For one class r_1 - r.Phi = r_1 (1 - phi), so that

v_1 = F(phi) (1 - phi)^2 k_1 r_1

Kynch's velocity is k_1 r_1 / f_w(phi), which gives F for any closure:

F(phi) = 1 / (f_w(phi) (1 - phi)^2)

In a carrier with a yield stress k_i has the factor of a lone particle of the class
(`mrjax.laws.yield_stress`): held particles move with the fluid.

Richardson and Zaki's f_w = (1 - phi)^-n gives F = (1 - phi)^(n - 2), and for equal densities
v_i = r_1 (1 - phi)^(n - 1) (k_i - SUM_m k_m phi_m), the form in which the model is mostly printed.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from mrjax.core.parameters import Parameters
from mrjax.laws import drag, particle, yield_stress
from mrjax.laws.hindrance import Hindrance

DILUTE = 1e-9
"""Least volume fraction passed to a closure, which may have no derivative in clear fluid."""


class Classes(NamedTuple):
    """K classes of particles in a fluid."""

    mobility: Array
    """k_i, velocity of a lone particle over its excess density; m^4/(kg s), (K,)."""
    excess: Array
    """r_i, density of the coated particle less that of the fluid; kg/m^3, () if equal, or (K,)."""
    hindrance: Hindrance | None
    """f_w as a function of the total volume fraction; None if it is a part of the mobility."""

    @property
    def lone_velocity(self) -> Array:
        """Velocity k_i r_i of a lone particle of each class, with f_w = 1; m/s, (K,)."""
        return self.mobility * self.excess

    def factor(self, total: Array, densest: Array) -> Array:
        """F(phi) for total volume fractions of any shape, at most `densest`; 1."""
        phi = jnp.clip(total, DILUTE, densest)
        f_w = 1.0 if self.hindrance is None else self.hindrance(phi)
        return 1.0 / (f_w * (1.0 - phi) ** 2)


def classes(parameters: Parameters, hindrance: Hindrance | None) -> Classes:
    """Returns the classes of a suspension.

    Args:
      parameters: particles and fluid; leaves have shape () or (K,), and at least one has (K,).
      hindrance: f_w as a function of the volume fraction; None to use f_w of the parameters.
    """
    p = parameters if hindrance is None else parameters.replace(f_w=jnp.ones_like(parameters.f_s))
    # In a column that creams, gravity has the other sign; mobilities stay positive.
    weight = particle.core_volume(p) * p.f_r**3 * jnp.abs(p.gravity)  # over the density
    # Not `apparent_density`, which has the shape of the radius: equal densities stay one number.
    dry = particle.mass_over_core_volume(p.particle_density, p.coating_density, p.f_r)
    mobility = weight / drag.coefficient(p)
    if not yield_stress.is_newtonian(p):
        mobility = mobility * yield_stress.velocity_factor(p)
    return Classes(
        mobility=jnp.atleast_1d(mobility),
        excess=jnp.asarray((dry / p.f_r**3 - p.fluid_density) * jnp.sign(p.gravity)),
        hindrance=hindrance,
    )


def buoyant_density(law: Classes, fraction: Array, total: Array) -> Array:
    """r_i - r.Phi, density of each class less that of the suspension; kg/m^3, (1 or K, C).

    Args:
      law: the classes.
      fraction: phi_i, (K, C).
      total: phi, (C,).
    """
    if law.excess.ndim == 0:
        return (law.excess * (1.0 - total))[None]
    suspension = jnp.sum(law.excess[:, None] * fraction, axis=0)
    return law.excess[:, None] - suspension[None]


def excess_density(law: Classes, fraction: Array) -> Array:
    """r.Phi, density of a suspension less that of the fluid; kg/m^3, (..., C).

    Args:
      law: the classes.
      fraction: phi_i, (..., K, C).
    """
    excess = jnp.broadcast_to(law.excess, law.mobility.shape)
    return jnp.einsum("k,...kc->...c", excess, fraction)


def velocities(law: Classes, fraction: Array, densest: Array) -> Array:
    """v_i, velocity of each class, positive downwards; m/s, (K, C).

    Args:
      law: the classes.
      fraction: phi_i, (K, C).
      densest: phi_m, volume fraction of the bed, ().
    """
    total = jnp.sum(fraction, axis=0)
    density = buoyant_density(law, fraction, total)
    slip = law.factor(total, densest)[None] * law.mobility[:, None] * density
    return slip - jnp.sum(fraction * slip, axis=0)[None]


def fluxes(law: Classes, fraction: Array, densest: Array) -> Array:
    """f_i = phi_i v_i, volume flux of each class, positive downwards; m/s, (K, C)."""
    return fraction * velocities(law, fraction, densest)
