"""Files as balances, cameras, spreadsheets and people save them: each is read as it is meant.

A mudline of 760, 701 and 656 mm after 0, 1 and 2 minutes, written in many ways.
"""

import numpy as np
import pytest

import mrjax
from calibrate.experiment import curve
from calibrate.experiment.curve import CurveSheet

MIN, HOUR, DAY = 60.0, 3600.0, 86400.0
TWO = "0,760\n1,701\n2,656\n"
UNITS = {"time_unit": "min", "unit": "mm"}
BOTH = "time (min),mudline (mm)\n"
AREA = np.pi / 4.0 * 0.05**2


def read(folder, content, height=0.76, tube_diameter=0.05, name="a.csv", **stated):
    data = content if isinstance(content, bytes) else content.encode()
    (folder / name).write_bytes(data)
    sheet = CurveSheet(**{"file": name, "standard_deviation": 3.0} | stated)
    return curve.read(sheet, folder, height, tube_diameter)


def heights(found) -> np.ndarray:
    """Readings in m, or as ratios."""
    return np.array(found.values) * found.si


@pytest.mark.parametrize(
    "content, stated",
    [
        # Delimiters and decimal marks
        ("time;mudline\n0;76,0\n1;70,1\n2;65,6\n", {"time_unit": "min", "unit": "cm"}),
        ("time;mudline\n0;0,760\n1;0,701\n2;0,656\n", {"time_unit": "min", "unit": "m"}),
        ("time;mudline\n0;76.0\n1;70.1\n2;65.6\n", {"time_unit": "min", "unit": "cm"}),
        ('time,mudline\n"0","76,0"\n"1","70,1"\n"2","65,6"\n', UNITS | {"unit": "cm"}),
        ("time\tmudline\n0\t76,0\n1\t70,1\n2\t65,6\n", UNITS | {"unit": "cm"}),
        ("time\tmudline\n" + TWO.replace(",", "\t"), UNITS),
        ("time | mudline\n" + TWO.replace(",", " | "), UNITS),
        ("time  mudline\n" + TWO.replace(",", "   "), UNITS),
        ("t (min)  h (mm)\n" + TWO.replace(",", " "), {}),
        ("sep=;\ntime;mudline\n" + TWO.replace(",", ";"), UNITS),
        ("time , mudline\n0 , 760\n1 , 701\n2 , 656\n", UNITS),
        ("time,mudline\n0,7.60e2\n1,7.01E+02\n2,656.\n", UNITS),
        ("time,mudline\n0,+760\n1,701\n2,656\n", UNITS),
        # Encodings and ends of lines
        ("\ufefftime,mudline\n" + TWO, UNITS),
        (("time,mudline\n" + TWO).encode("utf-16"), UNITS),
        (("time,mudline\n" + TWO).encode("utf-16-le"), UNITS),
        (("time,mudline\n" + TWO).encode("utf-16-be"), UNITS),
        (b"Zeit (min);H\xf6he (mm)\n" + TWO.replace(",", ";").encode(), {}),
        (b"# H\xf6he\ntime,mudline\n" + TWO.encode(), UNITS),
        (("time,mudline\n" + TWO).replace("\n", "\r\n"), UNITS),
        (("time,mudline\n" + TWO).replace("\n", "\r"), UNITS),
        # Headers
        ("Time,Mudline\n" + TWO, UNITS),
        ("TIME (MIN),HEIGHT (MM)\n" + TWO, {}),
        ("Time (min),h [mm]\n" + TWO, {}),
        ("t/min,h/mm\n" + TWO, {}),
        ("time_min,mudline_mm\n" + TWO, {}),
        ("time [minutes],interface height [millimetres]\n" + TWO, {}),
        ("Elapsed time in min,Level in mm\n" + TWO, {}),
        ("min,mm\n" + TWO, {}),
        ("time,height\nmin,mm\n" + TWO, {}),
        ("time,height\n(min),(mm)\n" + TWO, {}),
        ('"Time\n(min)","Height\n(mm)"\n' + TWO, {}),
        ("# time (min), mudline (mm)\n" + TWO, {}),
        (TWO, UNITS),
        ("Sample A, chalk\nread by eye\n\ntime (min),mudline (mm)\n" + TWO, {}),
        ("mudline (mm),time (min)\n760,0\n701,1\n656,2\n", {}),
        # Extra columns, blanks and comments
        ("no,time,temp (C),mudline,note\n1,0,20,760,\n2,1,20,701,clear\n3,2,21,656,\n", UNITS),
        ("time (min),h (mm),h (cm),h (%)\n0,760,76,100\n1,701,70,92\n2,656,66,86\n", {}),
        ("time (min),h (%),h (mm)\n0,100,760\n1,92,701\n2,86,656\n", {"unit": "mm"}),
        (",t (min),h (mm)\n0,0,760\n1,1,701\n2,2,656\n", {}),
        ('"# by eye, twice"\ntime,mudline\n' + TWO + '"# shaken, twice"\n', UNITS),
        ("sample,time,mudline\nchalk,0,760\nchalk,1,701\n,2,656\n", UNITS),
        ("t,h_mean,h_min,h_max,n\n0,760,7,9,3\n1,701,7,9,3\n2,656,6,9,3\n", UNITS),
        ("t,mean h,h std\n0,760,3\n1,701,3\n2,656,3\n", UNITS),
        ("time,initial height,mudline\n0,760,760\n1,760,701\n2,760,656\n", UNITS),
        ("t (h),t (min),h (mm)\n0,0,760\n0.01667,1,701\n0.03333,2,656\n", {"time_unit": "min"}),
        ("time,mudline,\n0,760,\n1,701,\n2,656,\n", UNITS),
        ("time,mudline,,\n0,760,,\n1,701,,\n2,656,,\n,,,\n", UNITS),
        ("\n\n# read by eye\ntime,mudline\n0,760\n\n1,701\n# shaken?\n2,656\n\n", UNITS),
        ("% Matlab\n// C\ntime,mudline\n" + TWO, UNITS),
        ("time,mudline\n2,656\n0,760\n1,701\n", UNITS),
        # Empty cells
        *(
            (f"time,mudline\n0,760\n0.5,{nothing}\n1,701\n{nothing},650\n2,656\n", UNITS)
            for nothing in ("", "-", "--", "\N{EN DASH}", "NaN", "nan", "NA", "N/A", "#N/A", "null")
        ),
        # Units of time
        ("time (s),h (mm)\n0,760\n60,701\n120,656\n", {}),
        ("time (sec),h (mm)\n0,760\n60,701\n120,656\n", {}),
        ("time [Hours],h (mm)\n0,760\n0.016666666666666666,701\n0.03333333333333333,656\n", {}),
        ("time,h (mm)\n0 min,760\n1 min,701\n2 min,656\n", {}),
        ("time,mudline\n0 min,760 mm\n1 min,701 mm\n2 min,656 mm\n", {}),
        ("time,h (mm)\n0 s,760\n60 sec,701\n2 min,656\n", {}),
        # Clocks and dates
        ("time,mudline\n00:00,760\n00:01,701\n00:02,656\n", UNITS),
        ("time (hh:mm),h (mm)\n0:00,760\n0:01,701\n0:02,656\n", {}),
        ("time,h (mm)\n00:00:00,760\n00:01:00,701\n00:02:00,656\n", {}),
        ("time (mm:ss),h (mm)\n0:00,760\n1:00,701\n2:00,656\n", {}),
        ("time of day,h (mm)\n09:30,760\n09:31,701\n09:32,656\n", {}),
        ("time,h (mm)\n09:30,760\n09:31,701\n09:32,656\n", {"start": "09:30"}),
        ("time,h (mm)\n9:30 AM,760\n9:31 am,701\n9:32 a.m.,656\n", {}),
        (
            "date,time,h (mm)\n31/1/2024,9:30 pm,760\n31/1/2024,9:31 pm,701\n"
            "31/1/2024,9:32 pm,656\n",
            {},
        ),
        ("date,h (mm)\n2024-01-31 09:30,760\n2024-01-31 09:31,701\n2024-01-31 09:32,656\n", {}),
        ("Date,h (mm)\n31/01/2024 09:30,760\n31/01/2024 09:31,701\n31/01/2024 09:32,656\n", {}),
        (
            "date;time;h (mm)\n31.01.2024;09:30;760\n31.01.2024;09:31;701\n31.01.2024;09:32;656\n",
            {},
        ),
        (
            "time,h (mm)\n2024-01-31T09:30:00Z,760\n2024-01-31T09:31:00Z,701\n"
            "2024-01-31T10:32:00+01:00,656\n",
            {},
        ),
        (
            "time,h (mm)\n01/02/2024 9:30 PM,760\n01/02/2024 9:31 PM,701\n01/02/2024 9:32 PM,656\n",
            {"date_format": "%d/%m/%Y %I:%M %p"},
        ),
        (
            "time,h (mm)\n1 Feb 2024 09:30,760\n1 Feb 2024 09:31,701\n1 Feb 2024 09:32,656\n",
            {"start": "2024-02-01 09:30"},
        ),
        # Lengths, volumes, clear layers
        (BOTH.replace("mm", "cm") + "0,76\n1,70.1\n2,65.6\n", {}),
        (BOTH.replace("mm", "m") + "0,0.76\n1,0.701\n2,0.656\n", {}),
        (BOTH.replace("mm", "dm") + "0,7.6\n1,7.01\n2,6.56\n", {}),
        (BOTH.replace("mm", "µm") + "0,760000\n1,701000\n2,656000\n", {}),
        (BOTH.replace("mm", "in") + "0,29.921259843\n1,27.598425197\n2,25.826771654\n", {}),
        (
            "time (min),volume (mL)\n0,1492.2565105\n1,1376.410281\n2,1288.053\n",
            {},
        ),
        (
            "t,V\n0,1492.2565105\n1,1376.410281\n2,1288.053\n",
            {"time_unit": "min", "unit": "mL"},
        ),
        ("time (min),volume (cm³)\n0,1492.2565105\n1,1376.410281\n2,1288.053\n", {}),
        ("time (min),supernatant (mm)\n0,0\n1,59\n2,104\n", {}),
        ("time (min),Clear layer depth (cm)\n0,0\n1,5.9\n2,10.4\n", {}),
        ("time (min),supernatant (mL)\n0,0\n1,115.8462289\n2,204.2035225\n", {}),
        # What is stated
        ("a,b,c\n0,760,1\n1,701,1\n2,656,1\n", UNITS | {"columns": {"time": "a", "mudline": "b"}}),
        ("1,0,760\n1,1,701\n1,2,656\n", UNITS | {"columns": {"time": 2, "mudline": 3}}),
        ("a,b\n0,760\n1,701\n2,656\n", UNITS | {"columns": {"time": 1, "mudline": 2}}),
        ("a,b\n0,0\n1,59\n2,104\n", UNITS | {"columns": {"time": "A", "supernatant": "B"}}),
        (BOTH + TWO, {"time_unit": "Minutes", "unit": "MM"}),
        (BOTH + TWO, {"delimiter": ",", "decimal": ".", "encoding": "utf-8"}),
        ('time,mudline\n0,"0,760"\n1,"0,701"\n2,"0,656"\n', UNITS | {"unit": "m", "decimal": ","}),
        (b"Zeit;H\xf6he\n0;760\n1;701\n2;656\n", UNITS | {"encoding": "latin-1"}),
    ],
)
def test_a_mudline_written_in_another_way_is_the_same(tmp_path, content, stated):
    found = read(tmp_path, content, **stated)
    assert found.observable == "mudline"
    np.testing.assert_allclose(found.times, [0.0, MIN, 2 * MIN], atol=0.1)
    np.testing.assert_allclose(heights(found), [0.760, 0.701, 0.656], rtol=1e-8)
    assert found.errors == [3.0] * 3


@pytest.mark.parametrize(
    "content, stated",
    [
        ("time,sedimentation_ratio\n0,100%\n1,92%\n", {"time_unit": "min", "unit": "%"}),
        ("time (min),sedimentation ratio\n0,100 %\n1,92 %\n", {}),
        ("time (min),ratio (%)\n0,100\n1,92\n", {}),
        ("time (min),h/h0\n0,1\n1,0.92\n", {}),
        ("time (min),H/H0 (%)\n0,100\n1,92\n", {}),
        ("time (min),height (% of initial height)\n0,100\n1,92\n", {}),
        ("time,mudline\n0,100\n1,92\n", {"time_unit": "min", "unit": "%"}),
        ("time (min),supernatant (%)\n0,0\n1,8\n", {}),
        ("time (min),sedimentation_ratio\n0,1\n1,0.92\n", {"unit": "1"}),
    ],
)
def test_percent_of_the_height_is_a_ratio(tmp_path, content, stated):
    found = read(tmp_path, content, **stated)
    assert found.observable == "sedimentation_ratio"
    np.testing.assert_allclose(heights(found), [1.0, 0.92], rtol=1e-12)


@pytest.mark.parametrize(
    "unit, words",
    [
        (1.0, "s S sec Secs second SECONDS"),
        (60.0, "min Min MINS minute Minutes"),
        (3600.0, "h H hr HRS hour Hours"),
        (86400.0, "d D day Days DAY"),
        (604800.0, "w wk week Weeks WEEK"),
    ],
)
def test_units_of_time_have_many_names(tmp_path, unit, words):
    for word in words.split():
        of_header = read(tmp_path, f"time ({word}),h (mm)\n0,760\n2,701\n")
        stated = read(tmp_path, "time,h (mm)\n0,760\n2,701\n", time_unit=word)
        assert of_header.times == stated.times == [0.0, 2.0 * unit]


@pytest.mark.parametrize(
    "content",
    [
        "time,mudline\n0,760\n1,701\n1,703\n2,656\n",
        "time,mudline,mudline\n0,760,\n1,701,703\n2,,656\n",
        "time,mudline 1,mudline 2\n0,760,\n1,701,703\n2,,656\n",
        "time,h1,h2\n0,760,-\n1,701,703\n2,-,656\n",
        "time,tube 1 height,tube 2 height\n0,760,-\n1,701,703\n2,-,656\n",
        "time,height A,height B\n0,760,-\n1,701,703\n2,-,656\n",
        "time,tube A,tube B\n0,760,-\n1,701,703\n2,-,656\n",
        "time,mudline (tube 1),mudline (tube 2)\n0,760,-\n1,701,703\n2,-,656\n",
    ],
)
def test_repeats_are_all_kept(tmp_path, content):
    found = read(tmp_path, content, **UNITS)
    assert found.times == [0.0, MIN, MIN, 2 * MIN]
    assert found.values == [760.0, 701.0, 703.0, 656.0]


def test_repeats_may_be_stated(tmp_path):
    columns = {"time": "t", "mudline": ["left", "right"]}
    found = read(tmp_path, "t,left,right\n0,760,760\n1,701,703\n", **UNITS, columns=columns)
    assert found.values == [760.0, 760.0, 701.0, 703.0]
    assert found.understood.columns["mudline"] == "'left' and 'right'"


def test_errors_of_their_own_come_before_the_stated_one(tmp_path):
    content = "t (min),h (mm),sd (cm)\n0,760,0.1\n1,701,\n"
    found = read(tmp_path, content)
    assert found.errors == [1.0, 3.0]


def test_repeats_may_have_errors_of_their_own(tmp_path):
    found = read(tmp_path, "t (min),h1 (mm),sd1,h2 (mm),sd2\n0,760,1,761,2\n1,701,-,703,4\n")
    assert found.values == [760.0, 761.0, 701.0, 703.0] and found.errors == [1.0, 2.0, 3.0, 4.0]


def test_rows_and_columns_that_are_not_used_are_named(tmp_path):
    content = "# by eye\ntime,mudline,temp\n0,760,20\n1,-,20\n2,656,20\n,640,20\n"
    found = read(tmp_path, content, **UNITS)
    assert found.rows == [3, 5]
    assert found.understood.ignored_columns == ("temp",)
    assert found.understood.left_out == (4, 6)
    assert found.understood.line == (
        "'a.csv' (UTF-8, commas): time in min from 'time', mudline in mm from 'mudline'; "
        "2 readings, 760 mm at 0 min to 656 mm at 2 min; standard deviation 3 mm, stated; "
        "not used: 'temp'; without a reading: lines 4, 6"
    )


def test_days_and_times_of_the_day_may_have_two_columns(tmp_path):
    content = "Day,Time,h (mm)\n1,09:00,760\n2,09:00,701\n2,17:30,690\n10,08:00,656\n"
    found = read(tmp_path, content)
    assert found.times == [0.0, DAY, DAY + 8.5 * HOUR, 9 * DAY - HOUR]
    assert "from 'Day' and 'Time'" in found.understood.line
    elapsed = read(tmp_path, content.replace("Time", "t (h)").replace(":00", "").replace(":30", ""))
    assert elapsed.times[0] == 8 * HOUR and elapsed.understood.ignored_columns == ("Day",)


def test_a_date_may_stand_once_for_all_rows_of_its_day(tmp_path):
    rows = "2024-02-01,9:00,760\n,21:00,701\n2024-02-03,9:00,690\n,10:00,656\n"
    content = f"date,time,h (mm)\n{rows}"
    assert read(tmp_path, content).times == [0.0, 12 * HOUR, 48 * HOUR, 49 * HOUR]


def test_a_stated_format_may_look_like_no_date(tmp_path):
    """Nor need it be one that is found."""
    content = "time;h (mm)\n20240131 2200;760\n20240201 0100;701\n"
    found = read(tmp_path, content, date_format="%Y%m%d %H%M")
    assert found.times == [0.0, 3 * HOUR] and found.understood.time_form == "dates"
    with pytest.raises(mrjax.InputError, match=r"line 3: time = '0100' is not as date_format says"):
        read(tmp_path, content.replace("20240201 ", ""), date_format="%Y%m%d %H%M")


def test_long_times_are_told_in_long_units(tmp_path):
    content = "date,h (mm)\n2024-01-31,760\n2024-03-01,701\n"
    found = read(tmp_path, content)
    assert found.times == [0.0, 30 * DAY]
    assert found.understood.last == (30.0, 701.0) and found.understood.time_unit == "day"
    assert "time as dates from 'date'" in found.understood.line


def test_a_volume_is_a_height_in_its_tube(tmp_path):
    found = read(tmp_path, "time (min),volume (mL)\n0,1000\n1,900\n", tube_diameter=0.05)
    assert found.unit == "mL" and found.si == pytest.approx(1e-6 / AREA, rel=1e-12)
