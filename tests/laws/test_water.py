"""Density and viscosity of water against tables, and their slopes."""

import jax
import jax.numpy as jnp
import pytest

from mrjax.laws import water

PERRY = [  # K, mol/dm^3, uPa s
    (280.0, 55.501, 1433.7),
    (290.0, 55.440, 1084.0),
    (300.0, 55.315, 853.84),
    (310.0, 55.139, 693.54),
    (320.0, 54.919, 577.02),
    (340.0, 54.371, 421.97),
    (360.0, 53.698, 326.10),
]
"""Saturated liquid, Perry's Chemical Engineers' Handbook, 9th ed., Table 2-135 (IAPWS-95)."""
MOLAR_MASS = 18.015268
"""g/mol, of IAPWS-95."""


@pytest.mark.parametrize("temperature, molar, viscosity", PERRY)
def test_water_is_that_of_the_tables(temperature, molar, viscosity):
    """The table is at the vapour pressure, 0.1 MPa below: 5e-5 of the density; and of 5 digits."""
    assert water.density(temperature) == pytest.approx(molar * MOLAR_MASS, rel=7e-5)
    # The release holds to 1 %; the table, of another formulation, is within 8e-4 of it.
    assert 1e6 * water.viscosity(temperature) == pytest.approx(viscosity, rel=1e-3)


@pytest.mark.parametrize(
    "celsius, density",
    [(0.0, 999.843), (4.0, 999.975), (20.0, 998.207), (25.0, 997.047), (40.0, 992.216)],
)
def test_density_is_that_of_the_standard_for_calibration(celsius, density):
    """Tanaka et al. (2001), Metrologia 38, 301, whose scale of temperature is the newer ITS-90."""
    assert water.density(273.15 + celsius) == pytest.approx(density, abs=4e-3)


def test_water_is_densest_at_four_degrees():
    slope = jax.grad(water.density)
    assert float(slope(jnp.asarray(273.15 + 3.95))) > 0.0 > float(slope(jnp.asarray(273.15 + 4.05)))


@pytest.mark.parametrize("law", [water.density, water.viscosity])
@pytest.mark.parametrize("temperature", [275.0, 293.15, 350.0])
def test_slopes_are_those_of_central_differences(law, temperature):
    step = 1e-3
    expected = (law(temperature + step) - law(temperature - step)) / (2.0 * step)
    assert float(jax.grad(law)(jnp.asarray(temperature))) == pytest.approx(expected, rel=1e-6)
