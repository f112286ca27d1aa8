"""Stokes drag and its corrections (Son 2018, section 2.3).

F_D = -6 pi f_w f_s f_v f_r mu R u                                         (Eq. 24)

No other module reads `f_w`, `f_s` and `f_v`. The closures give f_w for a volume fraction. For the
derivative of a velocity with respect to the volume fraction, use
`parameters.replace(f_w=drag.richardson_zaki(volume_fraction))`.

The factors are calibration constants rather than models of crowding: the exact drag in a simple
cubic array at a volume fraction of 0.34 is about 15 times Stokes' (Zick & Homsy 1982), whereas
Eq. 14 gives 49.
"""

import math
from collections.abc import Callable

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.laws.particle import outer_radius

HABERMAN_SAYRE_LIMIT = 0.8
"""Largest diameter ratio that Haberman & Sayre (1958) tabulate."""


def coefficient(parameters: Parameters) -> Array:
    """Drag coefficient gamma = 6 pi f_w f_s f_v f_r mu R (Eq. 24), force over speed; N s/m.

    The shape is () or (N,). Eqs. 10 and 18 are the same with factors of 1.
    """
    corrections = parameters.f_w * parameters.f_s
    return 6.0 * jnp.pi * corrections * carrier_viscosity(parameters) * outer_radius(parameters)


def rotational_coefficient(parameters: Parameters) -> Array:
    """Rotational drag coefficient 8 pi f_w f_s f_v (f_r R)^3 mu, torque over spin; N m s.

    The shape is () or (N,). It is exact for one sphere, with f_w = f_s = 1. f_v holds for spin as
    for velocity. To use f_w and f_s for spin is an assumption: neighbours hinder the spin of a
    sphere less than its fall. It matters little, because the spins of a settling suspension come
    from its contacts.
    """
    corrections = parameters.f_w * parameters.f_s
    cubed_radius = outer_radius(parameters) ** 3
    return 8.0 * jnp.pi * corrections * carrier_viscosity(parameters) * cubed_radius


def carrier_viscosity(parameters: Parameters) -> Array:
    """Viscosity f_v mu of the fluid with its additives; Pa s."""
    return parameters.f_v * parameters.viscosity


def diameter_ratio(volume_fraction: ArrayLike) -> Array:
    """Diameter ratio lambda = 1 / ((4 pi / 3 phi)^(1/3) - 1) of Eq. 15; 1.

    It measures how close the neighbours of a particle are.
    """
    return 1.0 / (jnp.cbrt(4.0 * jnp.pi / (3.0 * volume_fraction)) - 1.0)


def volume_fraction_at(ratio: ArrayLike) -> ArrayLike:
    """Volume fraction at a diameter ratio: the inverse of Eq. 15; 1."""
    return 4.0 * math.pi / (3.0 * (1.0 + 1.0 / ratio) ** 3)


def son2018_uncapped(
    volume_fraction: ArrayLike, coefficient: ArrayLike = 389.1530, exponent: ArrayLike = 7.5593
) -> Array:
    """Closure a lambda^b + 1: Eq. 14 without its cap; 1.

    Eq. 14 is a least-squares fit to Haberman & Sayre's exact column. For lambda from 0.1 to 0.5 it
    is a fifth to three fifths below that column.
    """
    return coefficient * diameter_ratio(volume_fraction) ** exponent + 1.0


def son2018(
    volume_fraction: ArrayLike,
    coefficient: ArrayLike = 389.1530,
    exponent: ArrayLike = 7.5593,
    cap: ArrayLike = 48.985,
) -> Array:
    """Closure of Son (2018), Eq. 14: MIN(f_max, a lambda^b + 1); 1.

    The cap is reached at lambda = 0.758, a volume fraction of 0.336. From there on, the derivatives
    with respect to the volume fraction, a and b are zero.

    Example:
      >>> float(mrjax.laws.drag.son2018(0.337))
      48.985
    """
    return jnp.minimum(cap, son2018_uncapped(volume_fraction, coefficient, exponent))


def son2018_smooth(
    volume_fraction: ArrayLike,
    coefficient: ArrayLike = 389.1530,
    exponent: ArrayLike = 7.5593,
    cap: ArrayLike = 48.985,
    sharpness: ArrayLike = 4.0,
) -> Array:
    """Closure of Son (2018), Eq. 14, with a smooth cap: (f_uncapped^-p + f_max^-p)^(-1/p); 1.

    With p = 4, the value at the point where Eq. 14 reaches its cap is 2^(-1/4) = 0.84 of the cap.
    The logarithmic slope there is half that of the uncapped law, and 2 % of it at a volume fraction
    of 0.417. A larger p follows Eq. 14 more closely and has less slope beyond that point.
    """
    uncapped = son2018_uncapped(volume_fraction, coefficient, exponent)
    return cap * (1.0 + (cap / uncapped) ** sharpness) ** (-1.0 / sharpness)


def haberman_sayre(volume_fraction: ArrayLike) -> Array:
    """Haberman & Sayre's rational approximation for a sphere in a tube of still liquid; 1.

    It is valid for lambda <= 0.8, a volume fraction of 0.367. It is within 0.03 % of their exact
    solution at lambda = 0.2, 14 % low at 0.7 and 33 % low at 0.8.
    """
    ratio = diameter_ratio(volume_fraction)
    return (1.0 - 0.75857 * ratio**5) / (
        1.0 - 2.1050 * ratio + 2.0865 * ratio**3 - 1.7068 * ratio**5 + 0.72603 * ratio**6
    )


def richardson_zaki(volume_fraction: ArrayLike, exponent: ArrayLike = 4.65) -> Array:
    """Closure of Richardson & Zaki (1954): f_w = (1 - phi)^-n; 1.

    n = 5.6 at low and 4.48 at high Peclet numbers (Brzinski & Durian, arXiv 1710.09314).
    """
    return (1.0 - volume_fraction) ** (-exponent)


CLOSURES: dict[str, Callable[..., Array]] = {
    "son2018": son2018,
    "son2018-smooth": son2018_smooth,
    "haberman-sayre": haberman_sayre,
    "richardson-zaki": richardson_zaki,
}
"""Closures by the names that a lab sheet uses."""


def shape_factor(largest: ArrayLike, medium: ArrayLike, smallest: ArrayLike) -> Array:
    """Shape factor f_s = (d_max d_med / d_min^2)^0.09 (Eqs. 16 and 17; Loth 2008); 1.

    Args:
      largest: d_max, m.
      medium: d_med, m.
      smallest: d_min, m.
    """
    return (largest * medium / smallest**2) ** 0.09
