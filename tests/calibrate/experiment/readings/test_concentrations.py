"""What a concentration is, as headers and sheets say it, and its volume fraction by hand."""

import numpy as np
import pytest

import mrjax
from calibrate.experiment.readings import concentrations

SOLID, LIQUID = 2500.0, 1000.0


def recipe(**tables) -> mrjax.Recipe:
    bare = {
        "name": "beads",
        "particle": {"density": SOLID, "diameter": 60e-6},
        "fluid": {"density": LIQUID, "viscosity": 1e-3},
        "composition": {"volume_fraction": 0.1},
        "drag": {"f_w": "richardson-zaki"},
    }
    return mrjax.Recipe(**bare | tables)


@pytest.mark.parametrize(
    "written, kind",
    [
        ("phi", "volume fraction"),
        ("Φ", "volume fraction"),
        ("ϕ_s", "volume fraction"),
        ("volume_fraction", "volume fraction"),
        ("Solids volume fraction (-)", "volume fraction"),
        ("c (v/v)", "volume fraction"),
        ("vol%", "volume percent"),
        ("Concentration (% by volume)", "volume percent"),
        ("solids (vol. %)", "volume percent"),
        ("c [% v/v]", "volume percent"),
        ("weight fraction", "weight fraction"),
        ("w/w", "weight fraction"),
        ("mass fraction", "weight fraction"),
        ("wt%", "weight percent"),
        ("Solids, wt %", "weight percent"),
        ("percent by weight", "weight percent"),
        ("c (g/L)", "g/L"),
        ("concentration, kg/m³", "kg/m3"),
        ("kg m-3", "kg/m3"),
        ("mass concentration (g/cm3)", "g/mL"),
        ("TSS mg/l", "mg/L"),
        ("water_kg_per_kg_solid", "liquid ratio"),
        ("kg of solids per kg of water", "solids ratio"),
        ("solid to liquid ratio", "solids ratio"),
        ("concentration", None),
        ("solids (%)", None),
        ("c", None),
        ("velocity", None),
    ],
)
def test_a_header_says_what_its_concentrations_are(written, kind):
    assert concentrations.kind_of(written) == kind
    named = concentrations.names_a_concentration(written)
    assert named == (written != "velocity")


@pytest.mark.parametrize(
    "kind, value",
    [
        ("volume fraction", 0.2),
        ("volume percent", 20.0),
        ("weight fraction", 500.0 / 1300.0),
        ("weight percent", 100.0 * 500.0 / 1300.0),
        ("kg/m3", 500.0),
        ("g/L", 500.0),
        ("g/mL", 0.5),
        ("mg/L", 5e5),
        ("solids ratio", 500.0 / 800.0),
        ("liquid ratio", 800.0 / 500.0),
    ],
)
def test_all_concentrations_of_one_suspension_have_its_volume_fraction(kind, value):
    """In a cubic metre 500 kg of solid and 800 kg of liquid, a fifth of it solid."""
    assert concentrations.volume_fraction(kind, value, recipe()) == pytest.approx(0.2, rel=1e-12)
    assert kind in concentrations.KINDS and f"{value:.4g}" in concentrations.said(kind, value)


def test_a_coating_stays_with_its_particles(case3):
    """The recipe's own weight fraction gives its own volume fraction; half the solid, half each."""
    own = case3.composition
    found = concentrations.volume_fraction("weight fraction", own.particle, case3)
    assert found == pytest.approx(case3.volume_fraction, rel=1e-12)
    weight = own.particle / 2.0
    coating = own.coating / 2.0
    solid = weight / case3.particle.density
    rest = (1.0 - weight - coating) / case3.fluid.density + coating / case3.coating.density
    found = concentrations.volume_fraction("weight fraction", weight, case3)
    assert found == pytest.approx(solid / (solid + rest), rel=1e-12)


@pytest.mark.parametrize(
    "kind, value, words",
    [
        ("volume fraction", 5.4, ["volume fraction 5.4", "not the volume fraction"]),
        ("volume fraction", 0.65, ["0.65", "0.64 by volume"]),
        ("weight fraction", 12.0, ["weight fraction 12", "denser"]),
        ("g/L", 2000.0, ["2000 g/L, a volume fraction of 0.8,"]),
        ("liquid ratio", 0.01, ["0.01 kg of liquid", "a volume fraction of 0.976"]),
    ],
)
def test_what_no_suspension_has_is_refused(kind, value, words):
    with pytest.raises(mrjax.InputError) as refusal:
        concentrations.volume_fraction(kind, value, recipe())
    for word in words:
        assert word in str(refusal.value)


def test_a_small_concentration_is_one():
    found = concentrations.volume_fraction("mg/L", 10.0, recipe())
    np.testing.assert_allclose(found, 10.0e-3 / SOLID, rtol=1e-12)
