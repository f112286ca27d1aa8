"""Dimensionless numbers of a suspension, and the bounds within which the model holds.

Re = rho_f v d / (f_v mu), of the coated particle   below 0.1: Stokes' drag within 2 % (Oseen 1910)
St = v / (alpha R)                                  below 1: the history force is negligible
Pe = |m - m_f| g R / (k T)                         above 10: Brownian motion is negligible, or any
                                                   number with it (parameters with a temperature)
Bo = A R / (12 h_0^2 |m - m_f| g)                   above 1: particles stick to each other
"""

from collections.abc import Iterable
from dataclasses import dataclass

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import drag, particle, time_scales
from mrjax.laws.brownian import BOLTZMANN as BOLTZMANN

ROOM = 298.15
"""Room temperature, K."""
LEAST_PECLET = 10.0
"""Peclet number above which Brownian motion is negligible."""


@dataclass(frozen=True)
class Number:
    """A dimensionless number, of the particle nearest its bound, and the range of the model."""

    name: str
    value: float
    bound: float
    at_most: bool
    """True if the model holds below the bound, False if above it."""
    beyond: str
    """Effect on the other side of the bound, which the model neglects."""

    @property
    def holds(self) -> str:
        """Range in which the model holds, in words."""
        if not self.at_most and self.bound == 0.0:
            return "any"
        return f"{'below' if self.at_most else 'above'} {self.bound:g}"

    @property
    def warning(self) -> str | None:
        """Warning in one line if the number is out of range, else None."""
        if (self.value < self.bound) == self.at_most:
            return None
        side = "above" if self.at_most else "below"
        return f"{self.name} number {self.value:.2g} is {side} {self.bound:g}: {self.beyond}"


def warnings(numbers: Iterable[Number]) -> list[str]:
    """Returns a warning for each number that is out of range."""
    return [number.warning for number in numbers if number.warning]


def in_words(numbers: Iterable[Number]) -> str:
    """Returns the numbers with the ranges in which the model holds, in one line."""
    return ", ".join(f"{number.name} {number.value:.2g} ({number.holds})" for number in numbers)


def reynolds_number(velocity: ArrayLike, parameters: Parameters) -> Array:
    """Reynolds number Re = rho_f v 2 f_r R / (f_v mu) of a coated particle; 1, () or (N,).

    Args:
      velocity: settling velocity, m/s, () or (N,).
      parameters: particles and fluid.

    Raises:
      InputError: `parameters` is no `Parameters`.
    """
    checks.require_class(Parameters, parameters=parameters)
    diameter = 2.0 * particle.outer_radius(parameters)
    viscosity = drag.carrier_viscosity(parameters)
    return parameters.fluid_density * velocity * diameter / viscosity


def pull_off(hamaker: ArrayLike, radius: Array, gap: ArrayLike) -> Array:
    """Pull-off force F_c = A R* / (6 h_0^2) of two surfaces (Derjaguin), N.

    Args:
      hamaker: Hamaker constant A, J.
      radius: R*, half the radius of two equal spheres, m.
      gap: h_0, closest gap between the surfaces, m.
    """
    return hamaker * radius / (6.0 * gap**2)


def granular_bond_number(parameters: Parameters, hamaker: ArrayLike, gap: ArrayLike) -> Array:
    """Granular Bond number Bo = F_c / W, the pull-off force of two equal spheres over their weight.

    F_c = A R* / (6 h_0^2), R* = R / 2 (Derjaguin); W is the net weight of one sphere. The number is
    1, () or (N,), and infinite without a weight.

    Args:
      parameters: particles and fluid; R is the coated radius.
      hamaker: Hamaker constant A, J.
      gap: h_0, closest gap between the surfaces, m: twice the thickness of the layer on each.
    """
    force = pull_off(hamaker, particle.outer_radius(parameters) / 2.0, gap)
    return force / jnp.abs(particle.net_weight(parameters))


def numbers(
    parameters: Parameters, velocity: ArrayLike, temperature: float = ROOM
) -> tuple[Number, Number, Number]:
    """Returns the Reynolds, Stokes and Peclet number of the particle nearest each bound.

    Args:
      parameters: particles and fluid; with a temperature, any Peclet number is in range.
      velocity: settling or rising velocity, m/s, () or (N,).
      temperature: temperature of the fluid, K.
    """
    reynolds, stokes, peclet = map(
        float, evaluate_with_numpy(_worst, parameters, velocity, temperature)
    )
    return (
        Number("Reynolds", reynolds, 0.1, True, "Stokes' drag is too small by more than 2 %"),
        Number(
            "Stokes",
            stokes,
            1.0,
            True,
            "particles rebound in the fluid, whose history force is left out",
        ),
        Number(
            "Peclet",
            peclet,
            LEAST_PECLET if parameters.temperature is None else 0.0,
            False,
            "Brownian motion, which is left out, keeps them from packing",
        ),
    )


def _worst(
    parameters: Parameters, velocity: ArrayLike, temperature: ArrayLike
) -> tuple[Array, Array, Array]:
    radius, speed = particle.outer_radius(parameters), jnp.abs(velocity)
    inertia = time_scales.relaxation_time(parameters) * speed / radius
    heat = jnp.abs(particle.net_weight(parameters)) * radius / (BOLTZMANN * temperature)
    return (
        jnp.max(reynolds_number(speed, parameters)),
        jnp.max(inertia),
        jnp.min(heat),
    )
