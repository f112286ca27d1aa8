"""Importance sampling of a posterior against exact answers and dense grids."""

from collections import OrderedDict

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp

from calibrate import LogNormal
from calibrate import fit as fitted_to
from calibrate.inference import importance, model_runs
from calibrate.inference.importance import Weighted
from calibrate.inference.posterior import posterior
from calibrate.inference.proposal import Proposal
from calibrate.least_squares.bounds import Bounds

pytest.importorskip("arviz_stats")

EVERYWHERE = Bounds(np.array(-np.inf), np.array(np.inf))


def on_a_grid(fit, *ends, points=301, log_density=None):
    """Logarithms of values on a dense grid, (G, P), and their weights by the posterior, (G,)."""
    axes = [np.linspace(*one, points) for one in ends]
    logs = np.stack([one.ravel() for one in np.meshgrid(*axes, indexing="ij")], axis=1)
    import jax

    residuals = np.asarray(jax.vmap(lambda at: fit.everything(at, fit.given))(jnp.asarray(logs)))
    density = -0.5 * np.sum(residuals**2, axis=1) if log_density is None else log_density(residuals)
    return logs, np.exp(density - logsumexp(density))


def agrees_with(drawn, logs, weights):
    """Means, standard deviations and products within four of their sampling errors."""
    found, number = np.log(drawn.samples), drawn.effective.min()
    middle = weights @ logs
    spread = np.sqrt(weights @ (logs - middle) ** 2)
    np.testing.assert_allclose((found.mean(0) - middle) / spread, 0.0, atol=4 / np.sqrt(number))
    scaled, exact = (found - middle) / spread, (logs - middle) / spread
    for power in ((2, 0), (0, 2), (1, 1), (2, 1)) if len(middle) == 2 else ((2,), (4,)):
        wanted = np.prod(exact ** np.array(power), axis=1)
        error = np.sqrt(weights @ wanted**2 - (weights @ wanted) ** 2) / np.sqrt(number)
        got = np.prod(scaled ** np.array(power), axis=1).mean()
        assert abs(got - weights @ wanted) < 4 * error, power


def straight(theta, data):
    return jnp.stack([3.0 * jnp.log(theta["a"]) + jnp.log(theta["b"]), jnp.log(theta["b"])]) - data


def test_samples_of_a_normal_posterior():
    """Exact means and covariance, by as many runs of the model as one batch has."""
    fit = fitted_to(
        straight,
        OrderedDict(a=1.0, b=1.0),
        data=np.array([1.0, 0.5]),
        priors={"b": LogNormal(2, 1)},
    )
    drawn = posterior(fit, seed=1)
    assert drawn.converged and drawn.method == "importance sampling" and drawn.divergences == 0
    assert drawn.pareto_k < 0.5 and 400 <= drawn.effective.min() <= importance.MOST
    assert drawn.samples.shape == (2000, 2)
    curved = fit.jacobian.T @ fit.jacobian + np.diag(fit.prior_precision)
    exact = np.linalg.inv(curved)
    logs, few = np.log(drawn.samples), 4 / np.sqrt(drawn.effective.min())
    spread = np.sqrt(np.diag(exact))
    np.testing.assert_allclose((logs.mean(0) - np.log(fit.values)) / spread, 0.0, atol=few)
    scaled = np.cov(logs.T) / np.outer(spread, spread)
    np.testing.assert_allclose(scaled, exact / np.outer(spread, spread), atol=np.sqrt(2) * few)
    np.testing.assert_array_equal(drawn.samples, posterior(fit, seed=1).samples)
    assert (drawn.samples != posterior(fit, seed=2).samples).any()


def banana(theta):
    x, y = jnp.log(theta["a"]), jnp.log(theta["b"])
    return jnp.stack([0.7 * (y - x**2), 1.0 - x])


def test_samples_of_a_banana():
    drawn = posterior(fit := fitted_to(banana, OrderedDict(a=1.0, b=1.0)))
    assert drawn.converged and drawn.method == "importance sampling"
    agrees_with(drawn, *on_a_grid(fit, (-5, 7), (-9, 50), points=801))


def two_valleys(theta):
    """(ln a)^2 = 4, broader and worse at ln a = -2; between them a ridge of chi-squared 64."""
    x = jnp.log(theta["a"])
    slope = jnp.where(x > 0, 2.0, 1.0)
    return jnp.stack([slope * (x**2 - 4.0), jnp.where(x > 0, 0.0, 0.5)])


def test_separated_optima_have_their_weights():
    fit = fitted_to(two_valleys, {"a": 8.0}, also=[{"a": 0.1}])
    assert len(fit.optima) == 2
    drawn = posterior(fit)
    assert drawn.converged and drawn.method == "importance sampling" and drawn.faults == ()
    logs, weights = on_a_grid(fit, (-5, 5), points=4001)
    left = weights[logs[:, 0] < 0].sum()
    assert 0.2 < left < 0.8
    found = np.mean(drawn.samples < 1.0)
    assert abs(found - left) < 4 * np.sqrt(left * (1 - left) / drawn.effective.min())
    agrees_with(drawn, logs, weights)


def leaning(theta):
    """Nothing but a pull to a lower bound."""
    return jnp.atleast_1d(0.8 * jnp.log(theta["a"]) + 1.0)


def test_bounds_bound():
    fit = fitted_to(leaning, {"a": 1.0}, bounds={"a": (0.5, 8.0)})
    drawn = posterior(fit)
    assert drawn.converged and drawn.samples.min() >= 0.5 and drawn.samples.max() <= 8.0
    agrees_with(drawn, *on_a_grid(fit, np.log((0.5, 8.0)), points=4001))


def test_a_value_of_which_only_its_bounds_tell_may_be_anywhere_between_them():
    fit = fitted_to(
        lambda theta: jnp.atleast_1d(jnp.log(theta["b"]) - 1.0 + 0.0 * theta["a"]),
        OrderedDict(a=1.0, b=1.0),
        bounds={"a": (0.1, 10.0)},
    )
    drawn = posterior(fit)
    assert drawn.converged
    agrees_with(drawn, *on_a_grid(fit, np.log((0.1, 10.0)), (-5, 7)))


def test_draws_of_equal_weight_are_as_many_as_their_weights_say():
    """Systematic resampling: each as often as its weight, to the next whole number."""
    weights = np.array([0.5, 0.25, 0.125, 0.125])
    logs = np.arange(4.0)[:, None]
    drawn = Weighted(logs, weights, 0.0).equal(16, np.random.default_rng(3))
    assert np.bincount(drawn[:, 0].astype(int)).tolist() == [8, 4, 2, 2]
    assert Weighted(logs, weights, 0.0).effective == pytest.approx(1 / 0.34375)


def test_a_proposal_with_short_tails_is_told_by_its_weights():
    """k of p / q is 1 - (variance of q) / (variance of p) for normal distributions."""
    random = np.random.default_rng(0)
    draws = random.normal(size=(20000, 1))

    class Normal:
        def log_density(self, logs):
            return -0.5 * np.sum(logs**2, axis=1)

    def weighted(variance):
        densities = -0.5 * np.sum(draws**2, axis=1) / variance
        return importance._weighted(importance._Drawn(Normal(), draws, densities))

    found = weighted(5.0)
    assert found.pareto_k == pytest.approx(0.8, abs=0.15)
    assert not found.good
    assert weighted(0.2).pareto_k < 0.0 and weighted(0.2).good


def test_a_proposal_follows_its_draws():
    """Fitted to draws of another t distribution: its centre, its scale, its share of two."""
    random = np.random.default_rng(0)
    scale = np.array([[2.0, 0.6], [0.6, 0.5]])
    wanted = Proposal(np.ones(1), np.array([[3.0, -1.0]]), scale[None])
    draws = wanted.draw(4000, random)
    begun = Proposal(
        np.array([0.5, 0.5]),
        np.array([[0.0, 0.0], [50.0, 50.0]]),
        np.stack([np.eye(2), 0.01 * np.eye(2)]),
    )
    found = begun
    for _ in range(10):
        found = found.adapted(draws, np.full(4000, 1 / 4000))
    np.testing.assert_allclose(found.centres[0], [3.0, -1.0], atol=0.1)
    np.testing.assert_allclose(found.scales[0], scale, atol=0.15)
    np.testing.assert_array_equal(found.centres[1], begun.centres[1])
    np.testing.assert_allclose(found.shares, [1 / 1.05, 0.05 / 1.05], rtol=1e-3)


class StoppedError(Exception):
    """In place of a kill."""


def test_importance_sampling_that_is_stopped_goes_on_with_the_same_bits(tmp_path, monkeypatch):
    fit = fitted_to(banana, OrderedDict(a=1.0, b=1.0))
    whole, run, left = posterior(fit, seed=3), model_runs.ModelRuns._run, [0]

    def stopping(self, logs):
        left[0] -= 1
        if left[0] < 0:
            raise StoppedError
        return run(self, logs)

    monkeypatch.setattr(model_runs.ModelRuns, "_run", stopping)
    stops = 0
    for _ in range(100):
        left[0] = 330
        try:
            resumed = posterior(fit, seed=3, checkpoint=tmp_path / "kept")
            break
        except StoppedError:
            stops += 1
    assert stops >= 1
    np.testing.assert_array_equal(resumed.samples, whole.samples)
    assert (resumed.pareto_k, resumed.method) == (whole.pareto_k, whole.method)
    left[0] = 0  # all is kept
    again = posterior(fit, seed=3, checkpoint=tmp_path / "kept")
    np.testing.assert_array_equal(again.samples, whole.samples)
    assert again.pareto_k == whole.pareto_k
