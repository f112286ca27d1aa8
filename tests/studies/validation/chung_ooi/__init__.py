"""The eight benchmark tests of Chung & Ooi, Granular Matter 13:643 (2011).

Angles of impact are from the normal. Spins are about y where a sphere moves along x above its
partner; theirs in test 4 has the other sign.
"""

from matplotlib.figure import Figure

from ..row import Row
from . import constant_normal, elastic, oblique, restitution, spinning

NOTE = """\
Angles are from the normal. "The published law, integrated" is an integration that does not use the
package.

Test 4: errors of measured rows are parts of the tangential impulse, and the bar is two standard
deviations of the scatter that the measurements have where the spheres slide. Near 20 degrees, where
they stick, the computed impulse is 6 to 8 % less than the measured one: a spring has no microslip,
and other codes with this law find the same (MFiX DEM05).

Test 5: the published point at psi = 5.0 is on the line of sliding. With Mindlin's stiffness the
surfaces stick at the end below 5.8 (steel; Maw, Barber & Fawcett 1976), as they do in the finite
elements of the same figure: no bar is asked.
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
