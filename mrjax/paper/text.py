"""The numbers in the text of Son (2018)."""

from collections.abc import Iterator, Mapping

import mrjax
from mrjax.core.units import MM_PER_DAY
from mrjax.paper.case import FINAL_RATIO_WITHIN, Case
from mrjax.paper.row import Row, row
from mrjax.paper.runs import Simulated


def rows(cases: Mapping[str, Case], runs: Simulated) -> Iterator[Row]:
    """Yields the rows of the numbers in the text: the box, velocities, final ratios."""
    yield from _box(cases)
    yield from _velocities(cases, runs)
    yield from _final_ratios(cases)


def _box(cases: Mapping[str, Case]) -> Iterator[Row]:
    sections = {"case1": ("314", "section 3.1"), "case3": ("292", "section 3.3")}
    for name, (printed, section) in sections.items():
        count = cases[name].recipe.particle_count
        yield row(name, "particles in the box", printed, count, "1", section)


def _velocities(cases: Mapping[str, Case], runs: Simulated) -> Iterator[Row]:
    case1, case2, case3 = cases.values()
    as_printed = runs.velocities["printed f_w"]
    yield row(
        "case1",
        "Reynolds number in the text",
        "2.167e-6",
        float(mrjax.reynolds_number(case1.velocity / MM_PER_DAY, case1.parameters)),
        "1",
        "section 2.3; Table 2 has 2.16: a misprint",
    )
    yield row(
        "case1",
        "calculated over measured velocity, more than",
        "60",
        case1.velocity / 8.0,
        "1",
        "sections 2.3 and 3.1: a lower bound",
        within=2.0,
    )
    yield row(
        "case2",
        "initial settling velocity with the printed f_w",
        "9.2",
        as_printed,
        "mm/day",
        f"f_w = 48.49 in place of the cap: {as_printed:.4f}",
    )
    yield row(
        "case2",
        "velocity above the measured one",
        "15",
        100 * (case2.velocity / 8.0 - 1),
        "%",
        f"section 3.2; with the printed f_w {100 * (as_printed / 8.0 - 1):.1f}",
    )
    yield row(
        "case3",
        "velocity above the measured one",
        "11.1",
        100 * (case3.velocity / 3.6 - 1),
        "%",
        "section 3.3; follows from the velocity of 4.0, which Eqs. 19-24 do not give",
        "not reproducible",
    )


def _final_ratios(cases: Mapping[str, Case]) -> Iterator[Row]:
    case2, case3 = cases["case2"], cases["case3"]
    yield row(
        "case2",
        "final ratio below the measured one",
        "11.2",
        -_above_measured(case2),
        "%",
        f"section 3.2; of {case2.final_ratio:.1f} against 78; reproduced means within "
        f"{FINAL_RATIO_WITHIN:g} points of the ratio",
        "not reproducible",
        within=100 * FINAL_RATIO_WITHIN / case2.measured_ratio,
        standard_error=_error_above_measured(case2),
    )
    yield row(
        "case3",
        "final ratio above the measured one",
        "4.0",
        _above_measured(case3),
        "%",
        "section 3.3; the printed 86.4 against 90 is 4.0 below, not above; here "
        f"{case3.final_ratio:.1f} against 90",
        standard_error=_error_above_measured(case3),
    )


def _above_measured(case: Case) -> float:
    """Returns the simulated over the measured final ratio, less 1; %."""
    return 100 * (case.final_ratio / case.measured_ratio - 1)


def _error_above_measured(case: Case) -> float | None:
    """Standard error of `_above_measured`, %; None for a single start."""
    error = case.final_ratio_error
    return None if error is None else 100 * error / case.measured_ratio
