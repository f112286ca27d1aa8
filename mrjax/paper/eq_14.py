"""Eq. 14, the wall correction factor: a fit of its coefficients to the original table."""

from collections.abc import Iterator

import numpy as np
from scipy.optimize import least_squares

from mrjax.laws import drag
from mrjax.paper.row import Row, row

HABERMAN_SAYRE_EXACT = {
    0.1: 1.263,
    0.2: 1.680,
    0.3: 2.371,
    0.4: 3.596,
    0.5: 5.970,
    0.6: 11.135,
    0.7: 24.955,
    0.8: 73.555,
}
"""Drag factor of a sphere in a tube, by diameter ratio: the exact solution as tabulated by Haberman
& Sayre (1958), to which Eq. 14 was fitted."""


def rows() -> Iterator[Row]:
    """Yields the rows of the numbers of Eq. 14."""
    coefficient, exponent = _regression()
    source = "section 2.3; least squares on the exact column of Haberman & Sayre (1958)"
    yield row(
        "Eq. 14",
        "coefficient",
        "389.1530",
        coefficient,
        "1",
        f"{source}; the last digits depend on the rounding of that column",
        within=0.005,
    )
    yield row("Eq. 14", "exponent", "7.5593", exponent, "1", source)
    yield row(
        "Eq. 14",
        "upper limit of f_w",
        "48.985",
        float(drag.haberman_sayre(drag.volume_fraction_at(0.8))),
        "1",
        "section 2.3; Haberman & Sayre's rational formula at lambda = 0.8 with five-digit "
        "coefficients; their exact "
        f"column has {HABERMAN_SAYRE_EXACT[0.8]:g} there",
    )


def _regression() -> tuple[float, float]:
    """Returns coefficient and exponent of Eq. 14 by unweighted least squares of a lambda^b + 1."""
    ratio = np.array(list(HABERMAN_SAYRE_EXACT))
    exact = np.array(list(HABERMAN_SAYRE_EXACT.values()))

    def residuals(guess: np.ndarray) -> np.ndarray:
        return guess[0] * ratio ** guess[1] + 1.0 - exact

    fit = least_squares(
        residuals,
        [300.0, 7.0],
        method="lm",
        xtol=1e-12,
        ftol=1e-12,
    )
    return float(fit.x[0]), float(fit.x[1])
