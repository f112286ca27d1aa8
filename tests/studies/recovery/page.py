"""The recovery page."""

from pathlib import Path

import numpy as np

from calibrate.inference.profile import LEVELS
from mrjax.core.text import in_code
from mrjax.io.files import markdown_table

from . import coverage

PAGE = Path(__file__).parent / "README.md"


def text() -> str:
    """The page as Markdown."""
    rows = [
        [
            experiment,
            model,
            by,
            in_code(parameter),
            one["sets"],
            one["converged"],
            one["on_a_kink"],
            f"{np.median(one['runs']):.0f}, {max(one['runs'])}",
            *(
                f"{one[level]} ({low} to {high})"
                for level in LEVELS
                for low, high in [coverage.limits(one["sets"], level)]
            ),
        ]
        for (experiment, model, by, parameter), one in coverage.held(coverage.known()).items()
    ]
    table = markdown_table(
        [
            "experiment",
            "model",
            "intervals by",
            "parameter",
            "sets",
            "converged",
            "of these on a kink",
            "model runs: median, most",
            *(f"{level} interval holds the truth" for level in LEVELS),
        ],
        rows,
    )
    return f"""# Recovery

Synthetic data sets with noise: truths drawn from the priors, data from the model with the stated
errors. How many of the stated intervals hold the truth, and in brackets how many should, but for a
chance of one in a hundred: those of the profile likelihood, or one and 1.96 standard errors from
the curvature at the optimum. Where a mudline meets its bed at the time of a reading slopes jump:
fits that end on such a kink take a simplex, and more runs. Made by `python -m
tests.studies.recovery`.

{table}"""
