"""Numbers that the pages state: digits that their errors allow, and values that were measured."""

import json
import re
from collections.abc import Callable

import numpy as np
import pytest

import mrjax
from mrjax.laws import drag, particle
from tests.builders import ROOT, pages
from tests.studies.benchmarks.speed import page as speed_page
from tests.studies.determination import measure
from tests.studies.determination import page as determination_page

STUDIES = ROOT / "tests" / "studies"
ALL = [*pages.PAGES, *sorted(STUDIES.rglob("README.md"))]
WITH_ERROR = re.compile(r"(?<![\w.])[-+]?(\d+(?:\.\d+)?) *± *(\d+(?:\.\d+)?)(?![\d.]*e)")
TEXT = " ".join(" ".join(page.read_text("utf-8").split()) for page in pages.PAGES)


@pytest.mark.parametrize("page", ALL, ids=pages.name)
def test_numbers_have_the_digits_that_their_errors_allow(page):
    """The last digit of a number is that of its error, which has one or two."""
    for value, error in WITH_ERROR.findall(page.read_text("utf-8")):
        assert last_place(value) == last_place(error), f"{value} ± {error}"
        assert 1 <= len(error.replace(".", "").lstrip("0")) <= 2, f"{value} ± {error}"


def last_place(number: str) -> int:
    return len(number.partition(".")[2])


def settled_beds() -> list[float]:
    """How much faster than LIGGGHTS settled beds are on one core, by their size."""
    rows = speed_page.known(speed_page.RESULTS)["throughput"]["rows"]
    found = {
        row["particles"]: row["float64"]["over_liggghts"]["median"]
        for row in rows
        if row["phase"] == "settled" and row["cores"] == 1
    }
    return [found[size] for size in sorted(found)]


def two_cores() -> list[float]:
    """How much faster large beds are on two cores than on one: least and most."""
    rows = speed_page.known(speed_page.RESULTS)["throughput"]["rows"]
    rate = {
        (row["phase"], row["particles"], row["cores"]): row["float64"]["rate"]["median"]
        for row in rows
    }
    ratios = [
        rate[phase, size, 2] / rate[phase, size, 1]
        for phase, size, cores in rate
        if cores == 1 and size >= 20_000
    ]
    return [min(ratios), max(ratios)]


def determined() -> list[float]:
    counts = determination_page.counts(measure.known())
    assert counts["determined with a large error"] == 1
    return [counts["problems"], counts["determined"]]


def off_the_law() -> list[float]:
    """The worst departures of gradients of a falling mudline, per cent, rounded up."""
    found = json.loads((STUDIES / "settling" / "gradients.json").read_text("utf-8"))
    worst = [100 * np.abs(found[name]).max() for name in ("law", "law_finer")]
    return [float(np.ceil(10 * one) / 10) for one in worst]


def fraction_at_the_cap() -> list[float]:
    """Where Eq. 14 reaches its cap: 389.153 lambda^7.5593 + 1 = 48.985."""
    return [float(drag.volume_fraction_at((47.985 / 389.153) ** (1 / 7.5593)))]


def gap_of_adhesion() -> list[float]:
    """Where van der Waals' force A R / (12 h^2), A = 1e-19 J, is the net weight of iron in oil; nm.

    Of two particles of 4 um in diameter.
    """
    parameters = mrjax.Recipe.load("case2").parameters()
    weight = float(particle.net_weight(parameters))
    return [1e9 * (1e-19 * float(parameters.radius) / (12 * weight)) ** 0.5]


NUMBER = r"([\d.,]*\d)"
CLAIMS: dict[str, Callable[[], list[float]]] = {
    f"mrjax is {NUMBER}, {NUMBER}, {NUMBER} and {NUMBER} times as fast as LIGGGHTS": settled_beds,
    f"settled beds run {NUMBER} to {NUMBER} times as fast as in LIGGGHTS": lambda: [
        min(settled_beds()),
        max(settled_beds()),
    ],
    f"two cores are {NUMBER} to {NUMBER} times as fast as one": two_cores,
    f"On {NUMBER} synthetic problems one of the {NUMBER} values called determined": determined,
    f"keeps to the exact law within {NUMBER} % while the mudline of case2 falls, and within "
    f"{NUMBER} % at a quarter of the step": off_the_law,
    f"`son2018` without a slope above {NUMBER} ": fraction_at_the_cap,
    f"`haberman-sayre` up to {NUMBER}, ": lambda: [float(drag.volume_fraction_at(0.8))],
    f"more than the net weight below a gap of {NUMBER} nm": gap_of_adhesion,
}
"""Sentences of the pages, and the numbers in them as measured or by a closed form."""


@pytest.mark.parametrize("sentence", CLAIMS)
def test_a_sentence_has_the_numbers_that_were_measured(sentence):
    found = re.findall(sentence, TEXT)
    assert found, "no page says so any more: change CLAIMS with the sentence"
    for stated in found:
        for text, value in zip(np.atleast_1d(stated), CLAIMS[sentence](), strict=True):
            unit = 10.0 ** -last_place(text)
            assert abs(float(text) - value) <= 0.5001 * unit, f"{text}, and it is {value:g}"
