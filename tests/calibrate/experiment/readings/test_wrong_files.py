"""Files that cannot be used: each is refused in one line with place, value and remedy."""

import pytest

import mrjax
from calibrate.experiment import curve
from calibrate.experiment.curve import CurveSheet
from mrjax.recipe import sheets

UNITS = {"time_unit": "min", "unit": "mm"}
TWO = "0,760\n1,701\n2,656\n"
H = "time (min),h (mm)\n"


def refusal(folder, content, height=0.76, tube_diameter=None, name="a.csv", **stated) -> str:
    data = content if isinstance(content, bytes) else content.encode()
    (folder / name).write_bytes(data)
    sheet = CurveSheet(**{"file": name, "standard_deviation": 3.0} | stated)
    with pytest.raises(mrjax.InputError) as refused:
        curve.read(sheet, folder, height, tube_diameter)
    message = str(refused.value)
    assert message.isprintable() and len(message) <= 400 and name in message
    return message


@pytest.mark.parametrize(
    "content, stated, words",
    [
        # Numbers
        ('time,mudline\n0,760\n1,"1,701"\n', UNITS, ["line 3", "'1,701'", "1701", "1.701"]),
        ("time\tmudline\n0\t1,760\n1\t1,701\n", UNITS, ["line 2", "'1,760'", "decimal = "]),
        ('time,mudline\n0.5,760\n1,"1,701"\n', UNITS, ["line 3", "'1,701'", "a comma"]),
        ("time;mudline\n0;76,0\n1;70.1\n", UNITS, ["line 2", "'76,0'", "70.1", "one decimal mark"]),
        ("time;mudline\n0;1.760,5\n1;701\n", UNITS, ["line 2", "'1.760,5'", "more than one"]),
        ("time;mudline\n0;1 760\n1;701\n", UNITS, ["line 2", "'1 760'", "thousands"]),
        ("time,mudline\n0,760\n1,<701\n", UNITS, ["line 3", "mudline = '<701'", "not a finite"]),
        ("time,mudline\n0,760\n1,~701\n", UNITS, ["line 3", "mudline = '~701'"]),
        ("time,mudline\n0,760\n1,701?\n", UNITS, ["line 3", "mudline = '701?'"]),
        ("time,mudline\n0,760\n1,7O1\n", UNITS, ["line 3", "mudline = '7O1'"]),
        ("time,mudline\n0,76O\n", UNITS, ["line 2", "mudline = '76O'"]),
        ("time,mudline\n0,760\n1,inf\n", UNITS, ["line 3", "mudline = 'inf'"]),
        ("time,mudline\n0,760\n1,1e400\n", UNITS, ["line 3", "'1e400'"]),
        ("time,mudline\n0,760\n1,1e31\n", UNITS, ["line 3", "1e+31", "between 1e-30 and 1e30"]),
        ("time,mudline\n0,760\n1,-5\n", UNITS, ["line 3", "mudline = -5 is negative"]),
        ("time,mudline\n0,760\n1,#DIV/0!\n", UNITS, ["line 3", "'#DIV/0!'"]),
        ("time,mudline\n0,760\n1,701 g\n", UNITS, ["line 3", "mudline = '701 g'"]),
        ("time,mudline\n0,760 mm\n1,70.1 cm\n", {"time_unit": "min"}, ["line 3", "is in cm"]),
        ("time,mudline\n0,760\n1,70.1 cm\n", UNITS, ["line 3", "'70.1 cm' is in cm"]),
        # Times
        ("time,mudline\n-1,760\n1,701\n", UNITS, ["line 2", "time = -1 is negative"]),
        ("time,mudline\nbefore,760\n1,701\n2,700\n", UNITS, ["line 2", "time = 'before'"]),
        ("time,mudline\n0,760\nlater,701\n2,700\n", UNITS, ["line 3", "time = 'later'"]),
        ("time,mudline\n0,760\n1,701\nread by eye\n", UNITS, ["line 4", "begin it with #"]),
        ("time,mudline\n1,760\n1,761\n", UNITS, ["one time alone"]),
        ("time,mudline\n0:00,760\n0:75,701\n", UNITS, ["line 3", "'0:75'", "60 minutes"]),
        ("time,mudline\n0:00:00,760\n0:00:60,701\n", UNITS, ["line 3", "'0:00:60'"]),
        ("time (min),h (mm)\n0:00,760\n0:30,701\n", {}, ["line 2", "'0:00'", "says 'min'"]),
        ("time,mudline\n23:50,760\n00:10,701\n", UNITS, ["line 3", "'00:10'", "midnight"]),
        ("time,mudline\n0:00,760\n5,701\n", UNITS, ["line 3", "time = '5'", "as others"]),
        ("time,mudline\n0,760\n0:05,701\n", UNITS, ["line 3", "time = '0:05'"]),
        ("date,h (mm)\n1/2/2024,760\n2/2/2024,701\n", {}, ["'1/2/2024'", "day first", "_format"]),
        ("time,h (mm)\n01.02.2024,760\n02.02.2024,701\n", {}, ["'01.02.2024'", "date_format"]),
        ("time,h (mm)\n01-02-24,760\n02-03-24,701\n", {}, ["'01-02-24'", "date_format"]),
        ("time,h (mm)\n2024-02-30,760\n2024-03-01,701\n", {}, ["line 2", "'2024-02-30'", "exists"]),
        ("time,h (mm)\n13/14/2024,760\n2024-03-01,701\n", {}, ["line 2", "'13/14/2024'", "exists"]),
        ("time,h (mm)\n2024-03-01,760\nlater,701\n", {}, ["line 3", "'later'"]),
        ("time,h (mm)\n2024-03-01,760\n5,701\n", {}, ["line 3", "time = '5'", "no date"]),
        (
            "time,h (mm)\n2024-03-01,760\n2024-03-02,701\n",
            {"date_format": "%d/%m/%Y"},
            ["line 2", "'2024-03-01'", "date_format"],
        ),
        (H + TWO, {"date_format": "%d/%m/%Y"}, ["time = '0'", "date_format"]),
        (H + TWO, {"start": "09:30"}, ["time = '0'", "start"]),
        (
            "time,h (mm)\n09:30,760\n09:31,701\n",
            {"start": "09:45"},
            ["line 2", "'09:30'", "before the start"],
        ),
        ("time,h (mm)\n2024-03-01,760\n2024-03-02,701\n", {"start": "noon"}, ["start = 'noon'"]),
        # Units
        ("time,h (mm)\n" + TWO, {}, ["no unit", "time_unit", "s, min, h, day, week"]),
        ("time (min),h\n" + TWO, {}, ["no unit", "unit, one of m, dm, cm, mm"]),
        ("time (min),h (mm)\n" + TWO, {"time_unit": "h"}, ["time_unit = 'h'", "min", "header"]),
        ("time (min),h (mm)\n" + TWO, {"unit": "cm"}, ["unit = 'cm'", "mm", "header"]),
        ("time (min),h (mm)\n" + TWO, {"unit": "%"}, ["unit = '%'", "mm"]),
        ("time (mm),h (min)\n" + TWO, {}, ["mm"]),
        ("time (years),h (mm)\n" + TWO, {}, ["'years'", "no unit of time"]),
        ("time (months),h (mm)\n" + TWO, UNITS, ["'months'", "no unit of time"]),
        ("time (min),mudline (kg)\n" + TWO, {}, ["'mudline (kg)'", "no unit of a mudline"]),
        ("time (min),h1 (mm),h2 (cm)\n0,760,76\n1,701,70\n", {}, ["cm and mm"]),
        ("time (min),sedimentation_ratio (mm)\n0,1\n1,0.9\n", {}, ["'mm'", "1, %"]),
        ("time (min),sedimentation_ratio\n0,100%\n1,92%\n", {"unit": "1"}, ["'100%'", "is in %"]),
        ("time (min),volume (mL)\n0,1000\n1,900\n", {}, ["line 2", "mL", "tube_diameter"]),
        ("time (min),h (mm)\n0,760\n1 h,701\n", {}, ["line 3", "'1 h' is in h", "in min"]),
        # Headers
        ("", UNITS, ["line 1", "the header is missing", "time and one of mudline"]),
        ("# nothing\n\n", UNITS, ["the header is missing"]),
        ("time\n0\n1\n", UNITS, ["line 1", "the header is time"]),
        ("mudline\n0\n1\n", UNITS, ["line 1", "the header is mudline"]),
        ("0\n1\n", UNITS, ["line 1"]),
        ("0,760,1\n1,701,1\n", UNITS, ["line 1", "3 columns and no header", "columns = "]),
        ("time,foo\n0,760\n1,701\n", UNITS, ["line 1", "time, foo", "columns = "]),
        ("time,mudline\n", UNITS, ["0 rows", "at least 2"]),
        ("time,mudline\n0,760\n", UNITS, ["1 rows", "at least 2"]),
        ("time,mudline\n0,\n1,-\n", UNITS, ["0 rows", "at least 2"]),
        ("time,time,mudline\n0,0,760\n1,1,701\n", UNITS, ["'time' and 'time'", "columns = "]),
        ("time,left height,right height\n0,760,760\n1,7,7\n", UNITS, ["'left height'", "repeats"]),
        ("time (min),A (mm),B (mm)\n0,760,760\n1,7,7\n", {}, ["'A (mm)' and 'B (mm)'", "repeats"]),
        (
            "a,b\n0,760\n1,701\n",
            UNITS | {"columns": {"time": "a", "mudline": "c"}},
            ["columns.mudline = 'c'", "no column", "'a', 'b'"],
        ),
        (
            "a,b\n0,760\n1,701\n",
            UNITS | {"columns": {"time": 1, "mudline": 3}},
            ["columns.mudline = 3", "no column"],
        ),
        (
            "a,b\n0,760\n1,701\n",
            UNITS | {"columns": {"time": "a", "mudline": "a"}},
            ["one column twice", "columns"],
        ),
        (
            "Sample,time,mudline\nA,0,760\nB,0,760\nA,1,701\nB,1,650\n",
            UNITS,
            ["line 3", "Sample = 'B' comes after 'A'", "file"],
        ),
        # Rows
        ("time,mudline\n0,5,76,0\n1,701\n", UNITS, ["line 2", "4 cells for 2", "point"]),
        ("time,mudline\n0,760\n1;701\n", UNITS, ["line 3", "'1;701'"]),
        ('time,mudline\n0,"760\n1,701\n', UNITS, ["line 2", "quotation marks"]),
        ("sep=,\ntime,mudline\n0,760;a\n1,701;b\n", UNITS, ["line 3", "'760;a'"]),
        # Errors
        ("t (min),h (mm),sd\n0,760,0\n1,701,3\n", {}, ["line 2", "= 0 must be above zero"]),
        ("t (min),h (mm),sd\n0,760,-1\n1,701,3\n", {}, ["line 2", "= -1 must be above zero"]),
        ("t (min),h (mm),sd (%)\n0,760,1\n1,701,3\n", {}, ["'sd (%)'", "in mm"]),
        (
            "t (min),h (mm),sd\n0,760,1\n1,701,\n",
            {"standard_deviation": None},
            ["line 3", "no standard_deviation"],
        ),
        ("t (min),h1 (mm),h2 (mm),h3 (mm),sd1,sd2\n0,1,1,1,1,1\n", {}, ["2 columns of errors"]),
        # What is stated of the file
        (H + TWO, {"delimiter": ";"}, ["delimiter = ';'", "no line has one"]),
        (H + TWO, {"delimiter": "x"}, ["delimiter = 'x'", "not known"]),
        ("t (min);h (mm)\n0;76.0\n1;70.1\n", {"decimal": ","}, ["'76.0'", 'decimal = ","']),
        ("t (min);h (mm)\n0;76,0\n1;70,1\n", {"decimal": "."}, ["'76,0'", 'decimal = "."']),
        (H + TWO, {"decimal": ","}, ["between commas", 'decimal = "," is stated']),
        (H + TWO, {"encoding": "utf-7000"}, ["encoding = 'utf-7000'", "not known"]),
        (H + TWO, {"encoding": "base64"}, ["encoding = 'base64'", "not known"]),
        (H + TWO, {"encoding": "utf-16"}, ["'utf-16' is stated", "take encoding away"]),
        ((H + TWO).encode("utf-16"), {"encoding": "utf-8"}, ["mark of UTF-16"]),
        (b"Zeit (min),H\xf6he (mm)\n0,1\n", {"encoding": "utf-8"}, ["not text in UTF-8"]),
        (H + TWO, {"sheet": "Tabelle1"}, ["sheet is stated"]),
        # No text
        (b"\xd0\xcf\x11\xe0\xa1\xb1", {}, ["(.xls)", ".xlsx or CSV"]),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", {}, ["is no text"]),
        (b"PK\x03\x04 no workbook", {}, ["cannot be read as a workbook"]),
        # What would reach a terminal
        ("time,\x1b[31mmudline\n0,760\n1,\x1b[31mred\n", UNITS, ["\\x1b[31mmudline"]),
        ("time,mudline\n0,760\n1,\x1b[31mred\n", UNITS, ["\\x1b[31mred"]),
        ("t\x1b[2J,x\n0,760\n1,2\n", UNITS, ["\\x1b[2J"]),
    ],
)
def test_a_fault_is_one_line_with_its_place_and_remedy(tmp_path, content, stated, words):
    message = refusal(tmp_path, content, **stated)
    for word in words:
        assert word in message, message


def test_a_clear_layer_needs_the_height(tmp_path):
    content = "time (min),supernatant (mm)\n0,0\n1,59\n"
    assert "needs the height" in refusal(tmp_path, content, height=None)


def test_readings_without_any_error_need_the_height(tmp_path):
    content = "time (min),mudline (mm)\n0,760\n1,701\n"
    message = refusal(tmp_path, content, height=None, standard_deviation=None)
    assert "no point has an error; give standard_deviation" in message


def test_paths_that_cannot_be_read(tmp_path):
    (tmp_path / "folder").mkdir()
    for name, words in (("none.csv", "no such file"), ("folder", "is a directory")):
        with pytest.raises(mrjax.InputError, match=f"{name}: {words}"):
            curve.read(CurveSheet(file=name), tmp_path)


@pytest.mark.parametrize(
    "stated, words",
    [
        ({"date_format": "%d/%m"}, "date_format = '%d/%m': must have day, month and year"),
        ({"date_format": "%Q"}, "date_format = '%Q': must have"),
        ({"decimal": ";"}, "decimal = ';': must be"),
        (
            {"time_unit": "fortnight"},
            "time_unit = 'fortnight': must be one of s, min, h, day, week",
        ),
        ({"unit": "kg"}, "unit = 'kg': must be one of m, dm, cm, mm, um, in, ft, m3, L"),
        ({"standard_deviation": 0.0}, "standard_deviation"),
        ({"columns": {"time": 0}}, "columns.time"),
    ],
)
def test_what_is_stated_wrongly_is_refused_before_the_file(stated, words):
    with pytest.raises(mrjax.InputError) as refused:
        sheets.validated(CurveSheet, {"file": "a.csv"} | stated, "e.toml")
    assert words in str(refused.value)
