"""The eight benchmark tests of Chung & Ooi, Granular Matter 13:643 (2011).

Angles of impact are from the normal. Spins are about y where a sphere moves along x above its
partner; theirs in test 4 has the other sign.
"""

from matplotlib.figure import Figure

from ..row import Row
from . import constant_normal, elastic, oblique, restitution, spinning

NOTE = """\
Angles are measured from the normal. "The published law, integrated" is an integration that does not
use the package.

Test 4: the error of a measured row is a share of the tangential impulse. The bar is two standard
deviations of the scatter of the measurements of sliding spheres. Near 20 degrees the spheres stick,
and the computed impulse is 6 to 8 % smaller than the measured one, because a spring has no
microslip. Other codes with this law have the same error (MFiX DEM05).

Test 5: the published point at psi = 5.0 is on the line of sliding. With Mindlin's stiffness, and in
the finite elements of the same figure, surfaces stick at the end of the impact if psi is below 5.8
(steel; Maw, Barber & Fawcett 1976). The point has no bar for this reason.
"""


def rows() -> list[Row]:
    """Every comparison of the eight tests."""
    parts = (elastic, restitution, oblique, constant_normal, spinning)
    return [row for part in parts for row in part.rows()]


def figures() -> dict[str, Figure]:
    """The tests as the paper plots them."""
    return {
        "chung_ooi_elastic": elastic.figure(),
        "chung_ooi_restitution": restitution.figure(),
        "chung_ooi_oblique": oblique.figure(),
        "chung_ooi_constant_normal": constant_normal.figure(),
        "chung_ooi_spinning": spinning.figure(),
    }
