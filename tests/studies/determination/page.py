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
        ["of the problems", "number"],
        [
            *([name, f"{value:g}"] for name, value in said.items()),
            *([f"{level} intervals, expected", f"{a} to {b}"] for level, (a, b) in held.items()),
        ],
    )
    return f"""# What fits call determined

Synthetic problems: truths drawn from the priors, readings from the model with noise, two or three
values, by the closed form, the column and particles (`designs.py`). Each is fitted as an experiment
is, and beside it stands an independent answer (`reference.py`): predictions on a grid of
{DENSE[2]} values of each of two parameters, or {DENSE[3]} of each of three, from whose best places
scipy goes on. So are found the error that the data alone leave, by a profile, and the best optimum:
of the grid, of {STARTS} draws from the priors and of the truth, of which {FINISHED_STARTS + 1} are
finished. Errors are over the width of the prior: large above {TOO_LARGE}, small below {SMALL}. An
interval of the data is about the fit if the fit is in it: the data alone may have another optimum,
which priors exclude, and of that nothing is to be said.
Made by `python -m tests.studies.determination`.

{table}

Where the reference finds the ends of an interval, the error that a fit states is between
{np.nanquantile(off, 0.05):.3f} and {np.nanquantile(off, 0.95):.3f} times it in nine of ten.
"""
