"""DEM06: a grain settles at its terminal velocity."""

import numpy as np

import mrjax

from .. import impacts
from ..reference import Material
from ..row import Row, worst
from .columns import GRAVITY

CASE = "MFiX DEM06"
SAND = Material(modulus=1e9, poisson=0.3, density=2000.0)
RADIUS, OIL, THICK = 50e-6, 950.0, 0.1  # m, kg/m^3, Pa s


def rows() -> list[Row]:
    """A grain in oil instead of air: Stokes' drag needs a low Reynolds number."""
    parameters = mrjax.Parameters(
        radius=RADIUS,
        **{name: float(value) for name, (value,) in impacts.solids([SAND]).items()},
        fluid_density=OIL,
        viscosity=THICK,
        gravity=GRAVITY,
    ).astype(float)
    # Eq. 13 with the added mass of half the displaced fluid.
    rate = 9.0 * THICK / ((2.0 * SAND.density + OIL) * RADIUS**2)
    terminal = 2.0 * (SAND.density - OIL) * GRAVITY * RADIUS**2 / (9.0 * THICK)
    run = mrjax.simulate(
        mrjax.place([[10 * RADIUS, 10 * RADIUS, 15 * RADIUS]]),
        parameters,
        mrjax.Box((20 * RADIUS,) * 3),
        duration=20.0 / rate,
        frames=20,
        time_step=0.1 / rate,
    )
    times = np.asarray(run.times)[1:]
    return [
        Row(
            CASE,
            "terminal velocity of Eq. 27, as the package states it",
            terminal,
            float(mrjax.terminal_velocity(parameters)),
            "m/s",
            1e-9,
            "Stokes: 2 (rho_p - rho_f) g R^2 / (9 mu)",
        ),
        worst(
            CASE,
            "velocity from rest",
            rate * times,
            -terminal * np.expm1(-rate * times),
            np.asarray(run.mean_velocity)[1:],
            name="{:.0f} relaxation times",
            unit="m/s",
            bar=1e-9,
            source="Stokes with added mass: exponential approach",
        ),
    ]
