"""Writes the validation page: `python -m tests.studies.validation` from the repository's top."""

from pathlib import Path

import jax

PAGE = Path(__file__).parent

HEADER = """# Validation

Every row: a case, what is known, what the simulator computes, the error, and the bar it has to
keep, if any. Errors are relative to the reference, or to the scale of the case where that may be
zero; "worst of" many shows the largest. Made by `python -m tests.studies.validation`; the tests run
the same cases and fail where a row leaves its bar or this page is out of date.
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
