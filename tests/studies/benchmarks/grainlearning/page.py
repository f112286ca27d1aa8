"""The comparison as a page."""

import json
from pathlib import Path

import numpy as np

from mrjax.core.text import Markdown, in_code
from mrjax.io.files import markdown_table

from . import ours, problem

RESULTS = Path(__file__).with_name("results.json")
PAGE = Path(__file__).with_name("README.md")

OURS = in_code("calibrate")
BY_CURVATURE, BY_NUTS = Markdown(f"{OURS}, curvature"), Markdown(f"{OURS}, NUTS")


def known() -> dict:
    """What was measured last."""
    return json.loads(RESULTS.read_text("utf-8"))


def stated_over_exact(found: list[dict], exact: list[dict], what: str) -> np.ndarray:
    """Stated standard deviations over those of the exact posterior, (seeds, 4)."""
    return np.array([one[what] for one in found]) / np.array([one["deviation"] for one in exact])


def off(found: list[dict], exact: list[dict]) -> np.ndarray:
    """Stated less exact means, in exact standard deviations; (seeds, 4)."""
    stated, mean, deviation = (
        np.array([one[what] for one in of])
        for of, what in ((found, "mean"), (exact, "mean"), (exact, "deviation"))
    )
    return (stated - mean) / deviation


def _span(values: np.ndarray) -> str:
    return f"{np.median(values):.2g} ({values.min():.2g} to {values.max():.2g})"


def _runs(found: list[dict], key: str) -> str:
    runs = [one[key] for one in found]
    return f"{np.median(runs):.0f} ({min(runs)} to {max(runs)})"


def text() -> str:
    """The page as Markdown."""
    results = known()
    theirs, mine = results["theirs"], results["ours"]
    uniform, log_normal = results["uniform"], results["log_normal"]
    ridges = sorted({one for found in mine for one in found["ridge"]})
    determined = sorted({one for found in mine for one in found["determined"]})
    runs = markdown_table(
        ["", f"GrainLearning {results['version']}", OURS],
        [
            ["model runs", _runs(theirs, "runs"), _runs(mine, "runs")],
            ["model runs without priors", "", _runs(mine, "runs_without_priors")],
            [
                "statement about the ridge",
                "nothing",
                Markdown(
                    f"data determine {', '.join(map(in_code, determined))}; "
                    f"nothing is known of {', '.join(map(in_code, ridges))}"
                ),
            ],
        ],
    )
    compared = [
        stated_over_exact(theirs, uniform, "deviation"),
        stated_over_exact(mine, log_normal, "curvature"),
        stated_over_exact(mine, log_normal, "deviation"),
    ]
    deviations = markdown_table(
        ["quantity", "GrainLearning", BY_CURVATURE, BY_NUTS],
        [
            [in_code(name), *(_span(one[:, place]) for one in compared)]
            for place, name in enumerate(problem.QUANTITIES)
        ],
    )
    shifts = [np.abs(off(theirs, uniform)), np.abs(off(mine, log_normal))]
    means = markdown_table(
        ["quantity", "GrainLearning", BY_NUTS],
        [
            [in_code(name), *(_span(one[:, place]) for one in shifts)]
            for place, name in enumerate(problem.QUANTITIES)
        ],
    )
    truth = ", ".join(f"{name} = {value:g}" for name, value in problem.TRUTH.items())
    return f"""# Beside GrainLearning

GrainLearning and `calibrate` fit the same problem: the velocity
v(phi) = v_0 / f_s (1 - phi)^n at {problem.FRACTIONS.size} volume fractions, with
{problem.NOISE:.0%} noise. The truth is {truth}. The data depend on v_0 and f_s only through their
ratio, so the posterior has a ridge. Numbers are medians over {len(problem.SEEDS)} seeds, with the
range in brackets.

- GrainLearning has a uniform prior from a third of the truth to {problem.RANGE:g} times the truth,
  and the settings of its own example: 10 samples in an iteration, up to its tolerance or
  10 iterations.
- `calibrate` starts {problem.RANGE:g} times too high in every value. Its priors are log-normal
  about the truth with the same variance, {ours.LOG_STANDARD_DEVIATION:.3f} in the logarithm. One
  model run gives the values and their Jacobian.

Made by `python -m tests.studies.benchmarks.grainlearning`.

{runs}
The next table divides the stated standard deviation by that of the exact posterior, each with the
prior of its tool. 1 is exact; a smaller number is too confident.

{deviations}
The last table has the distance of the stated mean from the exact mean, in exact standard
deviations.

{means}"""
