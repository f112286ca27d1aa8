"""The validation page from the rows of every suite."""

from functools import cache

from matplotlib.figure import Figure

from mrjax.io.files import markdown_table

from . import chung_ooi, liggghts, mfix
from .row import Row

COLUMNS = ["case", "quantity", "reference", "computed", "unit", "error", "bar", "reference from"]

SUITES = {
    "Chung & Ooi (2011), tests 1 to 8": chung_ooi,
    "MFiX, DEM01 to DEM06": mfix,
    "Collisions of LIGGGHTS 3.8": liggghts,
}
"""The suites by their titles; each has `rows()`, `figures()` and a `NOTE` on how to read them."""


@cache
def rows(title: str) -> list[Row]:
    """The rows of one suite, computed once."""
    return SUITES[title].rows()


@cache
def differences() -> list[Row]:
    """The package beside LIGGGHTS where their laws differ; not held to a bar."""
    return liggghts.differences()


def figures() -> dict[str, Figure]:
    """The figures of every suite, by the name of their file."""
    return {name: figure for suite in SUITES.values() for name, figure in suite.figures().items()}


def text(header: str) -> str:
    """The page as Markdown."""
    parts = [header]
    for title, suite in SUITES.items():
        parts += [f"## {title}\n", suite.NOTE]
        parts.append(markdown_table(COLUMNS, map(cells, rows(title))))
    parts += ["## Differences from LIGGGHTS' law\n", liggghts.DIFFERENCES_NOTE]
    parts.append(markdown_table(COLUMNS, map(cells, differences())))
    parts.append("## Figures\n")
    parts += [f"`{name}`\n\n![{name.replace('_', ' ')}]({name}.png)\n" for name in figures()]
    return "\n".join(parts)


def cells(row: Row) -> list[str]:
    """A row as it stands on the page."""
    return [
        row.case,
        row.quantity,
        f"{row.reference:.5g}",
        f"{row.computed:.5g}",
        row.unit,
        f"{row.error:.1e}",
        "" if row.bar is None else f"{row.bar:.1e}",
        row.source,
    ]
