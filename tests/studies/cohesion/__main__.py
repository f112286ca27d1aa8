"""Measures the beds of mrjax that are missing: `python -m tests.studies.cohesion`, some minutes."""

import csv

import jax

from mrjax.io import files
from tests.studies.cohesion import beds, page


def main() -> None:
    """Adds missing beds to `beds.csv`, and writes README.md."""
    jax.config.update("jax_enable_x64", True)
    known = beds.measured()
    keys = {bed[:4] for bed in known}
    for bed in known:
        if bed.code == "LAMMPS" and ("mrjax", *bed[1:4]) not in keys:
            with beds.FILE.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerow(beds.settled(*bed[1:4]))
    files.write_text(page.PAGE, page.text())


if __name__ == "__main__":
    main()
