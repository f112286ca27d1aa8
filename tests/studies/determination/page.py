"""The page of what fits call determined."""

from pathlib import Path

import numpy as np
from scipy.stats import binom

from mrjax.io.files import markdown_table

from . import measure
from .reference import DENSE, FINISHED_STARTS, STARTS

PAGE = Path(__file__).parent / "README.md"
TOO_LARGE, SMALL = 0.4, 0.25
"""Exact error over the prior's width above which nothing is to be called determined, and below
which it is."""
AS_GOOD = 0.1
"""Chi-squared, priors included, within which two optima are as good."""
CHANCE = 0.01
"""Of a share of intervals outside its limits where the intervals are right."""


ROWS = {
    "problems": "problems",
    "converged": "fits that converged",
    "values": "fitted values",
    "determined": "values called determined",
    "determined with a large error": "of these, with a large exact error",
    "with a small error": "values with a small exact error",
    "with a small error and called so": "of these, called determined",
    "with a small error, about the fit": "small exact error, and the interval contains the fit",
    "with a small error, about the fit, and called so": "of these, called determined",
    "worse than the best of many starts": "fits worse than the best of many starts",
    "worse than the truth": "fits worse than the truth",
    "68 % intervals that hold the truth": "68 % intervals that contain the truth",
    "95 % intervals that hold the truth": "95 % intervals that contain the truth",
}
"""Rows of the table, by the names of `counts`."""


def counts(rows: list[dict]) -> dict[str, float]:
    """What is asked of the problems."""
    problems = list({(row["design"], row["problem"]): row for row in rows}.values())
    determined = [row for row in rows if row["status"] == "determined"]
    small = [row for row in rows if row["exact"] < SMALL]
    return {
        "problems": len(problems),
        "converged": sum(int(row["converged"]) for row in problems),
        "values": len(rows),
        "determined": len(determined),
        "determined with a large error": sum(row["exact"] > TOO_LARGE for row in determined),
        "with a small error": len(small),
        "with a small error and called so": sum(row["status"] == "determined" for row in small),
        "with a small error, about the fit": sum(int(row["beside"]) for row in small),
        "with a small error, about the fit, and called so": sum(
            row["status"] == "determined" for row in small if int(row["beside"])
        ),
        "worse than the best of many starts": sum(
            row["objective"] > row["best"] + AS_GOOD for row in problems
        ),
        "worse than the truth": sum(
            row["objective"] > row["of_truth"] + AS_GOOD for row in problems
        ),
        **{
            f"{level} intervals that hold the truth": sum(int(row[level]) for row in determined)
            for level in ("68 %", "95 %")
        },
    }


def limits(number: int, level: str) -> tuple[int, int]:
    """Fewest and most of N intervals that hold the truth, but for `CHANCE`."""
    share = float(level.removesuffix(" %")) / 100.0
    low, high = binom.ppf([CHANCE / 2, 1 - CHANCE / 2], number, share)
    return int(low), int(high)


def text() -> str:
    """The page as Markdown."""
    rows = measure.known()
    said = counts(rows)
    held = {level: limits(int(said["determined"]), level) for level in ("68 %", "95 %")}
    off = [row["said"] / row["exact"] for row in rows if row["exact"] < np.inf]
    table = markdown_table(
        ["quantity", "number"],
        [
            *([ROWS.get(name, name), f"{value:g}"] for name, value in said.items()),
            *([f"{level} intervals, expected", f"{a} to {b}"] for level, (a, b) in held.items()),
        ],
    )
    return f"""# Determined values

This page compares the verdict "determined" of a fit with an independent answer.

The problems are synthetic. Each has two or three fitted values and one of three models: the closed
form, the column or particles (`designs.py`). The truth is drawn from the priors, and noise is added
to the readings that the model predicts. `calibrate` fits each problem like an experiment.

The independent answer (`reference.py`) has two parts, both refined with scipy:

- The exact error is half the profile interval of a value, by the data without the priors. It begins
  with predictions on a grid of {DENSE[2]} values of each of two parameters, or {DENSE[3]} of each
  of three.
- The best optimum is that of {FINISHED_STARTS + 1} starts: the truth, and the best of the grid and
  of {STARTS} draws from the priors.

Errors are divided by the width of the prior. They are large above {TOO_LARGE} and small below
{SMALL}. The data alone may have their optimum elsewhere, at values that the prior excludes. Such an
interval says nothing about the fit, so the table also counts the intervals that contain the fit.

Made by `python -m tests.studies.determination`.

{table}
In nine of ten intervals with both ends found, the error that the fit states is between
{np.nanquantile(off, 0.05):.3f} and {np.nanquantile(off, 0.95):.3f} times the exact error.
"""
