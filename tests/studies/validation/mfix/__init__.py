"""The test cases DEM01 to DEM06 of MFiX, with Hertz' law in place of its linear spring.

Set-ups are those of its verification manual and input files (MFiX 21.3), as far as a linear spring
is not part of them. Where that has a closed form and Hertz' law has not, the reference is an
integration by an explicit Runge-Kutta method of order 8 (DOP853), without the package.
"""

from matplotlib.figure import Figure

from ..row import Row
from . import (
    dem01_falling,
    dem02_bouncing,
    dem03_stacked,
    dem04_slipping,
    dem05_oblique,
    dem06_terminal,
)

NOTE = """\
The cases are those of MFiX, with Hertz' law in place of its linear spring. If only the linear
spring has a closed form, the reference is an integration of Hertz' law by a Runge-Kutta method of
order 8 (DOP853) that does not use the package.

DEM05: angles are measured from the normal. At the smallest angles the spheres stick, and both codes
depart from the measurements, because a spring has no microslip. The rows therefore compare the root
mean square of this departure in MFiX with that of mrjax.
"""


def rows() -> list[Row]:
    """Every comparison of the six cases."""
    cases = (
        dem01_falling,
        dem02_bouncing,
        dem03_stacked,
        dem04_slipping,
        dem05_oblique,
        dem06_terminal,
    )
    return [row for case in cases for row in case.rows()]


def figures() -> dict[str, Figure]:
    """The cases as the manual plots them."""
    return {
        "mfix_dem01_falling": dem01_falling.figure(),
        "mfix_dem02_bouncing": dem02_bouncing.figure(),
        "mfix_dem03_stacked": dem03_stacked.figure(),
        "mfix_dem04_slipping": dem04_slipping.figure(),
        "mfix_dem05_oblique": dem05_oblique.figure(),
    }
