"""Units of velocities in all spellings, and powers of ten before them."""

import pytest

from calibrate.experiment.velocity_units import VelocityUnit, parted, velocity_unit


@pytest.mark.parametrize(
    "written, unit, factor",
    [
        ("cm/s", "cm/s", 1.0),
        ("CM / S", "cm/s", 1.0),
        ("cm per second", "cm/s", 1.0),
        ("cm s-1", "cm/s", 1.0),
        ("cm s^-1", "cm/s", 1.0),
        ("cm·s⁻¹", "cm/s", 1.0),
        ("µm/s", "um/s", 1.0),
        ("mm/d", "mm/day", 1.0),
        ("m h-1", "m/h", 1.0),
        ("inches per minute", "in/min", 1.0),
        ("1e-2 cm/s", "cm/s", 1e-2),
        ("1e-2_cm_per_s", "cm/s", 1e-2),
        ("10^-5 m/s", "m/s", 1e-5),
        ("10-5 m/s", "m/s", 1e-5),
        ("10⁻⁵ m/s", "m/s", 1e-5),
        ("x 10^(-5) m/s", "m/s", 1e-5),
        ("10^3 um/s", "um/s", 1e3),
    ],
)
def test_a_unit_of_velocity_has_many_spellings(written, unit, factor):
    assert velocity_unit(written) == VelocityUnit(unit, factor)
    assert velocity_unit(VelocityUnit(unit, factor).written) == VelocityUnit(unit, factor)


@pytest.mark.parametrize("written", ["", "m", "s", "mm", "m/kg", "rpm", "m2/s", "mm/fortnight"])
def test_what_is_no_length_over_a_time_is_no_unit(written):
    assert velocity_unit(written) is None


@pytest.mark.parametrize(
    "written, name",
    [
        ("velocity (mm/h)", "velocity"),
        ("flux_1e-2_cm_per_s", "flux"),
        ("Settling velocity, m/s", "settling velocity"),
        ("v/(mm/s)", "v"),
        ("u [10⁻³ m s⁻¹]", "u"),
    ],
)
def test_a_header_is_parted_into_name_and_unit(written, name):
    found, unit = parted(written)
    assert found == name and unit is not None


def test_one_unit_is_a_length_over_a_time():
    assert velocity_unit("mm/h").si == pytest.approx(1e-3 / 3600.0, rel=1e-15)
    assert parted("volume fraction") == ("volume fraction", None)
