"""Measured curves from CSV files: read as declared; every fault in a line with file and remedy."""

import numpy as np
import pytest

import mrjax
from calibrate.experiment import curve
from calibrate.experiment.curve import CurveSheet

SHEET = {"file": "curve.csv", "time_unit": "day", "unit": "mm", "standard_deviation": 0.5}


def read(folder, text, encoding="utf-8", **changes):
    (folder / "curve.csv").write_bytes(text.encode(encoding))
    return curve.read(CurveSheet(**{**SHEET, **changes}), folder)


def test_units_are_those_declared(tmp_path):
    found = read(tmp_path, "time,mudline\n0,100\n1.5,92\n")
    assert found.observable == "mudline"
    np.testing.assert_allclose(found.times, [0.0, 1.5 * 86400])
    assert (found.values, found.errors) == ([100.0, 92.0], [0.5, 0.5])
    assert (found.unit, found.si) == ("mm", 1e-3)
    ratio = read(tmp_path, "time,sedimentation_ratio\n1,98\n2,90\n", time_unit="h", unit="%")
    assert (ratio.observable, ratio.si, ratio.times) == ("sedimentation_ratio", 0.01, [3600, 7200])


def test_columns_in_any_order_with_errors_of_their_own(tmp_path):
    found = read(
        tmp_path,
        "# read by eye\nstandard_deviation, time , mudline\n0.1,1,90\n\n0.3,2,80\n",
        standard_deviation=None,
    )
    assert (found.values, found.errors) == ([90.0, 80.0], [0.1, 0.3])


def test_a_byte_order_mark_is_no_fault(tmp_path):
    assert read(tmp_path, "time,mudline\r\n0,100\r\n1,90\r\n", "utf-8-sig").values == [100.0, 90.0]


@pytest.mark.parametrize(
    "text, words",
    [
        ("time,mudline\n1,90\n1,95\n", ["one time alone", "a second time"]),
        ("time,mudline\n1,90\n2,-5\n", ["line 3", "mudline = -5 is negative"]),
        ("time,mudline\n-1,90\n2,5\n", ["line 2", "time = -1 is negative"]),
        ("time,mudline\n1,90\n2,inf\n", ["line 3", "mudline = 'inf'", "leave empty"]),
        ("time,mudline\n1,90\n2,nan\n", ["1 rows", "at least 2"]),
        ("time,mudline\n1,90\n2,\n", ["1 rows", "at least 2"]),
        ("time,mudline\n1,90\n\n2,8O\n", ["line 4", "mudline = '8O'"]),
        ("time,mudline\n1,5,90,2\n2,80\n", ["line 2", "4 cells for 2 columns", "point"]),
        ('time,mudline\n"1,500",90\n2,80\n', ["line 2", "time = '1,500'", "write 1500"]),
        ("time,width\n1,90\n2,80\n", ["line 1", "time, width", "mudline"]),
        ("time\n1\n2\n", ["line 1", "the header is time", "mudline or sedimentation_ratio"]),
        ("1,90,5\n2,80,5\n", ["line 1", "3 columns and no header"]),
        ("", ["line 1", "missing"]),
        ("time,mudline\n1,90\n1e308,80\n", ["line 3", "time = 1e+308", "between 1e-30 and 1e30"]),
        ("time,mudline\n1,90\n", ["1 rows", "at least 2"]),
        ("time,mudline,standard_deviation\n1,90,0\n2,80,1\n", ["line 2", "= 0", "above zero"]),
        ("time,sedimentation_ratio\n1,0.9\n2,0.8\n", ["unit = 'mm'", "1, %"]),
    ],
)
def test_a_fault_is_one_line_with_its_place_and_remedy(tmp_path, text, words):
    with pytest.raises(mrjax.InputError) as refusal:
        read(tmp_path, text)
    message = str(refusal.value)
    assert "curve.csv" in message and "\n" not in message
    for word in words:
        assert word in message


def test_what_was_refused_once_is_read(tmp_path):
    """Unsorted rows, semicolons, decimal commas, another name, no header."""
    for text in (
        "time,mudline\n2,90\n1.5,95\n",
        "time;mudline\n1,5;95\n2;90\n",
        'time,mudline\n"1,5",95\n2,90\n',
        "time,height\n1.5,95\n2,90\n",
        "1.5,95\n2,90\n",
    ):
        found = read(tmp_path, text)
        assert found.times == [1.5 * 86400, 2 * 86400] and found.values == [95.0, 90.0]


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(mrjax.InputError, match=r"curve.csv: no such file"):
        curve.read(CurveSheet(**SHEET), tmp_path)
    with pytest.raises(mrjax.InputError, match=r"latin.csv: is not text in UTF-8"):
        (tmp_path / "latin.csv").write_bytes("time,höhe\n1,90\n2,80\n".encode("latin-1"))
        sheet = SHEET | {"file": "latin.csv", "encoding": "utf-8"}
        curve.read(CurveSheet(**sheet), tmp_path)
    with pytest.raises(mrjax.InputError, match="no point has an error"):
        read(tmp_path, "time,mudline\n1,90\n2,80\n", standard_deviation=None)
