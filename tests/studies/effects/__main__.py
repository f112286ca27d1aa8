"""Compares models on synthetic data sets: `python -m tests.studies.effects FIRST LAST [STEP]`."""

import sys

import jax

from tests.studies.effects import synthetic


def main() -> None:
    """Appends the verdicts of the numbered sets to the file beside this one."""
    jax.config.update("jax_enable_x64", True)
    for number in range(*map(int, sys.argv[1:])):
        row = synthetic.verdicts(synthetic.the_set(number), synthetic.TRIED)
        synthetic.append(row)
        print(*row.values(), sep=", ", flush=True)


if __name__ == "__main__":
    main()
