"""Compares models on synthetic data sets: `python -m tests.studies.effects FIRST LAST [STEP]`."""

import sys

import jax

from mrjax.io import files
from tests.studies.effects import coverage, page, synthetic


def main() -> None:
    """Appends verdicts and coverage of the numbered sets to their files, and writes README.md."""
    jax.config.update("jax_enable_x64", True)
    for number in range(*map(int, sys.argv[1:])):
        row = synthetic.verdicts(synthetic.the_set(number), synthetic.TRIED)
        synthetic.append(row)
        print(*row.values(), sep=", ", flush=True)
    covered = {one.number for one in coverage.measured()}
    for row in page.sets():
        if int(row["set"]) not in covered:
            chosen = synthetic.the_set(int(row["set"]))
            coverage.append(coverage.rise(chosen, float(row["error_mm"])))
    files.write_text(page.PAGE, page.text())


if __name__ == "__main__":
    main()
