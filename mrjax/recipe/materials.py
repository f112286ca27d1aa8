"""Moduli of classes of materials, for a sheet that states none.

They are handbook values of one common material of each class, at room temperature: Callister &
Rethwisch, Materials Science and Engineering, 8th ed., Appendix B, Tables B.2 and B.3. Other
materials of the class have moduli within a factor of about three. Simulations to rest soften
contacts by far more.
"""

from typing import NamedTuple


class Moduli(NamedTuple):
    """Elastic constants of a material."""

    elastic_modulus: float  # Pa
    poisson_ratio: float  # 1
    example: str  # the material that has them


MATERIALS = {
    "metal": Moduli(207e9, 0.30, "steel"),
    "mineral": Moduli(69e9, 0.23, "soda-lime glass"),
    "polymer": Moduli(2.8e9, 0.33, "polystyrene"),
}
"""Moduli by the names of materials that a lab sheet uses."""
