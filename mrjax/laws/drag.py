"""Stokes drag and its corrections (Son 2018, section 2.3).

F_D = -6 pi f_w f_s f_v f_r mu R u                                         (Eq. 24)

No other module reads `f_w`, `f_s` and `f_v`. The closures (`mrjax.laws.closures`) give f_w for a
volume fraction. f_w is the Stokes velocity over the hindered one, which is relative to the box: the
inverse of the hindered settling function of most papers. For the derivative of a velocity with
respect to the volume fraction, use
`parameters.replace(f_w=drag.richardson_zaki(volume_fraction))`.

The factors are calibration constants rather than models of crowding: the exact drag in a simple
cubic array at a volume fraction of 0.34 is about 15 times Stokes' (Zick & Homsy 1982), whereas
Eq. 14 gives 49.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.laws.closures.brzinski_durian import brzinski_durian as brzinski_durian
from mrjax.laws.closures.carman_kozeny import carman_kozeny as carman_kozeny
from mrjax.laws.closures.diameter_ratio import diameter_ratio as diameter_ratio
from mrjax.laws.closures.diameter_ratio import volume_fraction_at as volume_fraction_at
from mrjax.laws.closures.floc_richardson_zaki import floc_richardson_zaki as floc_richardson_zaki
from mrjax.laws.closures.haberman_sayre import HABERMAN_SAYRE_LIMIT as HABERMAN_SAYRE_LIMIT
from mrjax.laws.closures.haberman_sayre import haberman_sayre as haberman_sayre
from mrjax.laws.closures.richardson_zaki import richardson_zaki as richardson_zaki
from mrjax.laws.closures.rigid_network import rigid_network as rigid_network
from mrjax.laws.closures.son2018 import son2018 as son2018
from mrjax.laws.closures.son2018 import son2018_smooth as son2018_smooth
from mrjax.laws.closures.son2018 import son2018_uncapped as son2018_uncapped
from mrjax.laws.closures.table import CLOSURES as CLOSURES
from mrjax.laws.closures.vesilind import vesilind as vesilind
from mrjax.laws.particle import outer_radius


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


def shape_factor(largest: ArrayLike, medium: ArrayLike, smallest: ArrayLike) -> Array:
    """Shape factor f_s = (d_max d_med / d_min^2)^0.09 (Eqs. 16 and 17; Loth 2008); 1.

    Args:
      largest: d_max, m.
      medium: d_med, m.
      smallest: d_min, m.
    """
    return (largest * medium / smallest**2) ** 0.09
