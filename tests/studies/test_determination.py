"""What fits call determined, beside dense grids: the measured problems, and some of them anew."""

import pytest

from tests.studies.determination import measure, page


def as_it_should_be(said):
    """Of the values called determined one in a hundred may have a large error, and so on."""
    assert said["determined with a large error"] <= 0.01 * said["determined"]
    about = "with a small error, about the fit"
    assert said[f"{about}, and called so"] >= 0.95 * said[about]
    assert said["worse than the best of many starts"] <= 0.01 * said["problems"]
    assert said["worse than the truth"] <= 0.01 * said["problems"]
    for level in ("68 %", "95 %"):
        low, high = page.limits(said["determined"], level)
        assert low <= said[f"{level} intervals that hold the truth"] <= high


def test_the_page_shows_what_was_measured():
    assert page.text() == page.PAGE.read_text("utf-8")
    said = page.counts(measure.known())
    assert said["problems"] == measure.EACH * (measure.DESIGNS + 1)
    as_it_should_be(said)


@pytest.mark.slow
def test_forty_problems_anew():
    """Four of each of ten designs: what was measured, but for the last digits."""
    rows = measure.measured(range(0, 20, 2), each=4)
    as_it_should_be(page.counts(rows))
    known = {(r["design"], r["problem"], r["parameter"]): r for r in measure.known()}
    for row in rows:
        before = known[str(row["design"]), str(row["problem"]), row["parameter"]]
        assert row["status"] == before["status"]
        assert row["exact"] == pytest.approx(before["exact"], rel=0.02)
