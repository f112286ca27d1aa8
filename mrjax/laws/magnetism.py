"""Magnetisation of a single sphere, and the dimensionless numbers of magnetic particles.

A sphere of susceptibility chi in a local field H is magnetised to M = k H. Inside, the field is
H_in = H - M / 3, and the law of Froehlich and Kennelly (as in Ginder & Davis, Appl. Phys. Lett. 65,
3410, 1994) is

    M = chi H_in / (1 + chi H_in / M_s),    so that    k = 2 chi / (a + b + s),
    a = 1 + chi / 3,    b = chi H / M_s,    s^2 = (a - b)^2 + 4 b

with the saturation magnetisation M_s. In a weak field k = 3 beta, beta = chi / (chi + 3), which is
(mu_p - mu_f) / (mu_p + 2 mu_f) in a fluid that is not magnetic. A strong field gives M = M_s.

Remanence M_r is the magnetisation of a particle without a field, and adds to it. Volumes are those
of the uncoated particle.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.laws import particle
from mrjax.laws.dimensionless import BOLTZMANN, ROOM
from mrjax.laws.dipoles import VACUUM_PERMEABILITY

CHAIN = 1.2020569031595942
"""zeta(3): pull of a long chain on each of its contacts, over that of a touching pair."""


def contrast(susceptibility: ArrayLike) -> Array:
    """Contrast beta = chi / (chi + 3) of a sphere in a fluid that is not magnetic; 1.

    Args:
      susceptibility: chi of the solid, at least 0.
    """
    return jnp.divide(susceptibility, susceptibility + 3.0)


def _terms(
    strength: ArrayLike, susceptibility: ArrayLike, saturation: ArrayLike | None
) -> tuple[ArrayLike, ArrayLike, Array]:
    """Terms a, b and s of the law."""
    a = 1.0 + susceptibility / 3.0
    b = 0.0 * strength if saturation is None else susceptibility * strength / saturation
    return a, b, jnp.sqrt((a - b) ** 2 + 4.0 * b)


def secant_susceptibility(
    strength: ArrayLike, susceptibility: ArrayLike, saturation: ArrayLike | None = None
) -> Array:
    """Magnetisation of a sphere over the local field, k = M / H; 1, elementwise.

    Args:
      strength: local field H, at least 0, A/m.
      susceptibility: chi of the solid, at least 0.
      saturation: M_s, A/m; None for none.
    """
    a, b, s = _terms(strength, susceptibility, saturation)
    return 2.0 * susceptibility / (a + b + s)


def tangent_susceptibility(
    strength: ArrayLike, susceptibility: ArrayLike, saturation: ArrayLike | None = None
) -> Array:
    """Slope dM/dH of the magnetisation of a sphere; 1, elementwise.

    Args:
      strength: local field H, at least 0, A/m.
      susceptibility: chi of the solid, at least 0.
      saturation: M_s, A/m; None for none.
    """
    a, b, s = _terms(strength, susceptibility, saturation)
    return susceptibility * (a - b + s) / ((a + b + s) * s)


def field_strength(parameters: Parameters) -> Array:
    """Size of the applied field, A/m, (); 0 without one."""
    if parameters.field is None:
        return jnp.zeros(())
    square = jnp.sum(jnp.asarray(parameters.field) ** 2)
    return jnp.where(square > 0.0, jnp.sqrt(jnp.where(square > 0.0, square, 1.0)), 0.0)


def magnetisation(parameters: Parameters) -> Array:
    """Magnetisation of a particle alone: remanence and what the field induces; A/m, () or (N,).

    Remanence is taken to point along the field.

    Args:
      parameters: particles with remanence, field, susceptibility and saturation, or some of them.
    """
    strength = field_strength(parameters)
    remanence = 0.0 if parameters.remanence is None else jnp.asarray(parameters.remanence)
    if parameters.susceptibility is None:
        return remanence + 0.0 * strength
    secant = secant_susceptibility(strength, parameters.susceptibility, parameters.saturation)
    return remanence + secant * strength


def touching_pull(
    parameters: Parameters,
    magnetisation: ArrayLike,
    permeability: ArrayLike = VACUUM_PERMEABILITY,
) -> Array:
    """Pull 3 mu_0 m^2 / (2 pi d^4) of two touching particles in line; N, () or (N,).

    Without a coating it is pi mu_0 M^2 d^2 / 24.

    Args:
      parameters: particles; d is the coated diameter, and m = V M of the uncoated volume.
      magnetisation: M, A/m, () or (N,).
      permeability: mu_0, N/A^2.
    """
    moment = particle.core_volume(parameters) * magnetisation
    ratio = moment / (2.0 * particle.outer_radius(parameters)) ** 2
    return 1.5 / jnp.pi * permeability * ratio * ratio


def magnetic_bond_number(parameters: Parameters) -> Array:
    """Magnetic Bond number: pull of two touching particles in line over the net weight of one; 1.

    The moments are those of a particle alone, by remanence and field. The shape is () or (N,). The
    number is infinite for particles as dense as the fluid.

    Args:
      parameters: physical parameters in SI, with a remanence, or with a field and a susceptibility.

    Example:
      >>> iron = mrjax.Recipe.load("case2").parameters().replace(remanence=3e3)
      >>> print(f"{mrjax.magnetic_bond_number(iron):.2g}")
      11
    """
    pull = touching_pull(parameters, magnetisation(parameters))
    return pull / jnp.abs(particle.net_weight(parameters))


def dipolar_coupling(parameters: Parameters, temperature: ArrayLike = ROOM) -> Array:
    """Dipolar coupling lambda = mu_0 m^2 / (4 pi d^3 k T); 1, () or (N,).

    Above about 1, dipoles form chains against Brownian motion.

    Args:
      parameters: physical parameters in SI, as for `magnetic_bond_number`.
      temperature: T, K.

    Example:
      >>> iron = mrjax.Recipe.load("case2").parameters().replace(remanence=3e3)
      >>> print(f"{mrjax.dipolar_coupling(iron, 293.15):.2g}")
      3.9e+03
    """
    diameter = 2.0 * particle.outer_radius(parameters)
    pull = touching_pull(parameters, magnetisation(parameters))
    return pull * diameter / (6.0 * BOLTZMANN * temperature)


def largest_magnetisation(parameters: Parameters) -> Array:
    """Upper bound on the magnetisation of a particle among others; A/m, () or (N,).

    It is that in a long chain along the field, (M_r + 3 beta H_0) / (1 - beta zeta(3) / 2), and at
    most M_r + M_s.

    Args:
      parameters: physical parameters, in any coherent system of units.
    """
    if parameters.susceptibility is None:
        return magnetisation(parameters)
    linear = magnetisation(parameters.replace(saturation=None))
    linear = linear / (1.0 - 0.5 * CHAIN * contrast(parameters.susceptibility))
    if parameters.saturation is None:
        return linear
    remanence = 0.0 if parameters.remanence is None else parameters.remanence
    return jnp.minimum(linear, remanence + parameters.saturation)


def largest_stiffness(
    parameters: Parameters, permeability: ArrayLike = VACUUM_PERMEABILITY
) -> Array:
    """Upper bound on the stiffness of magnetic forces and torques, N/m, ().

    It is the slope 4 F / d of the pull of a chain. The torque mu_0 m_r H resists rotation, which
    vibrates and relaxes as displacement with a stiffness of at most 5/4 mu_0 m_r H / R^2 would: two
    of it act on a particle. H is the field of a long chain.

    Args:
      parameters: physical parameters, in any coherent system of units.
      permeability: mu_0, N/A^2.
    """
    radius, largest = particle.outer_radius(parameters), largest_magnetisation(parameters)
    stiffness = 2.0 * CHAIN * touching_pull(parameters, largest, permeability) / radius
    if parameters.remanence is not None:
        volume = particle.core_volume(parameters)
        of_chain = CHAIN * volume * largest / (2.0 * jnp.pi * (2.0 * radius) ** 3)
        field = field_strength(parameters) + 2.0 * of_chain
        torque = permeability * volume * jnp.asarray(parameters.remanence) * field
        stiffness = stiffness + 1.25 * torque / radius**2
    return jnp.max(stiffness)


def largest_pull(parameters: Parameters, permeability: ArrayLike = VACUUM_PERMEABILITY) -> Array:
    """Upper bound on the pull of two touching particles of a long chain; N, ().

    Args:
      parameters: physical parameters, in any coherent system of units.
      permeability: mu_0, N/A^2.
    """
    pull = touching_pull(parameters, largest_magnetisation(parameters), permeability)
    return CHAIN * jnp.max(pull)
