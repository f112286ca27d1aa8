"""Stokes drag and its corrections (Son 2018, section 2.3).

F_D = -6 pi f_w f_s f_v f_r mu R u                                         (Eq. 24)

The only reader of `f_w`, `f_s` and `f_v`. The closures give f_w for a volume fraction; whoever
wants the derivative of a velocity with respect to the volume fraction writes
`parameters.replace(f_w=drag.richardson_zaki(volume_fraction))`.

The factors are calibration constants more than crowding physics: the exact drag in a simple cubic
array at a volume fraction of 0.34 is about 15 times Stokes' (Zick & Homsy 1982), Eq. 14 gives 49.
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
    """Eq. 24: gamma = 6 pi f_w f_s f_v f_r mu R, drag force over speed; N s/m, () or (N,).

    Eqs. 10 and 18 are the same with factors of 1.
    """
    corrections = parameters.f_w * parameters.f_s
    return 6.0 * jnp.pi * corrections * carrier_viscosity(parameters) * outer_radius(parameters)


def rotational_coefficient(parameters: Parameters) -> Array:
    """8 pi f_w f_s f_v (f_r R)^3 mu, drag torque over spin; N m s, () or (N,).

    Exact for one sphere, f_w = f_s = 1. f_v holds for spin as it does for velocity; that f_w and
    f_s do is an assumption: neighbours hinder the spin of a sphere less than its fall. It matters
    little, as the spins of a settling suspension come from its contacts.
    """
    corrections = parameters.f_w * parameters.f_s
    around = outer_radius(parameters) ** 3
    return 8.0 * jnp.pi * corrections * carrier_viscosity(parameters) * around


def carrier_viscosity(parameters: Parameters) -> Array:
    """f_v mu, the viscosity of the fluid with its additives; Pa s."""
    return parameters.f_v * parameters.viscosity


def diameter_ratio(volume_fraction: ArrayLike) -> Array:
    """Eq. 15: lambda = 1 / ((4 pi / 3 phi)^(1/3) - 1), closeness to the neighbours; 1."""
    return 1.0 / (jnp.cbrt(4.0 * jnp.pi / (3.0 * volume_fraction)) - 1.0)


def volume_fraction_at(ratio: ArrayLike) -> ArrayLike:
    """Eq. 15 solved for the volume fraction; 1."""
    return 4.0 * math.pi / (3.0 * (1.0 + 1.0 / ratio) ** 3)


def son2018_uncapped(
    volume_fraction: ArrayLike, coefficient: ArrayLike = 389.1530, exponent: ArrayLike = 7.5593
) -> Array:
    """Eq. 14 without its upper limit: a lambda^b + 1; 1.

    A least-squares fit to Haberman & Sayre's exact column, below which it is by a fifth to three
    fifths for lambda from 0.1 to 0.5.
    """
    return coefficient * diameter_ratio(volume_fraction) ** exponent + 1.0


def son2018(
    volume_fraction: ArrayLike,
    coefficient: ArrayLike = 389.1530,
    exponent: ArrayLike = 7.5593,
    cap: ArrayLike = 48.985,
) -> Array:
    """Eq. 14: MIN(f_max, a lambda^b + 1); 1.

    The cap is reached at lambda = 0.758, a volume fraction of 0.336: there and above the
    derivative with respect to the volume fraction, a and b is zero.

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
    """Eq. 14 with a smooth cap, f = (f_uncapped^-p + f_max^-p)^(-1/p); 1.

    With p = 4, 2^(-1/4) = 0.84 of the cap where the two meet; of the slope of the uncapped law,
    in logarithms, half is left there and 2 % at a volume fraction of 0.417. A larger p follows
    Eq. 14 more closely and leaves less slope.
    """
    uncapped = son2018_uncapped(volume_fraction, coefficient, exponent)
    return cap * (1.0 + (cap / uncapped) ** sharpness) ** (-1.0 / sharpness)


def haberman_sayre(volume_fraction: ArrayLike) -> Array:
    """Haberman & Sayre's rational approximation for a sphere in a tube of still liquid; 1.

    Valid for lambda <= 0.8, a volume fraction of 0.367; within 0.03 % of their exact solution at
    lambda = 0.2, 14 % low at 0.7, 33 % low at 0.8.
    """
    ratio = diameter_ratio(volume_fraction)
    return (1.0 - 0.75857 * ratio**5) / (
        1.0 - 2.1050 * ratio + 2.0865 * ratio**3 - 1.7068 * ratio**5 + 0.72603 * ratio**6
    )


def richardson_zaki(volume_fraction: ArrayLike, exponent: ArrayLike = 4.65) -> Array:
    """Richardson & Zaki (1954): f_w = (1 - phi)^-n; 1.

    n = 5.6 at low, 4.48 at high Peclet number (Brzinski & Durian, arXiv 1710.09314).
    """
    return (1.0 - volume_fraction) ** (-exponent)


CLOSURES: dict[str, Callable[..., Array]] = {
    "son2018": son2018,
    "son2018-smooth": son2018_smooth,
    "haberman-sayre": haberman_sayre,
    "richardson-zaki": richardson_zaki,
}
"""The closures by the names that a lab sheet uses."""


def shape_factor(largest: ArrayLike, medium: ArrayLike, smallest: ArrayLike) -> Array:
    """Eqs. 16 and 17 (Loth 2008): f_s = (d_max d_med / d_min^2)^0.09; 1, from dimensions in m."""
    return (largest * medium / smallest**2) ** 0.09
