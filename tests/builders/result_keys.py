"""Keys of `summary.json` and `fit.json`, as `docs/reference/result_files.md` lists them."""

import re
from typing import Any

from . import ROOT

PAGE = (ROOT / "docs" / "reference" / "result_files.md").read_text("utf-8")


def documented(heading: str) -> set[str]:
    """The keys in the table below a heading."""
    (section,) = re.findall(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", PAGE, re.M | re.S)
    cells = re.findall(r"^\| (`[^|]*?) \|", section, re.M)
    return {key for cell in cells for key in re.findall(r"`(\w+)`", cell)}


TABLES = {
    "parameters": "Parameters",
    "determined_combinations": "Combinations",
    "near_combinations": "Combinations",
    "predictions": "Predictions",
    "left_out": "Predictions",
    "new": "Predictions",
    "curves": "Curves",
    "scatter": "Scatter",
    "runs": "Runs tests",
    "optima": "Optima",
}
"""Entries of `fit.json` that hold many tables, and the heading of their keys."""


def undocumented(fit: dict[str, Any]) -> set[str]:
    """Keys of `fit.json` that the page does not list."""
    keys = set(fit) - documented("fit.json")
    for entry, heading in TABLES.items():
        content = fit.get(entry, [])
        for table in content.values() if isinstance(content, dict) else content:
            keys |= {f"{entry}.{key}" for key in set(table) - documented(heading)}
    return keys | {
        f"posterior.{key}" for key in set(fit["posterior"] or {}) - documented("Posterior")
    }
