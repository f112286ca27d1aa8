"""The decimal mark of numbers."""

import pytest

import mrjax
from calibrate.experiment.readings.cells import Cell, is_missing, number, value
from calibrate.experiment.readings.decimals import decimal_mark


def cells(*texts):
    return [Cell(f"f, line {row}", "mudline", text) for row, text in enumerate(texts, 2)]


@pytest.mark.parametrize(
    "texts, delimiter, stated, mark",
    [
        (("1", "2"), ",", None, "."),
        (("1.5", "1.701"), ",", None, "."),
        (("1,5", "1,701"), ";", None, ","),
        (("1,701",), ";", None, ","),
        (("1,5", "1,701"), ",", None, ","),
        (("0,701",), "\t", None, ","),
        (("1,701",), "\t", ",", ","),
        (("12,3 mm", "45,6 mm"), "\t", None, ","),
        (("1,5", "31.01.2024", "0:00:01.5"), ";", None, ","),
        (("1.5", "red"), ";", ".", "."),
    ],
)
def test_it_is_that_of_the_numbers(texts, delimiter, stated, mark):
    assert decimal_mark(cells(*texts), delimiter, stated) == mark


@pytest.mark.parametrize(
    "texts, delimiter, stated, words",
    [
        (("760", "1,701"), ",", None, "line 3: mudline = '1,701' may be 1701 or 1.701"),
        (("760", "1,701"), "\t", None, "line 3: mudline = '1,701' may be 1701 or 1.701"),
        (("760", "1,701"), "", None, "line 3: mudline = '1,701' may be 1701 or 1.701"),
        (("1.5", "2,5"), ";", None, "line 3: mudline = '2,5' has a comma, and 1.5 a point"),
        (("1.234,5",), ";", None, "more than one decimal mark"),
        (("1,234,567",), ";", None, "more than one decimal mark"),
        (("1.5",), ";", ",", 'another decimal mark than decimal = ","'),
        (("1,5",), ";", ".", 'another decimal mark than decimal = "."'),
        (("1", "2"), ",", ",", "line 3: mudline = '2' stands between commas"),
    ],
)
def test_what_may_be_thousands_is_refused(texts, delimiter, stated, words):
    with pytest.raises(mrjax.InputError) as refused:
        decimal_mark(cells(*texts), delimiter, stated)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    "text, written, unit",
    [
        ("760", "760", ""),
        ("-1.5e-3", "-1.5e-3", ""),
        ("\N{MINUS SIGN}5", "-5", ""),
        ("92 %", "92", "%"),
        ("92%", "92", "%"),
        ("7,6 µm", "7,6", "μm"),
        (".5", ".5", ""),
        ("1E3", "1E3", ""),
    ],
)
def test_a_number_may_have_its_unit_behind_it(text, written, unit):
    assert number(text) == (written, unit)


@pytest.mark.parametrize("text", ["", "x", "<7", "~7", "7?", "7;6", "1 701", "1'701", "inf", "1_0"])
def test_other_cells_are_no_numbers(text):
    assert number(text) is None


def test_cells_that_say_nothing():
    assert all(map(is_missing, ("", "-", "NaN", "N/A", "#N/A", "\N{EN DASH}", "NULL", "n.a.")))
    assert not any(map(is_missing, ("0", "x", "inf", "?")))


def test_a_value_is_read_with_its_mark_and_has_bounds():
    (cell,) = cells("1,5")
    assert value(cell, "1,5", ",") == 1.5
    for written in ("1e31", "1e-31", "1e999"):
        with pytest.raises(mrjax.InputError, match="line 2: mudline = "):
            value(cell, written, ".")
    assert value(cell, "0", ".") == 0.0
