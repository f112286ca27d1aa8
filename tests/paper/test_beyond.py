"""Rows beyond the paper: final ratios with attraction and rolling resistance."""

from types import SimpleNamespace

import jax.numpy as jnp
import pytest

import mrjax
from mrjax.paper import beyond


def bed(eye, top):
    """M beds at rest with these ratios by the eye and by the highest particle."""
    ratio = {beyond.EYE: jnp.array(eye), "top": jnp.array(top)}
    return SimpleNamespace(
        ratio=lambda height="top": jnp.stack([jnp.ones(len(eye)), ratio[height]], axis=1),
        parameters=SimpleNamespace(friction=0.3),
    )


def test_a_row_stands_beside_the_measured_ratio():
    estimate = "attraction and rolling resistance"
    (row,) = beyond.rows({("case3", estimate): bed([0.88, 0.90, 0.92], [0.92, 0.94, 0.96])})
    assert (row.case, row.printed, row.status) == ("case3", 90.0, "beyond the paper")
    assert row.computed == pytest.approx(90.0, rel=1e-12)
    assert row.standard_error == pytest.approx(2.0 / 3.0**0.5, rel=1e-12)
    assert "top of the highest particle 94.0" in row.reason
    assert "Bond number 0.054, friction 0.3, rolling resistance 0.1" in row.reason


def test_a_single_start_has_no_standard_error():
    (row,) = beyond.rows({("case2", "attraction"): bed([0.8], [0.84])})
    assert row.standard_error is None and "rolling" not in row.reason


@pytest.mark.parametrize("case, bond", [("case2", 10.0), ("case3", 0.05)])
def test_the_estimates_have_the_stated_bond_numbers(case, bond):
    parameters = beyond.estimated(case, 0.1).parameters()
    # Rounded in the text: 9.92 and 0.0539.
    assert float(jnp.max(mrjax.bond_number(parameters))) == pytest.approx(bond, rel=0.08)
    assert float(parameters.rolling_friction) == 0.1


def test_the_walls_do_not_attract():
    parameters = beyond.estimated("case2", 0.0).parameters()
    assert parameters.hamaker.shape == (2, 2)
    assert float(parameters.hamaker[0, 0]) == beyond.HAMAKER
    assert float(parameters.hamaker[0, 1]) == float(parameters.hamaker[1, 0]) == 0.0
