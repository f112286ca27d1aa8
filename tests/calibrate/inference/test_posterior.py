"""Samples of a posterior: chains that agree, in pieces, kept, and stopped."""

import os
import subprocess
import sys
from collections import OrderedDict

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import LogNormal
from calibrate import fit as fitted_to
from calibrate.inference import chains, diagnostics, nuts
from calibrate.inference.chains import Sampler, arrays
from calibrate.inference.curvature import information
from calibrate.inference.density import Density
from calibrate.inference.laplace import approximated
from calibrate.inference.posterior import Posterior, posterior
from mrjax.core.promotion import relaxed_promotion
from tests.builders import ROOT

INTERRUPTED = ROOT / "tests" / "builders" / "interrupted_fits.py"


def normal(seed=0, draws=500, values=2):
    return np.random.default_rng(seed).normal(size=(4, draws, values))


def called(draws):
    """A posterior whose own numbers pass, of these logarithms of its samples."""
    good = np.full(draws.shape[2], 1.0), np.full(draws.shape[2], 1000.0)
    names = tuple("abcdef"[: draws.shape[2]])
    return Posterior(names, np.exp(draws).reshape(-1, draws.shape[2]), *good, 0)


def test_chains_that_agree_have_converged():
    draws = normal()
    assert (diagnostics.r_hat(draws) < 1.01).all()
    assert called(draws).converged
    # Ranks do not mind the scale, or a tail without a variance.
    heavy = np.tan(np.pi * (np.random.default_rng(1).random((4, 500, 1)) - 0.5))
    assert (diagnostics.r_hat(1e9 * heavy) < 1.01).all()


def stuck(draws):
    draws[:2, :, 1] = 0.0  # in the middle, where the others pass


def stuck_late(draws):
    draws[3, 250:, 1] = draws[3, 249, 1]


def apart(draws):
    draws[0, :, 1] += 0.5


def wide(draws):
    draws[2, :, 1] *= 3.0


def adrift(draws):
    draws[:, :, 1] += np.linspace(0.0, 2.0, draws.shape[1])


def all_stuck(draws):
    draws[:, :, 1] = 0.0


@pytest.mark.parametrize("spoil", [stuck, stuck_late, apart, wide, adrift, all_stuck])
def test_one_value_of_chains_that_do_not_agree_is_enough(spoil):
    draws = normal()
    spoil(draws)
    with np.errstate(invalid="ignore"):
        assert not diagnostics.r_hat(draws)[1] < 1.01
    assert diagnostics.r_hat(draws)[0] < 1.01
    assert not called(draws).converged


@pytest.mark.parametrize(
    "r_hat, effective, divergences, converged",
    [
        ([1.009, 1.009], [401.0, 401.0], 0, True),
        ([1.0, 1.011], [500.0, 500.0], 0, False),
        ([1.011, 1.0], [500.0, 500.0], 0, False),
        ([1.0, 1.0], [500.0, 399.0], 0, False),
        ([1.0, 1.0], [500.0, 500.0], 1, False),
    ],
)
def test_all_numbers_of_all_values_have_to_pass(r_hat, effective, divergences, converged):
    drawn = np.exp(normal()).reshape(-1, 2)
    numbers = np.array(r_hat), np.array(effective), divergences
    assert Posterior(("a", "b"), drawn, *numbers).converged == converged


def test_r_hat_is_that_of_its_definition():
    """Of two chains of four draws, split in two: by hand from the ranks 1 to 8."""
    draws = np.array([[1.0, 2.0, 5.0, 6.0], [3.0, 4.0, 7.0, 8.0]])[:, :, None]
    from arviz_stats.base import array_stats
    from scipy.stats import norm

    z = norm.ppf((np.array([[1, 2], [3, 4], [5, 6], [7, 8]]) - 0.375) / 8.25)
    within, between = z.var(axis=1, ddof=1).mean(), z.mean(axis=1).var(ddof=1)
    by_hand = np.sqrt(0.5 + between / within)
    middle = array_stats.rhat(draws[:, :, 0], method="z_scale")
    assert middle == pytest.approx(by_hand, rel=1e-12)
    assert diagnostics.r_hat(draws)[0] >= middle * (1.0 - 1e-12)


def test_too_few_samples_are_refused():
    fit = fitted_to(lambda theta: jnp.log(theta["a"])[None], {"a": 2.0})
    with pytest.raises(mrjax.InputError, match="samples = 3: must be at least 4"):
        posterior(fit, samples=3)


def ridge(theta, data):
    """a b is measured to 2 %; a by itself is not."""
    return (theta["a"] * theta["b"] / data - 1.0)[None] / 0.02


@pytest.fixture(scope="module")
def on_a_ridge():
    priors = {"a": LogNormal(2.0, 0.5), "b": LogNormal(3.0, 0.5)}
    start = OrderedDict(a=4.0, b=2.0)
    return fitted_to(ridge, start, priors=priors, data=np.array(6.0))


class StoppedError(Exception):
    """In place of a kill."""


@pytest.mark.slow
def test_draws_do_not_depend_on_the_pieces(monkeypatch):
    """Chains from a seed, one step at a time and as many as there may be."""
    pytest.importorskip("blackjax")
    found = []
    with relaxed_promotion():
        sampler = Sampler(
            lambda at: -0.5 * jnp.sum(at**2) - 0.1 * jnp.sum(at**4),
            np.random.default_rng(0).normal(size=(4, 2)), seed=3, warm_up=40, draws=30,
        )  # fmt: skip
        for duration, most in ((1e-9, 50), (1e9, 50), (1e9, 7)):
            monkeypatch.setattr(chains, "DURATION", duration)
            pieces = [piece for _, piece in sampler.pieces(sampler.begin(), 0, most)]
            found.append(np.concatenate([one.positions for one in pieces], axis=1))
            lengths = [one.positions.shape[1] for one in pieces]
            assert sum(lengths) == 70 and max(lengths) == min(most, max(lengths))
            assert (max(lengths) == 1) == (duration < 1.0)
        np.testing.assert_array_equal(found[0], found[1])
        np.testing.assert_array_equal(found[0], found[2])
        # And from what was kept of the chains on the way.
        following = sampler.pieces(sampler.begin(), 0, 7)
        half, _ = next(following)
        again = [p for _, p in sampler.pieces(sampler.restored(arrays(half)), 1, 7)]
        np.testing.assert_array_equal(
            found[0][:, 1:], np.concatenate([one.positions for one in again], axis=1)
        )


@pytest.mark.slow
def test_a_posterior_that_is_stopped_goes_on_with_the_same_bits(on_a_ridge, tmp_path, monkeypatch):
    pytest.importorskip("blackjax")
    whole = posterior(on_a_ridge, seed=1, samples=60, method="NUTS")
    pieces, left = Sampler.pieces, [3]

    def stopping(self, *arguments):
        for found in pieces(self, *arguments):
            if not left[0]:
                raise StoppedError
            left[0] -= 1
            yield found

    monkeypatch.setattr(Sampler, "pieces", stopping)
    monkeypatch.setattr(chains, "DURATION", 1e9)
    stops = 0
    for _ in range(20):
        left[0] = 5
        try:
            resumed = posterior(
                on_a_ridge, seed=1, samples=60, checkpoint=tmp_path / "kept", method="NUTS"
            )
            break
        except StoppedError:
            stops += 1
    assert stops >= 1
    np.testing.assert_array_equal(resumed.samples, whole.samples)
    np.testing.assert_array_equal(resumed.r_hat, whole.r_hat)
    assert resumed.divergences == whole.divergences


@pytest.mark.slow
@pytest.mark.parametrize("call", ["fit", "posterior", "profiles"])
def test_ctrl_c_ends_a_long_call_within_two_seconds(call):
    """Ten times each, at random moments after compilation."""
    if call == "posterior":
        pytest.importorskip("blackjax")
    done = subprocess.run(
        [sys.executable, INTERRUPTED, call, "10"],
        capture_output=True,
        text=True,
        timeout=550,
        env=os.environ,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    waits = [float(line) for line in done.stdout.split()]
    assert len(waits) == 10 and max(waits) < 2.0


def test_draws_of_the_warm_up_are_no_samples(monkeypatch):
    """Nor do its divergences count: three of the draws alone."""
    fit = calibrate.fit(lambda theta: (jnp.log(theta["a"]) / 0.1)[None], {"a": 2.0})
    warm_up = np.full((4, nuts.WARM_UP, 1), 1e3)
    draws = np.random.default_rng(0).normal(size=(4, 50, 1))
    divergent = np.zeros((4, nuts.WARM_UP + 50), bool)
    divergent[:, : nuts.WARM_UP] = True
    divergent[1, -3:] = True
    piece = chains.Piece(np.concatenate([warm_up, draws], axis=1), divergent)
    monkeypatch.setattr(nuts, "_run_chains", lambda *_: piece)
    monkeypatch.setattr(diagnostics, "effective", lambda draws: np.full(draws.shape[2], 500.0))
    drawn = posterior(fit, samples=50, method="NUTS")
    np.testing.assert_allclose(np.log(drawn.samples), 0.1 * draws.reshape(-1, 1), atol=1e-9)
    assert drawn.divergences == 3 and not drawn.converged


def test_positions_are_whitened_by_a_root_of_the_covariance():
    def residuals(theta):
        a, b = jnp.log(theta["a"]), jnp.log(theta["b"])
        return jnp.stack([10.0 * (a + b), 2.0 * (a - b)])

    fit = calibrate.fit(residuals, {"a": 1.5, "b": 1.0})
    density = Density(fit.everything, fit.given, fit.box)
    root, best = nuts.whitening(approximated(fit, density).proposal)
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(information(fit)), rtol=1e-9)
    np.testing.assert_allclose(best, np.log(fit.values), atol=1e-12)


def test_draws_are_worth_what_their_tails_are():
    """Draws that are new each time, of a width that lasts for fifty: tails come together."""
    from arviz_stats.base import array_stats

    draws = np.random.default_rng(0).normal(size=(4, 500, 1))
    assert 1600 < diagnostics.effective(draws)[0] < 2400
    draws *= np.where(np.arange(500) // 50 % 5 == 0, 5.0, 0.3)[:, None]
    assert array_stats.ess(draws, chain_axis=0, draw_axis=1)[0] > 1500
    assert diagnostics.effective(draws)[0] < 400
