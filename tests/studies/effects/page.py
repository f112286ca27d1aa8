"""The page of the verdicts: how often an effect in the data is found, and an absent one claimed."""

import csv
from pathlib import Path
from typing import NamedTuple

from scipy.stats import binomtest

from calibrate.comparison.compare import ASKED_FOR, UNDECIDED
from calibrate.comparison.effects import EFFECTS
from mrjax.io import files
from tests.studies.effects import coverage, synthetic

PAGE = Path(__file__).parent / "README.md"

ABOUT = """# Which effects do the data ask for: how often a comparison is right

`python -m tests.studies.effects 0 200` makes synthetic data sets and compares models on each. A set
is one tube, {height:.0f} mm high, of mineral powder in water at a volume fraction of {fraction:g}.
It has {readings} readings of the mudline from {first:g} to {last:g} times a free fall through the
tube. Its effects are none, flocs, a yielding bed, a delay, or a delay with one of the others; their
values are drawn from wide ranges. Fitted models have flocs, a yielding bed and a delay, alone and
together, but not several sizes.

The expected gain of an effect is the least chi-squared, without noise in the data, of all models
that lack it. Other effects may take its place, so that this is what sets it apart. The noise of a
set is such that its weakest effect has a gain between {least:.0f} and {most:.0f}.

So far there are {sets} sets. Bars: an effect in the data is found in 95 %, and undecided in at most
20 %; an absent one is claimed in at most 5 %. Brackets are intervals of 95 % (Clopper & Pearson).

"""
HEADER = [
    "effect",
    "in the data",
    "found",
    "undecided",
    "missed",
    "not in the data",
    "claimed",
    "undecided",
]
NOTES = """
The joint region of 68 % about the fit of the true model has the true values in {inner}, that of
95 % in {outer}, of {covered} sets.

The noise follows from the gain: {finest:.2g} to {coarsest:.2g} mm, below {middle:.2g} mm for half
of the sets with effects. Flocs and a yielding bed can predict nearly the same curve, and readings
by a ruler, to 0.5 mm, then cannot tell them apart. A comparison of such readings ends undecided.
"""


class Row(NamedTuple):
    """The verdict on one effect of one set."""

    number: int
    effect: str
    gain: float | None
    """Expected gain; None for an effect that is not in the data."""
    word: str


def sets() -> list[dict[str, str]]:
    """The rows of `verdicts.csv`."""
    with synthetic.FILE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def verdicts() -> list[Row]:
    """All verdicts on effects that were tried."""
    rows = []
    for one in sets():
        names = one["truth"].split(" + ") if one["truth"] else []
        gains = dict(zip(names, map(float, filter(None, one["gains"].split(" + "))), strict=True))
        rows += [
            Row(int(one["set"]), effect.name, gains.get(effect.name), one[effect.name])
            for effect in EFFECTS
            if effect in synthetic.TRIED
        ]
    return rows


def text() -> str:
    """The whole page."""
    rows = verdicts()
    present = [
        row for row in rows if row.gain is not None and row.gain > 0.999 * synthetic.LEAST_GAIN
    ]
    absent = [row for row in rows if row.gain is None]
    table = []
    for name in [*(effect.name for effect in synthetic.TRIED), "all"]:
        here = [row for row in present if name in (row.effect, "all")]
        away = [row for row in absent if name in (row.effect, "all")]
        found, open_ = _count(here, ASKED_FOR), _count(here, UNDECIDED)
        cells = (
            name,
            len(here),
            _share(found, len(here)),
            _share(open_, len(here)),
            len(here) - found - open_,
            len(away),
            _share(_count(away, ASKED_FOR), len(away)),
            _share(_count(away, UNDECIDED), len(away)),
        )
        table.append(cells)
    measured = sets()
    errors = sorted(float(one["error_mm"]) for one in measured if one["truth"])
    about = ABOUT.format(
        height=1e3 * synthetic.HEIGHT,
        fraction=synthetic.FRACTION,
        readings=synthetic.READINGS,
        first=synthetic.FIRST,
        last=synthetic.LAST,
        least=synthetic.LEAST_GAIN,
        most=synthetic.MOST_GAIN,
        sets=len(measured),
    )
    rises = coverage.measured()
    notes = NOTES.format(
        inner=_share(sum(one.within(0.68) for one in rises), len(rises)),
        outer=_share(sum(one.within(0.95) for one in rises), len(rises)),
        covered=len(rises),
        finest=errors[0],
        coarsest=errors[-1],
        middle=errors[len(errors) // 2],
    )
    return about + files.markdown_table(HEADER, table) + notes


def _count(rows: list[Row], word: str) -> int:
    return sum(row.word == word for row in rows)


def _share(part: int, whole: int) -> str:
    """A share in per cent with its interval of 95 %."""
    if not whole:
        return ""
    interval = binomtest(part, whole).proportion_ci(0.95)
    return f"{100 * part / whole:.0f} % ({100 * interval.low:.0f} to {100 * interval.high:.0f})"
