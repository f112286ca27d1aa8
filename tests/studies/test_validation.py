"""The validation suite keeps its bars, and the page that shows it is up to date."""

from pathlib import Path

import pytest

from tests.studies.validation import page

QUICK = "Collisions of LIGGGHTS 3.8"
"""What the other suites hold to their bars, tests of each law guard in an ordinary run."""
suites = pytest.mark.parametrize(
    "title",
    [one if one == QUICK else pytest.param(one, marks=pytest.mark.slow) for one in page.SUITES],
)
PAGE = Path(__file__).parent / "validation" / "README.md"


@pytest.fixture(scope="module")
def written() -> dict[tuple[str, str, str], list[str]]:
    """The rows of the page, by case, quantity and source of the reference."""
    lines = (line.strip("| \n").split(" | ") for line in PAGE.read_text("utf-8").splitlines())
    return {(line[0], line[1], line[-1]): line for line in lines if len(line) == len(page.COLUMNS)}


@suites
def test_every_row_keeps_its_bar_and_the_page_shows_it(title, written):
    """In one test with its figures: a suite takes minutes, and is computed once in a process."""
    rows = page.rows(title)
    assert len(rows) > 10
    left = [page.cells(row) for row in rows if not row.passes]
    assert not left
    for row in rows:
        cells, scale = written[row.case, row.quantity, row.source], row.scale or row.reference
        assert abs(float(cells[2]) - row.reference) <= 1e-4 * abs(row.reference)  # five digits
        # Rounding of another machine may move a number by far less than its bar.
        moved = 0.1 * (row.bar or 1e-2) * abs(scale) + 1e-4 * abs(row.computed)
        assert abs(float(cells[3]) - row.computed) <= moved
    for name in page.SUITES[title].figures():
        assert f"({name}.png)" in PAGE.read_text("utf-8")
        assert (PAGE.parent / f"{name}.png").stat().st_size > 5000
