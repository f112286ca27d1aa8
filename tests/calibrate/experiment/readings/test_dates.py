"""Dates and clocks of cells: one meaning, or a refusal."""

from datetime import datetime

import pytest

import mrjax
from calibrate.experiment.readings import dates
from calibrate.experiment.readings.cells import Cell


def column(*texts):
    return [Cell(f"f, line {row}", "time", text) for row, text in enumerate(texts, 2)]


@pytest.mark.parametrize(
    "text, expected",
    [
        ("2024-01-31", datetime(2024, 1, 31)),
        ("2024/1/31 9:05", datetime(2024, 1, 31, 9, 5)),
        ("2024-01-31T09:05:30", datetime(2024, 1, 31, 9, 5, 30)),
        ("2024-01-31 09:05:30.25", datetime(2024, 1, 31, 9, 5, 30, 250000)),
        ("2024-01-31T09:05:30Z", datetime(2024, 1, 31, 9, 5, 30)),
        ("2024-01-31T09:05:30+02:00", datetime(2024, 1, 31, 7, 5, 30)),
        ("2024-01-31T09:05:30-0330", datetime(2024, 1, 31, 12, 35, 30)),
        ("31.01.2024 09:05", datetime(2024, 1, 31, 9, 5)),
        ("31/1/2024", datetime(2024, 1, 31)),
        ("1/31/2024, 9:05 PM", datetime(2024, 1, 31, 21, 5)),
        ("12/31/24 12:05 AM", datetime(2024, 12, 31, 0, 5)),
        ("31 Jan 2024", datetime(2024, 1, 31)),
        ("31-Jan-24 9:05", datetime(2024, 1, 31, 9, 5)),
        ("January 31, 2024 09:05", datetime(2024, 1, 31, 9, 5)),
        ("Jan 31st, 2024", datetime(2024, 1, 31)),
        ("Wed 31.01.2024", datetime(2024, 1, 31)),
        ("02/02/2024", datetime(2024, 2, 2)),  # both orders give the same
    ],
)
def test_a_date_of_one_meaning_is_read(text, expected):
    assert dates.is_date(text)
    assert dates.dates(column(text), None) == [expected]


def test_one_row_may_show_the_order_of_all():
    found = dates.dates(column("01/02/2024", "13/02/2024"), None)
    assert found == [datetime(2024, 2, 1), datetime(2024, 2, 13)]
    found = dates.dates(column("01/02/2024", "02/13/2024"), None)
    assert found == [datetime(2024, 1, 2), datetime(2024, 2, 13)]


@pytest.mark.parametrize("text", ["01/02/2024", "1.2.2024 09:30", "01-02-24", "1/2/24"])
def test_a_date_of_two_meanings_is_refused(text):
    with pytest.raises(mrjax.InputError, match=r"line 2: time = .* can be read day first"):
        dates.dates(column(text, text), None)


def test_rows_of_different_orders_are_refused():
    with pytest.raises(mrjax.InputError, match="line 3: time = '02/13/2024' is no date that"):
        dates.dates(column("13/02/2024", "02/13/2024"), None)


@pytest.mark.parametrize(
    "stated, text, expected",
    [
        ("%d/%m/%Y", "01/02/2024", datetime(2024, 2, 1)),
        ("%d/%m/%Y", "01/02/2024 09:30", datetime(2024, 2, 1, 9, 30)),
        ("MM/DD/YYYY hh:mm", "01/02/2024 09:30", datetime(2024, 1, 2, 9, 30)),
        ("dd.mm.yy", "01.02.24", datetime(2024, 2, 1)),
        ("YYYY-DD-MM hh:mm:ss", "2024-01-02 09:30:15", datetime(2024, 2, 1, 9, 30, 15)),
        ("%d %b %Y", "1 Feb 2024", datetime(2024, 2, 1)),
    ],
)
def test_a_stated_format_decides(stated, text, expected):
    assert dates.dates(column(text), dates.strptime_format(stated)) == [expected]


@pytest.mark.parametrize("stated", ["", "%d/%m", "%H:%M", "%d/%m/%Y %Q", "days", "%", "%d%m%Y%"])
def test_a_format_needs_day_month_and_year(stated):
    with pytest.raises(mrjax.InputError, match="date_format = "):
        dates.strptime_format(stated)


@pytest.mark.parametrize(
    "text, seconds",
    [
        ("1:30", 5400.0),
        ("01:30", 5400.0),
        ("36:00", 129600.0),
        ("0:00:01.5", 1.5),
        ("0:00:01,5", 1.5),
        ("1d 02:00", 93600.0),
        ("2 days, 1:00:00", 176400.0),
        ("-0:01", -60.0),
        ("9:30 AM", 34200.0),
        ("12:05 am", 300.0),
        ("12:05 p.m.", 43500.0),
    ],
)
def test_a_clock_shows_hours_and_minutes(text, seconds):
    assert dates.is_clock(text)
    assert dates.clock_seconds(column(text)[0]) == seconds


def test_minutes_may_come_first_where_the_header_says_so():
    assert dates.clock_seconds(column("90:30")[0], minutes_first=True) == 5430.0


@pytest.mark.parametrize(
    "text", ["12", "1.5", "1:2:3:4", "1:", ":30", "a:b", "12:30 Uhr", "1;30", "9999999d 1:00"]
)
def test_other_cells_are_no_clock(text):
    assert not dates.is_clock(text)


@pytest.mark.parametrize("text", ["760", "7.6", "7.6.1", "1-2", "May", "h 2024", "1e-3", "2024"])
def test_numbers_and_words_are_no_dates(text):
    assert not dates.is_date(text)
