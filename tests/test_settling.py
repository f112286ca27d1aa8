"""The settling page keeps its bars, shows what was measured, and the beds are as measured."""

import pytest
from settling import beds, page

PAGE = page.FOLDER / "README.md"


def test_the_page_shows_what_was_measured():
    assert page.text() == PAGE.read_text("utf-8")
    for name in page.figures():
        assert f"({name})" in page.text()
        assert (page.FOLDER / name).stat().st_size > 5000


@pytest.mark.parametrize("condition", page.like_for_like())
def test_dropped_beds_are_as_high_as_those_of_liggghts(condition):
    assert len(page.ours("dropped", *condition).lines) == beds.STARTS >= 5
    apart, _ = page.like_for_like()[condition]
    assert abs(apart) < page.LIKE_FOR_LIKE


@pytest.mark.parametrize("sample", beds.SAMPLES)
def test_the_printed_final_ratios_at_one_friction_coefficient(sample):
    bed = page.ours("dropped", sample, "walls", 0.2)
    assert abs(bed.mean() - 100 * page.PRINTED[sample]) < page.NEAR_PRINTED


def test_a_dropped_bed_is_one_of_those_on_the_page(case2):
    """The first start again: another machine rounds otherwise, and a bed remembers it. Within
    four standard deviations of the ensemble."""
    known = page.ours("dropped", "case2", "walls", 0.3)
    from mrjax.dropped import dropped

    run = dropped(case2, [0], friction=0.3)
    ratio = 100 * float(run.mudline[0, -1]) / case2.box.height / 1e0
    assert abs(ratio - known.mean()) < 4 * known.values("top").std(ddof=1)
