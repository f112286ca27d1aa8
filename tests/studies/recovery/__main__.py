"""Measures the recovery page and writes it: `python -m tests.studies.recovery`."""

import jax

from . import coverage, page


def main() -> None:
    """Fits all data sets, then writes README.md beside this file."""
    jax.config.update("jax_enable_x64", True)
    rows = []
    for (experiment, model, by), sets in coverage.SETS.items():
        rows += coverage.measured(experiment, model, by, range(sets))
        coverage.write(rows)
    page.PAGE.write_text(page.text(), encoding="utf-8")


if __name__ == "__main__":
    main()
