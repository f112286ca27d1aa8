"""The files of a report: JSON, Markdown with its figures, and one HTML page."""

import base64
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from tqdm import tqdm

from calibrate.models.tube import Tube
from mrjax import save_column
from mrjax.core.text import in_html
from mrjax.io import files

MADE_BY = ("experiment", "lab_sheets", "model", "seed", "dtype", "versions")
"""Entries of a result that are also in the metadata of its figures."""

PIXELS_PER_INCH = 144
"""Resolution of figures on the page."""


def write(
    folder: Path,
    text: str,
    result: dict[str, Any],
    figures: dict[str, Figure],
    pdf: bool,
    progress: bool = False,
) -> None:
    """Writes `fit.json`, `report.md` with its figures, and `report.html` with all in one file.

    `progress`: whether to show a progress bar, on standard error.
    """
    files.write_json(folder / "fit.json", result)
    files.write_text(folder / "report.md", text)
    made_by = {name: result[name] for name in MADE_BY}
    page = _html(f"{result['experiment']}, fitted with the {result['model']} model", text)
    for name, figure in tqdm(figures.items(), desc="figures", disable=not progress, leave=False):
        files.write_figure(folder, name, figure, made_by, pdf)
        image = base64.b64encode((folder / f"{name}.png").read_bytes()).decode("ascii")
        # At this width the letters of the figure are as large as those of the page.
        width = round(PIXELS_PER_INCH * figure.get_figwidth())
        page = page.replace(
            f'src="{name}.png"', f'src="data:image/png;base64,{image}" width="{width}"'
        )
    files.write_text(folder / "report.html", page)


def write_tubes(folder: Path, tubes: Mapping[str, Tube], result: dict[str, Any]) -> None:
    """Writes the fields of the tube of each sample, as CSV and `.npz`.

    With several samples, the names of the files end in that of the sample, or in its number if a
    file cannot have such a name.
    """
    made_by = {name: result[name] for name in MADE_BY}
    for number, (sample, tube) in enumerate(tubes.items(), 1):
        plain = re.fullmatch(r"[A-Za-z0-9_-]{1,40}", sample)
        ending = f"-{sample if plain else number}" if len(tubes) > 1 else ""
        for suffix in ("csv", "npz"):
            save_column(folder / f"fields{ending}.{suffix}", tube, made_by | {"sample": sample})


def _html(title: str, text: str) -> str:
    """The report as a page."""
    renderer = MarkdownIt("commonmark", {"html": False}).enable("table")
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{in_html(title)}</title>
<style>
body {{ font: 16px/1.5 sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }}
table {{ border-collapse: collapse; }}
td, th {{ border-bottom: 1px solid #ccc; padding: 0.2rem 0.8rem; text-align: left; }}
img {{ max-width: 100%; }}
</style></head>
<body>
{renderer.render(text)}</body>
</html>
"""
