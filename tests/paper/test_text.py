"""The numbers in the text of the paper, from runs that are made up."""

from types import SimpleNamespace

import numpy as np
import pytest

import mrjax
from mrjax.paper import text
from mrjax.paper.case import Case

VELOCITIES = {"case1": 480.0, "case2": 9.2, "case3": 4.5, "printed f_w": 9.3}
RATIOS = {"case1": 70.2, "case2": 70.2, "case3": 90.9}


@pytest.fixture(scope="module")
def computed():
    runs = SimpleNamespace(
        velocities=VELOCITIES,
        final_ratio=RATIOS.get,
        final_ratios=lambda case: np.array([RATIOS[case] - 0.78, RATIOS[case] + 0.78]),
    )
    cases = {name: Case(name, mrjax.Recipe.load(name), runs) for name in RATIOS}
    return {(row.case, row.quantity): row for row in text.rows(cases, runs)}


@pytest.mark.parametrize(
    "case, quantity, value",
    [
        ("case1", "particles in the box", 314),
        ("case3", "particles in the box", 292),
        # rho_f v d / mu, of 4 um in 0.01 Pa s.
        ("case1", "Reynolds number in the text", 950 * 0.48 / 86400 * 4e-6 / 0.01),
        ("case1", "calculated over measured velocity, more than", 60.0),
        ("case2", "initial settling velocity with the printed f_w", 9.3),
        ("case2", "velocity above the measured one", 15.0),
        ("case3", "velocity above the measured one", 25.0),
        # 70.2 against 78, below; 90.9 against 90, above.
        ("case2", "final ratio below the measured one", 10.0),
        ("case3", "final ratio above the measured one", 1.0),
    ],
)
def test_a_number_of_the_text_by_hand(computed, case, quantity, value):
    assert computed[case, quantity].computed == pytest.approx(value, rel=1e-9, abs=0.0)


def test_an_error_is_that_of_the_ratio_over_the_measured_one(computed):
    """0.78 is the standard error of 70.2 less and more 0.78."""
    found = {key: one.standard_error for key, one in computed.items() if one.standard_error}
    assert found == {
        ("case2", "final ratio below the measured one"): pytest.approx(1.0),
        ("case3", "final ratio above the measured one"): pytest.approx(100 * 0.78 / 90),
    }


def test_these_are_all(computed):
    assert len(computed) == 9
