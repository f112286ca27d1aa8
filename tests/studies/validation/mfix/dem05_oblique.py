"""DEM05: oblique impacts, beside MFiX and measurements."""

from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import kharaz, reference
from ..chung_ooi.common import ALUMINA, SLIDING, SLIDING_BAR
from ..kharaz import UNITS, Oblique
from ..reference import Material
from ..row import Row, worst

CASE, READING = "MFiX DEM05", "mfix_dem05.toml"
SODA_LIME = Material(modulus=70e9, poisson=0.25, density=np.inf)
MFIX_BAR = 1e-2
DEPARTURE_BAR = 5e-2
"""Of the departure from the measurements: what half a percent of e_t is to a departure of 0.1."""


@cache
def theirs() -> dict[str, np.ndarray]:
    """Angles of impact and what MFiX computes with its Hertzian model, particle against wall."""
    return {key: np.array(of) for key, of in reference.load(READING)["mfix"].items()}


@cache
def ours() -> Oblique:
    """The same impacts: of aluminium oxide on glass, without damping."""
    angle = theirs()["angle"]
    return kharaz.simulated([ALUMINA] * len(angle), angle, restitution=1.0, wall=SODA_LIME)


def rows() -> list[Row]:
    """Against MFiX at all angles, gross sliding above 33 degrees, and the measurements.

    Friction acts at R - d from the centre in MFiX and at R - d/2 here: 0.5 % of the tangential
    restitution where the surfaces stick, 0.2 % of the spin where they slide.

    Below 8 degrees both codes stick, while the spheres were measured to lose a quarter of their
    tangential velocity; a spring has no microslip. The measurements at all angles are therefore
    compared through their root mean square departure from either code.
    """
    return [row for quantity in UNITS for row in _rows(quantity)]


def _rows(quantity: str) -> list[Row]:
    angle, words = ours().angle, kharaz.words(quantity)
    our, their = getattr(ours(), quantity), theirs()[quantity]
    sliding = kharaz.slides(angle, restitution=1.0)
    slid = getattr(kharaz.slid(angle, restitution=1.0), quantity)
    at, measured = kharaz.measured(READING)[quantity]
    their_departure, our_departure = (
        float(np.sqrt(np.mean((np.interp(at, angle, of) - measured) ** 2))) for of in (their, our)
    )
    spins = quantity == "spin"  # which vanish at normal incidence
    common = dict(name="{:.1f} deg", unit=UNITS[quantity])
    return [
        worst(
            CASE,
            words,
            angle,
            their,
            our,
            bar=MFIX_BAR,
            source="MFiX 21.3, Hertzian" + ("; over the greatest spin" if spins else ""),
            scale=float(np.abs(their).max()) if spins else None,
            **common,
        ),
        worst(
            CASE,
            f"{words}, sliding",
            angle[sliding],
            slid[sliding],
            our[sliding],
            bar=SLIDING_BAR,
            source=SLIDING,
            **common,
        ),
        Row(
            CASE,
            f"{words}, rms departure from {len(at)} measurements",
            their_departure,
            our_departure,
            UNITS[quantity],
            DEPARTURE_BAR,
            "the departure of MFiX from Kharaz et al. (2001)",
        ),
    ]


def figure() -> Figure:
    """Tangential restitution, spin and rebound angle of the centre against impact angle."""
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    panels = kharaz.panels(figure, *UNITS, widest=67)
    for quantity, axes in panels.items():
        axes.plot(theirs()["angle"], theirs()[quantity], color="0.75", linewidth=4, label="MFiX")
        axes.plot(ours().angle, getattr(ours(), quantity), "k-", linewidth=1, label="computed")
        axes.plot(*kharaz.measured(READING)[quantity], "ko", ms=5, mfc="w", label="measured")
    entries = panels["spin"].get_legend_handles_labels()
    figure.legend(*entries, frameon=False, loc="outside upper center", ncols=3)
    return figure
