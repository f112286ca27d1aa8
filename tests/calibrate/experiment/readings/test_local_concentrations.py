"""Concentrations at a height by time, and at a time by height, as laboratories write them."""

import numpy as np
import pytest

import mrjax
from calibrate.experiment.readings import local_concentrations
from calibrate.experiment.readings.concentrations import local_fraction
from calibrate.experiment.readings.sheet import LocalSheet
from mrjax.recipe.sheets import validated

HEIGHT = 0.2
TIMES, LEVELS, FRACTIONS = [0.0, 60.0, 150.0], [0.01, 0.02, 0.05], [0.125, 0.25, 0.0]
SOLID = mrjax.Recipe.model_validate(
    {
        "name": "mineral",
        "particle": {"density": 2000.0, "diameter": 1e-5, "material": "mineral"},
        "fluid": {"density": 1000.0, "viscosity": 1e-3},
        "composition": {"volume_fraction": 0.125},
        "drag": {"f_w": 1.0},
    }
)


def read(folder, content, **stated):
    (folder / "c.csv").write_text(content)
    sheet = validated(LocalSheet, {"file": "c.csv"} | stated, "exp.toml")

    def fraction(kind, value):
        return local_fraction(kind, value, SOLID)

    return local_concentrations.read(sheet, folder, fraction, HEIGHT, 0.002)


@pytest.mark.parametrize(
    "content, stated",
    [
        ("time (min), c (g/L)\n0,250\n1,500\n2.5,0\n", {}),
        ("# coil at 5 cm\nt/s;phi\n150;0\n0;0,125\n60;0,25\n", {}),
        ("time\tsolids (wt%)\nmin\t\n0\t22.22222222222222\n1\t40\n2.5\t0\n", {}),
        ("hh:mm:ss,vol%,remark\n00:00:00,12.5,a\n00:01:00,25,\n00:02:30,0,b\n", {}),
        ("time,c\n0,0.125\n1,0.25\n,\n2.5,0\n", {"time_unit": "min", "concentration": "phi"}),
        ("t (min),mudline (cm),phi\n0,20,0.125\n1,15,0.25\n2.5,9,0\n", {}),
        ("t (min),z (cm),phi\n0,5,0.125\n1,5,0.25\n2.5,,0\n", {}),
        ("0 0.125\n1 0.25\n2.5 0\n", {"time_unit": "min", "concentration": "volume fraction"}),
        (
            "t (min),c at 5 cm (kg/m3),c at 9 cm (kg/m3)\n0,250,1\n1,500,2\n2.5,0,3\n",
            {"columns": {"concentration": "c at 5 cm (kg/m3)"}},
        ),
    ],
)
def test_concentrations_by_time_are_read_as_they_are_meant(tmp_path, content, stated):
    found = read(tmp_path, content, height=0.05, **stated)
    np.testing.assert_allclose([one.at for one in found.readings], TIMES)
    np.testing.assert_allclose([one.value for one in found.readings], FRACTIONS, rtol=1e-12)
    assert all(np.isnan(one.error) for one in found.readings)
    assert "at height 0.05 m, mean over 0.002 m" in found.understood.line


@pytest.mark.parametrize(
    "content, stated",
    [
        ("z [cm]; phi\n1; 0,125\n2; 0,25\n5; 0\n", {}),
        ("height above floor (mm),c (g/mL)\n50,0\n10,0.25\n20,0.5\n", {}),
        ("h (%),phi (%)\n5,12.5\n10,25\n25,0\n", {}),
        ("z/H,phi\n0.05,0.125\n0.1,0.25\n0.25,0\n", {}),
        ("position,phi\n1 cm,0.125\n2 cm,0.25\n5 cm,0\n", {"height_unit": "cm"}),
        (
            "depth,x,y\n1,1,0.125\n1,2,0.25\n1,5,0\n",
            {"columns": {"height": "x", "concentration": 3}, "height_unit": "cm",
             "concentration": "volume fraction"},
        ),
    ],
)  # fmt: skip
def test_a_profile_is_read_as_it_is_meant(tmp_path, content, stated):
    found = read(tmp_path, content, time=20, time_unit="min", **stated)
    np.testing.assert_allclose([one.at for one in found.readings], LEVELS)
    np.testing.assert_allclose([one.value for one in found.readings], FRACTIONS, rtol=1e-12)
    assert "at time 20 min" in found.understood.line


def test_errors_are_those_of_volume_fractions(tmp_path):
    """Of 40 +- 1 % by weight of a solid twice as dense: d phi / d w = 2 / (2 - w)^2."""
    found = read(tmp_path, "t (s),c (wt%),sd (wt%)\n0,40,1\n1,0,1\n", height=0.1)
    exact = [0.01 * 2.0 / (2.0 - weight) ** 2 for weight in (0.4, 0.0)]
    np.testing.assert_allclose([one.error for one in found.readings], exact, rtol=1e-5)
    assert found.understood.errors == "stated"
    assert "volume fraction of the particles from weight percent" in found.understood.line
    other = read(tmp_path, "t (s),vol%\n0,10\n1,0\n", height=0.1, standard_deviation=2.0)
    assert other.unit == "%" and "standard deviation 2 %, stated" in other.understood.line


AT = {"height": 0.05}
PROFILE = {"time": 60.0}


@pytest.mark.parametrize(
    "content, stated, words",
    [
        ("t (s),phi\n0,0.1\n1,-0.01\n", AT, ["line 3", "concentration = -0.01 is negative"]),
        ("t (s),phi\n0,0.1\n1,1.2\n", AT, ["line 3", "1.2", "solids alone"]),
        ("t (s),wt%\n0,10\n1,100\n", AT, ["line 3", "100 % by weight", "solids alone"]),
        ("t (s),c (g/L)\n0,10\n1,2100\n", AT, ["line 3", "2100 g/L", "solids alone"]),
        ("t (s),phi\nsoon,0.1\n1,0.1\n", AT, ["line 2", "time = 'soon'", "not a finite number"]),
        ("t,phi\n0,0.1\n1,0.1\n", AT, ["line 2", "has no unit", "time_unit"]),
        ("t (s),phi\n0,0.1\n0,0.1\n", AT, ["at one time alone"]),
        ("t (s),phi\n0,0.1\n", AT, ["has 1 rows of numbers"]),
        ("t (s),c\n0,0.1\n1,0.1\n", AT, ["does not say what its concentrations are"]),
        ("z (cm),phi\n1,0.1\n2,0.1\n", AT, ["the header is", "give time and concentration"]),
        ("t (s),c1 (g/L),c2 (g/L)\n0,1,1\n1,2,1\n", AT, ["may be the concentration", "columns"]),
        ("t (s),c (g/L)\n0,1\n1,2\n", AT | {"concentration": "phi"}, ["is of g/L", "stated"]),
        ("t (s),c (g/L),sd (%)\n0,1,1\n1,2,1\n", AT, ["not in the unit of the concentrations"]),
        ("t (s),phi,sd\n0,0.1,0.01\n1,0.2,\n", AT, ["line 3", "has no standard_deviation"]),
        ("t (s),phi,sd\n0,0.1,0\n1,0.2,1\n", AT, ["line 2", "must be above zero"]),
        ("z (cm),phi\n1,0.1\n21,0.1\n", PROFILE, ["line 3", "0.21 m", "0.2 m"]),
        ("z (cm),phi\n-1,0.1\n2,0.1\n", PROFILE, ["line 2", "not between the floor"]),
        ("z,phi\n1,0.1\n2,0.1\n", PROFILE, ["has no unit", "height_unit"]),
        ("depth (cm),phi\n1,0.1\n2,0.1\n", PROFILE, ["'depth (cm)' is measured from above"]),
        ("z (kg),phi\n1,0.1\n2,0.1\n", PROFILE, ["no unit of a height"]),
        ("z (cm),phi\n1,0.1\n2,0.1\n", PROFILE | {"height_unit": "mm"}, ["is in cm", "stated"]),
        ("z (cm),t (s),phi\n1,60,0.1\n2,60,0.1\n1,70,0.1\n", PROFILE, ["line 4", "'70'", "file"]),
        ("z (cm),t (s),phi\n1,6,0.1\n2,6,0.1\n", PROFILE, ["line 2", "'6'", "the stated time"]),
        ("t (s),z,phi\n1,6,0.1\n2,7,0.1\n", AT, ["line 3", "'7'", "the stated height"]),
        ("t (s),z (cm),phi\n1,6,0.1\n2,6,0.1\n", AT, ["line 2", "the stated height"]),
        ("t (s),sample,phi\n1,A,0.1\n2,B,0.1\n", AT, ["line 3", "'B' comes after 'A'"]),
        ("t (s),phi\n0,0.1\n1,0.2\n", {}, ["height or time: neither is given"]),
        ("t (s),phi\n0,0.1\n1,0.2\n", AT | PROFILE, ["height or time: both are given"]),
        ("z,phi\n0,0.1\n1,0.2\n", PROFILE | {"start": "09:30"}, ["start: is not used"]),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path, content, stated, words):
    with pytest.raises(mrjax.InputError) as refusal:
        read(tmp_path, content, **stated)
    message = str(refusal.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
