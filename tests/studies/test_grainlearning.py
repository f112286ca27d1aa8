"""The comparisons that are stored: pages say what was measured, and what was measured is enough."""

import numpy as np
import pytest

from tests.studies.benchmarks.grainlearning import ours, page, problem


def test_the_page_shows_what_was_measured():
    assert page.text() == page.PAGE.read_text("utf-8")


def test_the_ridge_is_found_in_few_runs_and_named():
    results = page.known()
    assert len(results["ours"]) == len(results["theirs"]) == len(problem.SEEDS)
    for one in results["ours"]:
        assert one["runs"] <= 15 and one["runs_without_priors"] <= 15
        assert one["ridge"] == ["f_s * v_0"]
    # 4 chains of 500 draws, of which half are independent: 3 % of a standard deviation.
    by_nuts = page.stated_over_exact(results["ours"], results["log_normal"], "deviation")
    assert np.abs(by_nuts - 1.0).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 7])
def test_a_fit_of_today_does_as_stored(seed):
    known = page.known()["ours"][seed]
    data = problem.measured(seed)
    found = ours.calibrated(data, seed)
    assert found["runs"] <= 15 and found["ridge"] == known["ridge"]
    np.testing.assert_allclose(found["curvature"], known["curvature"], rtol=1e-3)
    exact = problem.log_normal_posterior(data, ours.LOG_STANDARD_DEVIATION)
    np.testing.assert_allclose(exact.mean, page.known()["log_normal"][seed]["mean"], rtol=1e-9)


def test_the_grid_is_that_of_a_gaussian_where_it_is_one():
    """n and v_0 / f_s are hardly bent: least squares in their logarithms."""
    exact = problem.uniform_posterior(problem.measured(1))
    design = np.stack([np.ones(8), np.log(1 - problem.FRACTIONS)], axis=1) / problem.NOISE
    spread = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert exact.deviation[2] == pytest.approx(spread[1], rel=0.05)
    assert exact.deviation[3] / exact.mean[3] == pytest.approx(spread[0], rel=0.05)
