"""Importance sampling of a posterior against exact answers and dense grids."""

import dataclasses
import re
from collections import OrderedDict

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

import mrjax
from calibrate import LogNormal
from calibrate import fit as fitted_to
from calibrate.inference import importance, model_runs, nuts
from calibrate.inference.density import Density
from calibrate.inference.importance import Weighted
from calibrate.inference.laplace import Optima, approximated
from calibrate.inference.posterior import posterior
from calibrate.inference.proposal import Proposal
from calibrate.inference.reach import ends_early
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.optima import Optimum
from mrjax.core.promotion import relaxed_promotion

pytest.importorskip("arviz_stats")

EVERYWHERE = Bounds(np.array(-np.inf), np.array(np.inf))


def on_a_grid(fit, *ends, points=301, log_density=None):
    """Logarithms of values on a dense grid, (G, P), and their weights by the posterior, (G,)."""
    axes = [np.linspace(*one, points) for one in ends]
    logs = np.stack([one.ravel() for one in np.meshgrid(*axes, indexing="ij")], axis=1)
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
        return importance._weigh(importance._ProposalDraws(Normal(), draws, densities))

    found = weighted(20.0)
    assert found.pareto_k == pytest.approx(0.95, abs=0.15)
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


def line(theta, data):
    return (theta["level"] - data) / 2.0


def test_an_estimated_scatter_makes_the_posterior_a_t_distribution():
    """The level of four readings whose scatter is what they tell: Student's t, three degrees.

    Its scale is s / 2. The error that is given, two, does not matter.
    """
    data = np.array([99.0, 101.0, 100.5, 100.3])
    fit = fitted_to(line, {"level": 100.0}, data=data)
    drawn = posterior(fit, scatter=[range(4)], seed=1)
    assert drawn.converged
    quantiles = np.array([0.05, 0.16, 0.5, 0.84, 0.95])
    exact = data.mean() + 0.5 * data.std(ddof=1) * stats.t(3).ppf(quantiles)
    error = np.sqrt(quantiles * (1 - quantiles) / drawn.effective.min())
    shares = (drawn.samples < exact).mean(0)
    np.testing.assert_array_less(np.abs(shares - quantiles), 4 * error)
    known = posterior(fitted_to(line, {"level": 100.0}, data=data)).samples
    assert known.std() == pytest.approx(1.0, rel=0.2)  # of a known error of 2


def test_odds_without_a_prior_are_of_shares_that_may_be_anywhere_alike():
    def open_to_data(theta):
        return jnp.stack([0.0 * theta["odds"], jnp.log(theta["b"])])

    fit = fitted_to(open_to_data, OrderedDict(odds=3.0, b=1.0), bounds={"odds": (1e-9, 1e9)})
    with pytest.raises(mrjax.InputError, match="posterior of odds has no end"):
        posterior(fit)
    drawn = posterior(fit, uniform=["odds"])
    share = drawn.samples[:, 0] / (1.0 + drawn.samples[:, 0])
    quantiles = np.linspace(0.1, 0.9, 9)
    error = np.sqrt(quantiles * (1 - quantiles) / drawn.effective.min())
    assert drawn.converged
    np.testing.assert_array_less(abs((share[:, None] < quantiles).mean(0) - quantiles), 4 * error)


def test_what_weights_cannot_tell_is_left_to_nuts(monkeypatch):
    """A valley that bends much; and where NUTS cannot follow, it is said."""
    fit = fitted_to(bent_much, OrderedDict(a=1.0, b=1.0))
    asked = []

    def noted(density, optima, *arguments, **keywords):
        asked.append(optima)
        return nuts.Drawn(np.random.default_rng(0).normal(size=(4, 50, 2)), 0, False)

    monkeypatch.setattr(nuts, "sample", noted)
    drawn = posterior(fit, samples=50)
    assert len(asked) == 1 and drawn.method == "NUTS" and drawn.pareto_k > 0.7
    alone = posterior(fit, method="importance sampling")
    assert len(asked) == 1 and alone.method == "importance sampling" and not alone.converged
    numbers = posterior(dataclasses.replace(fit, slopes=object()))
    assert len(asked) == 1 and not numbers.converged
    assert any("NUTS cannot take over" in one for one in numbers.faults)


def bent_much(theta):
    x, y = jnp.log(theta["a"]), jnp.log(theta["b"])
    return jnp.stack([8.0 * (y - x**2), 1.0 - x])


def test_samples_that_end_early_are_not_relied_on():
    """Of the right half of a banana; and of all of it."""
    fit = fitted_to(banana, OrderedDict(a=1.0, b=1.0))
    density = Density(fit.everything, fit.given, fit.box)
    random = np.random.default_rng(0)
    x = 1.0 + random.normal(size=5000)
    logs = np.stack([x, x**2 + random.normal(size=5000) / 0.7], axis=1)
    for held, names in ((logs, ()), (logs[x > 0.8], ("a", "b"))):
        with relaxed_promotion():
            found = ends_early(fit, density, held.mean(0), np.cov(held.T))
        assert found == names[: len(found)] and bool(found) == bool(names)


def test_an_optimum_that_cannot_be_looked_at_is_told():
    """A cheap model found it where the model itself gives no numbers, or goes on falling."""
    prior = {"a": LogNormal(1.0, 1.0)}
    fit = fitted_to(lambda theta: (jnp.log(theta["a"]) / 0.1)[None], {"a": 2.0}, priors=prior)
    for value, lost in ((50.0, False), (np.inf, True)):
        other = Optimum(np.array([value]), 0.5, 1.0, finished=False)
        drawn = posterior(dataclasses.replace(fit, optima=(*fit.optima, other)))
        assert bool(drawn.faults) == lost and drawn.converged != lost


def test_optima_have_their_weights_by_laplace():
    fit = fitted_to(two_valleys, {"a": 8.0}, also=[{"a": 0.1}])
    with relaxed_promotion():
        optima = approximated(fit, Density(fit.everything, fit.given, fit.box))
    assert optima.lost == 0
    # An optimum that is worse ends where another step would gain less than 0.1.
    np.testing.assert_allclose(optima.proposal.centres, [[2.0], [-2.0]], atol=0.05)
    # Slopes 2 x 2 x 2 and 1 x 2 x 2, the worse by exp(-1 / 8).
    np.testing.assert_allclose(optima.proposal.scales[:, 0, 0], [1 / 64, 1 / 16], rtol=0.05)
    weights = np.array([1.0, 2.0 * np.exp(-0.125)])
    np.testing.assert_allclose(optima.weights, weights / weights.sum(), rtol=0.05)


@pytest.mark.parametrize("box", [(-1.0, np.inf), (-np.inf, 2.0), (-1.0, 2.0), (-np.inf, np.inf)])
def test_logarithms_are_reflected_at_bounds(box):
    density = Density(None, None, Bounds(*map(np.array, box)))
    logs = np.linspace(-9.0, 9.0, 181)
    found = np.asarray(density.reflected(jnp.asarray(logs)))
    assert found.min() >= box[0] - 1e-12 and found.max() <= box[1] + 1e-12
    within = (logs >= box[0]) & (logs <= box[1])
    np.testing.assert_allclose(found[within], logs[within], atol=1e-12)
    for end in filter(np.isfinite, box):  # one step beyond is one step within
        near = np.asarray(density.reflected(jnp.asarray([end - 0.1, end + 0.1])))
        assert near[0] == pytest.approx(near[1], abs=1e-12)


def test_the_gradient_for_nuts_is_that_of_the_density():
    fit = fitted_to(straight, OrderedDict(a=1.0, b=1.0), data=np.array([1.0, 0.5]))
    density = Density(fit.everything, fit.given, fit.box, (np.arange(2),), np.array([1]))
    logs = jnp.array([0.3, -0.7])
    with relaxed_promotion():
        plain = lambda at: density.log_density(at, fit.everything(at, fit.given))  # noqa: E731
        np.testing.assert_allclose(
            jax.grad(density.differentiable())(logs), jax.grad(plain)(logs), rtol=1e-10
        )


def test_chains_that_stay_at_their_optima_are_told():
    proposal = Proposal(np.full(2, 0.5), np.array([[-2.0], [2.0]]), np.full((2, 1, 1), 0.01))
    optima = Optima(proposal, np.array([0.6, 0.4]), 0)
    apart = np.sign(np.arange(4) - 1.5)[:, None, None] * np.full((4, 50, 1), 2.0)
    mixing = np.tile(np.where(np.arange(50) % 2, 2.0, -2.0)[:, None], (4, 1, 1))
    alone = np.full((4, 50, 1), 2.0)
    assert nuts._separated(optima, apart) and not nuts._separated(optima, mixing)
    assert nuts._separated(optima, alone)
    assert not nuts._separated(optima._replace(weights=np.array([0.001, 0.999])), alone)


def test_chains_begin_about_all_optima_within_bounds():
    proposal = Proposal(np.full(2, 0.5), np.array([[-2.0], [2.0]]), np.full((2, 1, 1), 0.01))
    density = Density(None, None, Bounds(np.array(-2.0), np.array(2.1)))
    evaluated = lambda logs: np.where(logs[:, 0] < -1.95, -np.inf, 0.0)  # noqa: E731
    first = nuts.beginnings(proposal, evaluated, density, 0)[:, 0]
    assert first.shape == (4,) and len(set(first)) == 4
    assert (first[::2] >= -1.95).all() and (first[::2] < -1.0).all()
    assert (first[1::2] > 1.0).all() and (first[1::2] <= 2.1).all()


def test_the_cost_is_told_before_it_begins(capsys):
    posterior(fitted_to(banana, OrderedDict(a=1.0, b=1.0)), progress=True)
    told = capsys.readouterr().err
    assert re.search(r"posterior: about 500 model runs of [\d.e-]+ s, [\d.e-]+ s", told)
    posterior(fitted_to(banana, OrderedDict(a=1.0, b=1.0)))
    assert capsys.readouterr().err == ""


def gumbel(theta):
    """exp(x) - 1 - x in place of x^2 / 2: logarithms of exponential variables, skewed."""
    x = jnp.log(theta["x"])
    return jnp.sign(x) * jnp.sqrt(2.0 * (jnp.expm1(x) - x) + 1e-12)


@pytest.mark.slow
def test_nuts_takes_over_where_importance_sampling_fails():
    """Ten skewed values, each by itself: their means and variances are known."""
    pytest.importorskip("blackjax")
    drawn = posterior(fitted_to(gumbel, {"x": np.full(10, 1.1)}))
    assert drawn.method == "NUTS" and drawn.pareto_k > 0.6
    assert drawn.converged
    logs, few = np.log(drawn.samples), 4.0 / np.sqrt(drawn.effective.min())
    spread = np.pi / np.sqrt(6.0)
    np.testing.assert_allclose((logs.mean(0) + np.euler_gamma) / spread, 0.0, atol=few)
    np.testing.assert_allclose(logs.var(0) / spread**2, 1.0, atol=few * np.sqrt(4.4))


@pytest.mark.slow
def test_nuts_keeps_within_bounds():
    pytest.importorskip("blackjax")
    fit = fitted_to(leaning, {"a": 1.0}, bounds={"a": (0.5, 8.0)})
    drawn = posterior(fit, method="NUTS")
    assert drawn.converged and drawn.samples.min() >= 0.5 and drawn.samples.max() <= 8.0
    agrees_with(drawn, *on_a_grid(fit, np.log((0.5, 8.0)), points=4001))


@pytest.mark.slow
def test_chains_between_which_a_ridge_lies_have_not_converged():
    pytest.importorskip("blackjax")
    fit = fitted_to(two_valleys, {"a": 8.0}, also=[{"a": 0.1}])
    drawn = posterior(fit, method="NUTS")
    assert not drawn.converged and any("optima are separated" in one for one in drawn.faults)
    assert (drawn.r_hat > 1.1).all()
    sides = (np.log(drawn.samples).reshape(4, -1) > 0).mean(axis=1)
    assert set(sides) == {0.0, 1.0}
