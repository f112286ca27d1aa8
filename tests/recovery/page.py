"""The recovery page."""

from pathlib import Path

import numpy as np

from calibrate.profile import LEVELS
from mrjax.files import markdown_table

from . import coverage

PAGE = Path(__file__).parent / "README.md"


def text() -> str:
    """The page as Markdown."""
    rows = [
        [
            experiment,
            model,
            by,
            f"`{parameter}`",
            one["sets"],
            one["converged"],
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
            "model runs: median, most",
            *(f"{level} interval holds the truth" for level in LEVELS),
        ],
        rows,
    )
    return f"""# Recovery

Synthetic data sets with noise: truths drawn from the priors, data from the model with the stated
errors. How many of the stated intervals hold the truth, and in brackets how many should, but for a
chance of one in a hundred: those of the profile likelihood, or one and 1.96 standard errors from
the curvature at the optimum. Made by `python -m tests.recovery`.

{table}"""
