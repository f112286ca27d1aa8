"""Measures the problems and writes the page: `python -m tests.studies.determination`."""

import jax

from . import measure, page


def main() -> None:
    """Fits all problems, design by design, then writes README.md beside this file."""
    jax.config.update("jax_enable_x64", True)
    rows = []
    for number in range(measure.DESIGNS + 1):
        rows += measure.measured(range(number, number + 1))
        measure.write(rows)
    page.PAGE.write_text(page.text(), encoding="utf-8")


if __name__ == "__main__":
    main()
