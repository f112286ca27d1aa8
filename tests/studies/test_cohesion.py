"""Beds of spheres that attract each other are as high as those of LAMMPS."""

import pytest

from tests.studies.cohesion import beds, page


def test_the_page_shows_what_was_measured():
    assert page.text() == page.PAGE.read_text("utf-8")


@pytest.mark.parametrize("name", ["top", "twice_mean_height"])
def test_beds_are_as_high_as_those_of_lammps(name):
    for peer, ours in page.by_condition().values():
        assert abs(page.mean(peer, name) - page.mean(ours, name)) < page.BAR


@pytest.mark.slow
def test_a_measured_bed_comes_out_again():
    measured = next(bed for bed in beds.measured() if bed[:4] == ("mrjax", 3, 0.0, 1))
    again = beds.settled(*measured[1:4])
    for name in ("top", "twice_mean_height"):
        assert abs(getattr(again, name) - getattr(measured, name)) < page.BAR
