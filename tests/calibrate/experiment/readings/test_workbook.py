"""Workbooks of spreadsheets: the same readings as in a text, and faults in one line."""

import datetime
import io
import sys
import zipfile

import numpy as np
import openpyxl
import pytest

import mrjax
from calibrate.experiment.readings import workbook
from tests.calibrate.experiment.readings.test_ordinary_files import heights, read
from tests.calibrate.experiment.readings.test_wrong_files import refusal

HEAD = ["Time (min)", "h (mm)"]
ROWS = [HEAD, [0, 760], [1, 701.0], [2, 656]]


def book(**sheets) -> bytes:
    """A workbook of sheets by their names, each a list of rows."""
    made = openpyxl.Workbook()
    made.remove(made.active)
    for name, rows in sheets.items():
        sheet = made.create_sheet(name)
        for row in rows:
            sheet.append(row)
    saved = io.BytesIO()
    made.save(saved)
    return saved.getvalue()


@pytest.mark.parametrize(
    "sheets, stated",
    [
        ({"Data": ROWS}, {}),
        ({"Data": ROWS, "Empty": []}, {}),
        ({"Notes": [["read by eye"], ["shaken twice"]], "Data": ROWS}, {}),
        ({"A": ROWS, "B": ROWS}, {"sheet": "B"}),
        ({"A": [["x"]], "B": ROWS}, {"sheet": 2}),
        ({"Data": [["Sample A"], [], *ROWS]}, {}),
        ({"Data": [[None, *row] for row in ROWS]}, {}),
        ({"Data": [HEAD, [0, 760], [0.5, None], [0.7, "-"], [1, 701], [2, 656]]}, {}),
        ({"Data": [HEAD, ["0", "760"], ["1,0", "701,0"], ["2", "656"]]}, {}),
        ({"Data": [["t", "h"], [0, 760], [1, 701], [2, 656]]}, {"time_unit": "min", "unit": "mm"}),
        (
            {
                "Data": [
                    ["date", "h (mm)"],
                    [datetime.datetime(2024, 2, 1, 9, 30), 760],
                    [datetime.datetime(2024, 2, 1, 9, 31), 701],
                    [datetime.datetime(2024, 2, 1, 9, 32), 656],
                ]
            },
            {},
        ),
        (
            {
                "Data": [
                    ["time", "h (mm)"],
                    [datetime.time(0, 0), 760],
                    [datetime.time(0, 1), 701],
                    [datetime.time(0, 2), 656],
                ]
            },
            {},
        ),
        (
            {
                "Data": [
                    ["date", "time", "h (mm)"],
                    [datetime.date(2024, 2, 1), datetime.time(9, 30), 760],
                    [datetime.date(2024, 2, 1), datetime.time(9, 31), 701],
                    [datetime.date(2024, 2, 1), datetime.time(9, 32), 656],
                ]
            },
            {},
        ),
    ],
)
def test_a_workbook_is_read_as_its_text_would_be(tmp_path, sheets, stated):
    found = read(tmp_path, book(**sheets), name="a.xlsx", **stated)
    np.testing.assert_allclose(found.times, [0.0, 60.0, 120.0], atol=1e-3)
    np.testing.assert_allclose(heights(found), [0.760, 0.701, 0.656])


def test_elapsed_times_beyond_a_day(tmp_path):
    hours = [datetime.timedelta(hours=one, minutes=30) for one in (0, 23, 47)]
    content = book(Data=[["time", "h (mm)"], *zip(hours, (760, 701, 656), strict=True)])
    found = read(tmp_path, content, name="a.xlsx")
    assert found.times == [1800.0, 84600.0, 171000.0]


def test_elapsed_times_that_a_clock_shows(tmp_path):
    """A number of days in the format of a clock: beyond a day it comes as a date of 1900."""
    made = openpyxl.Workbook()
    for row in (["time", "h (mm)"], [0.25, 760], [1.5, 701], [59.75, 690], [75.0, 656]):
        made.active.append(row)
    for cell in made.active["A"]:
        cell.number_format = "hh:mm:ss"
    saved = io.BytesIO()
    made.save(saved)
    found = read(tmp_path, saved.getvalue(), name="a.xlsx")
    np.testing.assert_allclose(np.array(found.times) / 86400.0, [0.25, 1.5, 59.75, 75.0])


def test_cells_shown_in_percent_are_percent(tmp_path):
    made = openpyxl.Workbook()
    for row in (["time (min)", "ratio"], [0, 1.0], [1, 0.925]):
        made.active.append(row)
    for cell in made.active["B"]:
        cell.number_format = "0%"
    saved = io.BytesIO()
    made.save(saved)
    found = read(tmp_path, saved.getvalue(), name="a.xlsx")
    assert (found.unit, found.values) == ("%", [100.0, 92.5])


def test_the_line_names_the_sheet_and_its_rows(tmp_path):
    content = book(Chalk=[["Sample A"], HEAD, [0, 760], [1, None], [2, 656]])
    found = read(tmp_path, content, name="a.xlsx")
    assert found.rows == [3, 5]
    assert found.understood.line.startswith("'a.xlsx' (Chalk): time in min from 'Time (min)'")
    assert "without a reading: row 4" in found.understood.line


@pytest.mark.parametrize(
    "sheets, stated, words",
    [
        ({"A": ROWS, "B": ROWS}, {}, ["several sheets of readings", "'A', 'B'", "state sheet"]),
        ({"A": [["x", "y"]], "B": [["z"]]}, {}, ["no sheet with a time and a mudline"]),
        ({"A": ROWS}, {"sheet": "C"}, ["no sheet = 'C'", "'A'"]),
        ({"A": ROWS}, {"sheet": 2}, ["no sheet = 2"]),
        ({"A": ROWS}, {"delimiter": ","}, ["delimiter is stated"]),
        ({"A": ROWS}, {"encoding": "utf-8"}, ["encoding is stated"]),
        ({"A": []}, {}, ["the header is missing"]),
        ({"A": [HEAD, [0, 760], [1, "<701"]]}, {}, ["sheet 'A', row 3", "'<701'"]),
        ({"A": [HEAD, [0, 760], [1, True]]}, {}, ["row 3", "'True'"]),
        ({"A": [HEAD, [0, 760], [1, "1,701"]]}, {}, ["row 3", "'1,701'", "1701"]),
    ],
)
def test_a_fault_of_a_workbook_names_sheet_and_row(tmp_path, sheets, stated, words):
    message = refusal(tmp_path, book(**sheets), name="a.xlsx", **stated)
    for word in words:
        assert word in message, message


def test_a_damaged_workbook_is_one_line(tmp_path):
    whole = book(A=ROWS)
    for place in range(30, len(whole), 211):
        for damaged in (whole[:place], whole[:place] + b"\xff\0" + whole[place + 2 :]):
            try:
                read(tmp_path, damaged, name="a.xlsx")
            except mrjax.InputError as error:
                assert str(error).isprintable()


def test_another_archive_is_no_workbook(tmp_path):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("content.xml", "x")
    assert "cannot be read as a workbook" in refusal(tmp_path, packed.getvalue(), name="a.ods")


def test_a_workbook_that_grows_without_measure_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(workbook, "MOST_UNPACKED", 1000)
    assert "is larger than 0.001 MB unpacked" in refusal(tmp_path, book(A=ROWS), name="a.xlsx")


def test_without_the_package_its_name_is_told(tmp_path, monkeypatch):
    content = book(A=ROWS)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert "pip install 'mrjax[xlsx]'" in refusal(tmp_path, content, name="a.xlsx")
