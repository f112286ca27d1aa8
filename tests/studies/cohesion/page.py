"""The page of beds that attract: what was measured, in words and a table."""

from pathlib import Path

import numpy as np

from tests.studies.cohesion import beds
from tests.studies.cohesion.beds import Bed

PAGE = Path(__file__).parent / "README.md"
BAR = 0.02
"""Largest difference of a height from LAMMPS', over the height of the box."""

ABOUT = """# Beds of spheres that attract each other, beside LAMMPS

The box is that of case 2: 314 spheres, 12.5 x 12.5 x 25 radii, friction 0.3. Both codes have
the same starts, elastic moduli and steps, a Stokes number of 0.04, walls that do not attract,
and the pull-off force of DMT in contact only. Both damp rotation by Stokes' drag, and have a
rolling spring of the same stiffness (`bed.in` beside this page is the input of LAMMPS). Bo is
the pull-off force over the net weight, \u03bc_r the rolling friction. Heights are over that of
the box, the mean of the starts. The bar is {bar:.0f} points.

"""
NOTES = """
What the comparison depends on:

- Without drag on rotation LAMMPS' beds are denser: by 2 to 3 points at Bo = 10.
- With a rolling spring of a tenth of the elastic modulus, 38 times as stiff, LAMMPS' beds with
  rolling resistance are looser: by 2 points at Bo = 10. A softened contact turns by some tenths
  of a radian before its rolling resistance reaches the limit.
- In oil the Stokes number is below 1e-6. `mrjax.settle` has no inertia to speak of, and overlaps
  of 0.025 radii instead of 0.1. The same boxes then rest higher, in one start each: top and
  twice the mean height of 0.749 and 0.691 at Bo = 0, 0.755 and 0.714 at 1, 0.816 and 0.779 at
  3, 0.846 and 0.811 at 10, 0.842 and 0.807 at 30. About half of the difference is due to the
  overlap: with 0.09 radii there are 0.698 and 0.649 at Bo = 0, 0.793 and 0.735 at 3, 0.796 and
  0.753 at 10.
- With walls that attract and a tail of 0.03 radii the spheres stick to the sides and to the lid:
  twice the mean height is 0.938 at Bo = 10.
"""


def text() -> str:
    """The whole page."""
    lines = [
        "| Bo | \u03bc_r | starts | top, LAMMPS | top, mrjax | 2 mean z, LAMMPS | 2 mean z, mrjax "
        "| contacts, LAMMPS | contacts, mrjax |",
        "| --- " * 9 + "|",
    ]
    for (bond, rolling), (peer, ours) in by_condition().items():
        cells = [f"{bond}", f"{rolling:g}", f"{len(ours)}"]
        for name, digits in (("top", 3), ("twice_mean_height", 3), ("coordination", 2)):
            cells += [f"{mean(beds_, name):.{digits}f}" for beds_ in (peer, ours)]
        lines.append(f"| {' | '.join(cells)} |")
    return ABOUT.format(bar=100 * BAR) + "\n".join(lines) + "\n" + NOTES


def by_condition() -> dict[tuple[int, float], tuple[list[Bed], list[Bed]]]:
    """Beds of LAMMPS and of mrjax by Bond number and rolling friction."""
    measured = beds.measured()
    conditions = dict.fromkeys((bed.bond_number, bed.rolling_friction) for bed in measured)
    return {
        condition: (of_code("LAMMPS", condition), of_code("mrjax", condition))
        for condition in conditions
    }


def of_code(code: str, condition: tuple[int, float]) -> list[Bed]:
    """Beds of one code under one condition."""
    return [
        bed
        for bed in beds.measured()
        if bed.code == code and (bed.bond_number, bed.rolling_friction) == condition
    ]


def mean(measured: list[Bed], name: str) -> float:
    """Mean of a quantity over beds."""
    return float(np.mean([getattr(bed, name) for bed in measured]))
