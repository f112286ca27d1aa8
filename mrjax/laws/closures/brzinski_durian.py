"""The closure of Brzinski & Durian (2018): equal hard spheres, on one of two branches.

f_w = (1 - phi)^-n,  n = 5.6 for Pe < 1e8,  n = 4.48 for Pe > 1e8

Pe is the Peclet number, |m - m_f| g R / (k T). The branches are fits to 27 sets of data for equal
spheres without attraction, at low Reynolds numbers; n is uncertain by 0.1 and 0.04. Iron particles
of some micrometres have Pe = 1e3. A bed has less permeability than the law says.
Source: T. A. Brzinski & D. J. Durian, Phys. Rev. Fluids 3, 124303 (2018), arXiv 1710.09314.
"""

from jax import Array
from jax.typing import ArrayLike

from mrjax.laws.closures.richardson_zaki import richardson_zaki

BRANCHES = {"low": 5.6, "high": 4.48}
"""Exponents of the branches at low and high Peclet numbers."""
CROSSOVER = 1e8
"""Peclet number between the branches."""


def branch(peclet_number: float) -> str:
    """Returns the branch at a Peclet number: "low" or "high"."""
    return "low" if peclet_number < CROSSOVER else "high"


def brzinski_durian(volume_fraction: ArrayLike, exponent: ArrayLike = BRANCHES["low"]) -> Array:
    """Closure of Brzinski & Durian (2018): f_w = (1 - phi)^-n; 1.

    n = 5.6 at Peclet numbers below 1e8, and 4.48 above. A recipe chooses the branch by its own
    Peclet number unless it states one.

    Example:
      >>> print(f"{mrjax.drag.brzinski_durian(0.3):.2f}")
      7.37
    """
    return richardson_zaki(volume_fraction, exponent)
