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
            "on a kink",
            "model runs, median and most",
            *(f"truth in {level} interval" for level in LEVELS),
        ],
        rows,
    )
    return f"""# Recovery

This page counts how often the intervals of a fit contain the truth.

The data sets are synthetic. The truth is drawn from the priors, and noise with the stated errors is
added to the predictions of the model. An interval is that of the profile likelihood, or one and
1.96 standard errors from the curvature at the optimum. The range in brackets contains the count of
correct intervals with a probability of 99 %.

The slope of a mudline jumps at the time at which it meets the bed. If that is the time of a
reading, a fit can end on a kink. It then continues with a simplex, and takes more model runs.

Made by `python -m tests.studies.recovery`.

{table}"""
