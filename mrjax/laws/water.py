"""Density and viscosity of water at 1 atm, from 0 to 100 degrees Celsius.

The density is that of Kell (1975), J. Chem. Eng. Data 20, 97; the viscosity that of IAPWS
SR6-08(2011), revised supplementary release on liquid water at 0.1 MPa. Both functions are
elementwise and differentiable.
"""

from typing import TypeVar

from jax import Array

NumberT = TypeVar("NumberT", float, Array)
"""A plain number of a lab sheet, or an array."""

FREEZING, BOILING = 273.15, 373.15
"""Temperatures between which both correlations are valid, K."""

_DENSITY = (999.83952, 16.945176, -7.9870401e-3, -46.170461e-6, 105.56302e-9, -280.54253e-12)
"""Coefficients of Kell's numerator, by powers of the temperature in degrees Celsius."""
_EXPANSION = 16.879850e-3
"""Coefficient of Kell's denominator, 1/K."""
_VISCOSITY = ((280.68, -1.9), (511.45, -7.7), (61.131, -19.6), (0.45903, -40.0))
"""Coefficients in uPa s and exponents of (T / 300 K)."""


def density(temperature: NumberT) -> NumberT:
    """Density of water, Kell's rho(t) = sum a_k t^k / (1 + b t), t in degrees Celsius; kg/m^3.

    It is within 0.01 kg/m^3 of IAPWS-95 from 0 to 50 degrees, and within 0.02 kg/m^3 up to 100.

    Args:
      temperature: temperature, K.

    Example:
      >>> print(f"{mrjax.laws.water.density(293.15):.2f} kg/m^3")
      998.20 kg/m^3
    """
    celsius = temperature - FREEZING
    numerator = 0.0 * celsius
    for coefficient in reversed(_DENSITY):
        numerator = numerator * celsius + coefficient
    return numerator / (1.0 + _EXPANSION * celsius)


def viscosity(temperature: NumberT) -> NumberT:
    """Viscosity of water, mu(T) = sum a_k (T / 300 K)^b_k; Pa s.

    It is within 1 % of measurements, according to the release.

    Args:
      temperature: temperature, K.

    Example:
      >>> print(f"{1e3 * mrjax.laws.water.viscosity(293.15):.4f} mPa s")
      1.0016 mPa s
    """
    reduced = temperature / 300.0
    total = 0.0 * reduced
    for coefficient, exponent in _VISCOSITY:
        total = total + coefficient * reduced**exponent
    return 1e-6 * total
