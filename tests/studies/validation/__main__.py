"""Writes the validation page: `python -m tests.studies.validation` from the repository's top."""

from pathlib import Path

import jax

PAGE = Path(__file__).parent

HEADER = """# Validation

Each row compares a computed value with a reference. The error is relative to the reference, or to
the scale of the case if the reference may be zero. The bar is the largest error that passes; some
rows have none. "Worst of" several values shows the one with the largest error.

Made by `python -m tests.studies.validation`. The tests run the same cases, and fail if an error
exceeds its bar or if this page is out of date.
"""


def main() -> None:
    """Runs every case; writes README.md and the figures beside this file."""
    jax.config.update("jax_enable_x64", True)
    from . import page

    (PAGE / "README.md").write_text(page.text(HEADER), encoding="utf-8")
    jax.clear_caches()  # a process may map so many compiled programs, and no more
    for name, figure in page.figures().items():
        figure.savefig(PAGE / f"{name}.png", dpi=120)


if __name__ == "__main__":
    main()
