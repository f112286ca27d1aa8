"""Measures the curves, those that are named or are missing, and writes the page and its figure."""

import sys

import jax

from mrjax.io import files
from tests.studies.compressive_yield import curves, page, tubes


def main(names: list[str]) -> None:
    """Measures these conditions, or those that are missing, and writes README.md and yield.png."""
    known = curves.curves() if curves.DATA.exists() else {}
    curves.write(names or [name for name in curves.CONDITIONS if name not in known])
    settled = tubes.settled()
    page.figure(settled).savefig(page.FIGURE, dpi=150)
    files.write_text(page.TEXT, page.text(settled))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main(sys.argv[1:])
