"""The closure of Haberman & Sayre (1958): a sphere in a tube of still liquid.

f_w = (1 - 0.75857 l^5) / (1 - 2.1050 l + 2.0865 l^3 - 1.7068 l^5 + 0.72603 l^6),  l = lambda

It holds up to lambda = 0.8, a volume fraction of 0.367.
Source: W. L. Haberman & R. M. Sayre, David Taylor Model Basin report 1143 (1958).
"""

from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.diameter_ratio import diameter_ratio, volume_fraction_at
from mrjax.laws.closures.valid_range import ValidRange

HABERMAN_SAYRE_LIMIT = 0.8
"""Largest diameter ratio that Haberman & Sayre (1958) tabulate."""


def haberman_sayre(volume_fraction: ArrayLike) -> Array:
    """Haberman & Sayre's rational approximation for a sphere in a tube of still liquid; 1.

    It is valid for lambda <= 0.8, a volume fraction of 0.367. It is within 0.03 % of their exact
    solution at lambda = 0.2, 14 % low at 0.7 and 33 % low at 0.8.
    """
    ratio = diameter_ratio(volume_fraction)
    return (1.0 - 0.75857 * ratio**5) / (
        1.0 - 2.1050 * ratio + 2.0865 * ratio**3 - 1.7068 * ratio**5 + 0.72603 * ratio**6
    )


def valid_range() -> ValidRange:
    """Returns the volume fractions of the tabulated diameter ratios."""
    return ValidRange(
        most=float(volume_fraction_at(HABERMAN_SAYRE_LIMIT)),
        above=f"lambda = {HABERMAN_SAYRE_LIMIT} is the largest that is tabulated",
    )
