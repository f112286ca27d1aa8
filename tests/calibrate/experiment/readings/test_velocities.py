"""Tables of velocities as laboratories have them: three rows, written in many ways."""

import numpy as np
import pytest

import mrjax
from calibrate.experiment.readings import velocities
from calibrate.experiment.readings.sheet import VelocitiesSheet
from mrjax.recipe.sheets import validated

FRACTIONS, VELOCITIES = [0.05, 0.1, 0.2], [2e-3, 1.5e-3, 0.8e-3]
SOLID = 2000.0


def fraction(kind: str, value: float) -> float:
    """Of a solid of 2000 kg/m3."""
    return {"volume fraction": value, "volume percent": value / 100.0, "g/L": value / SOLID}[kind]


def read(folder, content, name="v.csv", **stated):
    data = content if isinstance(content, bytes) else content.encode()
    (folder / name).write_bytes(data)
    sheet = validated(VelocitiesSheet, {"file": name} | stated, "exp.toml")
    return velocities.read(sheet, folder, fraction)


@pytest.mark.parametrize(
    "content, stated",
    [
        ("phi,v (mm/s)\n0.05,2\n0.1,1.5\n0.2,0.8\n", {}),
        ("volume_fraction;velocity [mm/s]\n0,05;2\n0,1;1,5\n0,2;0,8\n", {}),
        ("# a table\n\nvol% | u (1e-3 m/s)\n5 | 2\n10 | 1.5\n20 | 0.8\n", {}),
        ("c (g/L)\tsettling velocity (cm/s)\n100\t0.2\n200\t0.15\n400\t0.08\n", {}),
        ("velocity (mm/s),remark,phi\n2,first,0.05\n1.5,,0.1\n0.8,,0.2\n", {}),
        ("phi,v\n-,mm/s\n0.05,2\n0.1,1.5\n0.2,0.8\n", {}),
        ("phi,v\n0.05,2\n0.1,1.5\n0.2,0.8\n", {"unit": "mm/s"}),
        ("phi,v\n0.05,2\n0.1,1.5\n0.2,0.8\n", {"unit": "1e-3 m per second"}),
        ("c,v (mm/s)\n5,2\n10,1.5\n20,0.8\n", {"concentration": "vol %"}),
        ("5%,2\n10%,1.5\n20%,0.8\n", {"unit": "mm/s", "concentration": "volume percent"}),
        ("phi,flux (mm/s)\n0.05,0.1\n0.1,0.15\n0.2,0.16\n", {}),
        ("phi,flux_1e-2_mm_per_s\n0,0\n0.05,10\n0.1,15\n0.2,16\n", {}),
        ("phi,j (mm/s)\n0.05,0.1\n0.1,0.15\n0.2,0.16\n", {"quantity": "flux"}),
        (
            "a,b,c (mm/s)\n0.05,9,2\n0.1,9,1.5\n0.2,9,0.8\n",
            {"columns": {"concentration": "a", "velocity": 3}, "concentration": "phi"},
        ),
        (
            "phi,c (g/L),v (mm/s)\n0.05,100,2\n0.1,200,1.5\n0.2,400,0.8\n",
            {"concentration": "g/L"},
        ),
    ],
)
def test_a_table_is_read_as_it_is_meant(tmp_path, content, stated):
    found = read(tmp_path, content, **stated)
    np.testing.assert_allclose([one.volume_fraction for one in found.readings], FRACTIONS)
    si = [one.value * found.unit.si for one in found.readings]
    np.testing.assert_allclose(si, VELOCITIES, rtol=1e-12)
    assert found.understood.errors == "estimated" and found.unit.factor == 1.0
    assert all(np.isnan(one.error) for one in found.readings)


@pytest.mark.parametrize(
    "content, stated",
    [
        ("phi,v (mm/s),sd\n0.05,2,0.02\n0.1,1.5,0.015\n", {}),
        ("phi,v (mm/s),error (%)\n0.05,2,1\n0.1,1.5,1\n", {}),
        ("phi,v (mm/s),± (um/s)\n0.05,2,20\n0.1,1.5,15\n", {}),
        ("phi,v (mm/s)\n0.05,2\n0.1,1.5\n", {"relative_standard_deviation": 0.01}),
        ("phi,flux (mm/s)\n0.05,0.1\n0.1,0.15\n", {"relative_standard_deviation": 0.01}),
        ("phi,flux (mm/s),sd\n0.05,0.1,0.001\n0.1,0.15,0.0015\n", {}),
    ],
)
def test_stated_errors_are_those_of_the_velocities(tmp_path, content, stated):
    found = read(tmp_path, content, **stated)
    np.testing.assert_allclose([one.error for one in found.readings], [0.02, 0.015], rtol=1e-12)
    assert found.understood.errors == "stated"
    assert "standard deviation 0.015 to 0.02 mm/s, stated" in found.understood.line


def test_one_error_may_be_stated_for_all(tmp_path):
    found = read(tmp_path, "phi,v (mm/s)\n0.1,2\n0.2,1.5\n", standard_deviation=0.1)
    assert [one.error for one in found.readings] == [0.1, 0.1]


def test_repeats_are_rows_or_columns(tmp_path):
    found = read(tmp_path, "phi,v1 (mm/s),v2 (mm/s)\n0.1,2,2.1\n0.2,1.5,\n0.1,2.2,\n")
    said = [(one.volume_fraction, one.value, one.row) for one in found.readings]
    assert said == [(0.1, 2.0, 2), (0.1, 2.1, 2), (0.2, 1.5, 3), (0.1, 2.2, 4)]


def test_what_was_understood_is_one_line(tmp_path):
    found = read(tmp_path, "phi;flux (cm/s);T\n0,05;0,01;20\n0,1;-;20\n0,2;0,016;20\n")
    assert found.understood.line == (
        "'v.csv' (UTF-8, semicolons, decimal commas): volume fraction from 'phi', velocity as flux "
        "over volume fraction, in cm/s, from 'flux (cm/s)'; 2 readings, 0.2 cm/s at volume "
        "fraction 0.05 to 0.08 cm/s at volume fraction 0.2; relative scatter to be estimated; not "
        "used: 'T'; without a reading: line 3"
    )
    table = found.understood.table()
    assert (table["quantity"], table["concentration"]) == ("flux", "volume fraction")


def test_a_workbook_is_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["notes"])
    sheet = book.create_sheet("beads")
    for row in (["phi", "v (mm/s)"], [0.05, 2], [0.1, 1.5], [0.2, 0.8]):
        sheet.append(row)
    book.save(tmp_path / "v.xlsx")
    found = read(tmp_path, (tmp_path / "v.xlsx").read_bytes(), name="v.xlsx")
    assert [one.value for one in found.readings] == [2.0, 1.5, 0.8]


@pytest.mark.parametrize(
    "content, stated, words",
    [
        ("phi,v\n0.1,2\n0.2,1\n", {}, ["line 1", "'v' has no unit of a velocity", "give unit"]),
        ("c,v (mm/s)\n1,2\n2,1\n", {}, ["line 1", "'c' does not say", "state concentration"]),
        ("x,y\n1,2\n2,1\n", {}, ["'x, y'", "velocity or flux", "columns = {"]),
        ("0.1,2,3\n0.2,1,3\n", {}, ["line 1", "the header is missing"]),
        ("phi,v (mm/s)\n0.1,2\n", {}, ["1 rows of numbers", "at least 2"]),
        ("phi,v (mm/s)\n0.1,2\n0.2,0\n", {}, ["line 3", "velocity = 0 must be above zero"]),
        ("phi,v (mm/s)\n0.1,2\n-0.2,1\n", {}, ["line 3", "concentration = -0.2", "above zero"]),
        ("phi,v (mm/s)\n0.1,2\n0.2,x\n", {}, ["line 3", "velocity = 'x'", "finite number"]),
        ("phi,v (mm/s)\n0.1,2\n0.2,1,5\n", {}, ["line 3", "3 cells for 2 columns"]),
        ("phi,v (mm/s),sd\n0.1,2,1\n0.2,1,\n", {}, ["line 3", "no standard_deviation"]),
        ("phi,v (mm/s),sd\n0.1,2,1\n0.2,1,0\n", {}, ["line 3", "above zero"]),
        ("phi,v (mm/s)\n0.1,2\n0.2,1\n", {"unit": "cm/s"}, ["mm/s, and unit = 'cm/s'", "mend"]),
        ("phi,flux (mm/s)\n0.1,2\n0.2,1\n", {"quantity": "velocity"}, ["'flux (mm/s)' is a flux"]),
        ("vol%,v (mm/s)\n1,2\n2,1\n", {"concentration": "phi"}, ["volume percent", "'volume frac"]),
        ("phi,v (mm/s),u (cm/s)\n1,2,3\n2,1,3\n", {}, ["may be the velocity", "state columns"]),
        ("phi,vol%,v (mm/s)\n1,2,3\n2,1,3\n", {}, ["may be the concentration", "state columns"]),
        ("phi,v (mm/s)\n1,2\n2,1\n", {"columns": {"velocity": "w"}}, ["no column", "'v (mm/s)'"]),
        ("phi,v (mm/s)\n1,2\n2,1\n", {"unit": "mm"}, ["unit = 'mm'", "a length over a time"]),
        ("phi,v (mm/s)\n1,2\n2,1\n", {"concentration": "pH"}, ["concentration = 'pH'", "g/L"]),
        (
            "phi,v (mm/s)\n1,2\n2,1\n",
            {"standard_deviation": 0.1, "relative_standard_deviation": 0.1},
            ["keep one"],
        ),
        (
            "phi,v (mm/s)\n1,2\n2,1\n",
            {"quantity": "flux", "columns": {"velocity": "v"}},
            ["both velocity and flux"],
        ),
    ],
)
def test_a_fault_is_one_line_with_its_place_and_remedy(tmp_path, content, stated, words):
    with pytest.raises(mrjax.InputError) as refusal:
        read(tmp_path, content, **stated)
    message = str(refusal.value)
    assert "\n" not in message and len(message) < 400
    for word in words:
        assert word in message, message


def test_a_concentration_that_cannot_be_names_its_row(tmp_path):
    def refuse(kind, value):
        raise mrjax.InputError("too dense")

    (tmp_path / "v.csv").write_text("phi,v (mm/s)\n0.1,2\n0.2,1\n")
    with pytest.raises(mrjax.InputError, match=r"v\.csv, line 2: too dense"):
        velocities.read(VelocitiesSheet(file="v.csv"), tmp_path, refuse)
