"""Comparisons of models find the effects that are in synthetic data, and claim no others."""

import pytest

from calibrate.comparison.compare import ASKED_FOR, UNDECIDED
from tests.studies.effects import page, synthetic


def test_the_page_shows_what_was_measured():
    assert page.text() == page.PAGE.read_text("utf-8")


def test_effects_are_found_and_absent_ones_are_not_claimed():
    rows = page.verdicts()
    present = [row.word for row in rows if row.gain is not None]
    absent = [row.word for row in rows if row.gain is None]
    assert present.count(ASKED_FOR) >= 0.9 * len(present)
    assert present.count(UNDECIDED) <= 0.2 * len(present)
    assert absent.count(ASKED_FOR) <= 0.05 * len(absent)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 15])
def test_a_set_comes_out_again(number):
    """Noise is the same on all machines; verdicts far from their limits are, too."""
    again = synthetic.verdicts(synthetic.the_set(number), synthetic.TRIED)
    (measured,) = (one for one in page.sets() if one["set"] == str(number))
    assert again["truth"] == measured["truth"] and again["best"] == measured["best"]
    for effect in synthetic.TRIED:
        assert again[effect.name] == measured[effect.name]
