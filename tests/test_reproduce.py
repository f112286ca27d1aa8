"""The paper recomputed: which printed numbers stand, which are corrected, which are neither."""

import json
from functools import partial

import pytest

from mrjax import reproduce
from mrjax.files import write_json

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12


@pytest.fixture(scope="module")
def rows():
    return {(row.case, row.quantity): row for row in reproduce.rows(seed=2)}


@pytest.mark.parametrize(
    "case, quantity, printed, computed, status",
    [
        ("case1", "initial settling velocity", 491.2, 491.222, "reproduced"),
        ("case2", "initial settling velocity", 9.2, 9.1164, "corrected"),
        ("case2", "initial settling velocity with the printed f_w", 9.2, 9.2094, "reproduced"),
        ("case3", "initial settling velocity", 4.0, 4.8955, "not reproducible"),
        ("case1", "Reynolds number", 2.16e-6, 2.1605e-6, "reproduced"),
        ("case1", "Reynolds number in the text", 2.167e-6, 2.1605e-6, "corrected"),
        ("case2", "Reynolds number", 2.41e-8, 4.0095e-8, "corrected"),
        ("case3", "Reynolds number", 6.82e-9, 1.4098e-8, "corrected"),
        ("case2", "wall correction factor", 48.49, 48.985, "corrected"),
        ("case3", "wall correction factor", 48.99, 48.985, "reproduced"),
        ("case1", "computation time step", 100.0, 0.10320, "corrected"),
        ("case2", "computation time step", 0.1, 0.10320, "reproduced"),
        ("case1", "particles in the box", 314, 314, "reproduced"),
        ("case3", "particles in the box", 292, 292, "reproduced"),
        ("Eq. 14", "coefficient", 389.153, 389.152, "reproduced"),
        ("Eq. 14", "exponent", 7.5593, 7.5593, "reproduced"),
        ("Eq. 14", "upper limit of f_w", 48.985, 49.023, "corrected"),
    ],
)
def test_a_printed_number(rows, case, quantity, printed, computed, status):
    row = rows[case, quantity]
    assert row.printed == near(printed)
    assert row.computed == near(computed, rel=1e-4)
    assert row.status == status
    assert row.reason or status == "reproduced"


def test_the_slips_are_explained_by_numbers(rows):
    assert "4.046" in rows["case3", "initial settling velocity"].reason
    assert "48.495" in rows["case2", "wall correction factor"].reason
    assert "49.52" in rows["case2", "wall correction factor"].reason
    assert "h_t = 20.6" in rows["case2", "computation time step"].reason
    assert "48 t_c" in rows["case1", "computation time step"].reason


def test_every_case_has_every_number_of_the_table(rows):
    quantities = [{q for c, q in rows if c == case} for case in reproduce.CASES]
    table = set.intersection(*quantities)
    assert len(table) == 11
    for row in rows.values():
        assert row.status in {"reproduced", "corrected", "not reproducible", "not yet"}
        assert (row.computed is None) == (
            row.status == "not yet" or row.quantity.endswith("measured")
        )


def test_a_row_is_reproduced_to_its_printed_digits():
    assert reproduce.row("c", "q", "9.2", 9.2499, "1").status == "reproduced"
    assert reproduce.row("c", "q", "9.2", 9.2501, "1").status == "corrected"
    assert reproduce.row("c", "q", "2.16e-6", 2.1649e-6, "1").status == "reproduced"
    assert reproduce.row("c", "q", "2.16e-6", 2.1651e-6, "1").status == "corrected"
    assert reproduce.row("c", "q", "4", None, "1", otherwise="not yet").status == "not yet"


def test_rows_are_written_as_json(rows, tmp_path):
    write_json(tmp_path / "rows.json", reproduce.as_tables(list(rows.values())))
    read = json.loads((tmp_path / "rows.json").read_text())
    keys = {"case", "quantity", "printed", "computed", "unit", "status", "reason"}
    assert all(set(row) == keys for row in read)
