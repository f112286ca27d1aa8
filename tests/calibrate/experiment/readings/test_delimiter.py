"""The delimiter that parts lines into readings."""

import pytest

import mrjax
from calibrate.experiment.readings import delimiter


def lines(text):
    return list(enumerate(text.splitlines(), 1))


@pytest.mark.parametrize(
    "text, mark",
    [
        ("0,760\n1,701", ","),
        ("0;76,0\n1;70,1", ";"),
        ("0,5;76,0\n1,5;70,1", ";"),
        ("0\t76,0\n1\t70,1", "\t"),
        ("0|760\n1|701", "|"),
        ("0 760\n1 701", " "),
        ("2024-01-31 09:30,760", ","),
        ("2024-01-31 09:30\t760", "\t"),
        ("0,760,first; then clear\n1,701,so; so", ","),
        ('"0","76,0"\n"1","70,1"', ","),
        ("time,mudline\n0,x", ","),
        ("time;mudline", ";"),
        ("time", ","),
        ("", ","),
        ("0,-\n1,701", ","),
    ],
)
def test_it_is_the_one_that_gives_numbers(text, mark):
    assert delimiter.delimiter_of(lines(text), None, "f") == mark


@pytest.mark.parametrize(
    "stated, mark", [("\\t", "\t"), ("Tab", "\t"), ("semicolon", ";"), (" ", " "), ("comma", ",")]
)
def test_it_may_be_stated_by_its_name(stated, mark):
    assert delimiter.delimiter_of(lines(f"0{mark}760"), stated, "f") == mark


def test_cells_lose_their_blanks_and_quotation_marks():
    (row,) = delimiter.rows([(7, ' 0 , "7,6" ,"a  b"')], ",", "f")
    assert (row.number, row.cells) == (7, ["0", "7,6", "a b"])


def test_a_cell_may_go_over_lines_and_keeps_the_number_of_its_first():
    found = list(delimiter.rows(lines('"time\n(min)",h\n0,760'), ",", "f"))
    assert [(row.number, row.cells) for row in found] == [
        (1, ["time (min)", "h"]),
        (3, ["0", "760"]),
    ]


def test_a_quotation_mark_without_its_partner_names_its_line():
    with pytest.raises(mrjax.InputError, match=r"f, line 2: .*; mend its quotation marks"):
        list(delimiter.rows(lines('0,760\n1,"701\n2,656'), ",", "f"))
