"""Importance sampling of a posterior, judged by the Pareto tail of its weights.

Draws of a proposal q have the weights p / q, where p is the posterior. The largest weights follow a
generalised Pareto distribution (Vehtari, Simpson, Gelman, Yao and Gabry, Journal of Machine
Learning Research 25(72) (2024)). Its shape k tells whether averages over the draws converge. Its
quantiles replace the largest weights, which then vary less.

A proposal that is not good enough is adapted to all draws so far, weighted by the mixture of all
proposals (Cornuet, Marin, Mira & Robert, Scandinavian Journal of Statistics 39, 798 (2012)). It is
judged by new draws alone, since any proposal looks good on the draws that it was adapted to. It is
adapted at most twice: after more rounds it could fit one part of a bent posterior, pass, and miss
the rest.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, softmax

from calibrate.inference.proposal import Proposal
from calibrate.least_squares.bounds import Bounds

FIRST, MORE, MOST = 500, 250, 10_000
"""Draws of a proposal: at first, between two checks of their weights, and in all."""
ADAPTATIONS = 2
"""Most adaptations of the proposal."""
LARGEST_K = 0.7
"""Pareto's k beyond which averages over weighted draws are not to be used."""
LEAST_EFFECTIVE = 400.0
"""Fewest effective draws."""
WORTH = 100.0
"""Fewest effective draws to which a proposal is adapted."""
FEWEST = 100
"""Fewest draws to whose weights a tail is fitted."""
TRIES = 100
"""Most repetitions of draws that fall outside the bounds."""

Evaluate = Callable[[np.ndarray], np.ndarray]
"""Function from logarithms of values, (N, P), to log-densities, (N,)."""


class Weighted(NamedTuple):
    """Weighted draws of a posterior."""

    logs: np.ndarray
    """Logarithms of the values, (N, P)."""
    weights: np.ndarray
    """Weights, (N,), with the sum one."""
    pareto_k: float
    """Shape of the tail of the weights; infinite for too few draws."""

    @property
    def effective(self) -> float:
        """Number of effective draws, (sum w)^2 / sum w^2 (Kish)."""
        return float(1.0 / np.sum(self.weights**2)) if self.weights.size else 0.0

    @property
    def usable(self) -> bool:
        """True if averages over the draws converge."""
        return self.pareto_k <= largest_k(len(self.logs))

    @property
    def good(self) -> bool:
        """True if averages over the draws converge, and enough draws are effective."""
        return self.usable and self.effective >= LEAST_EFFECTIVE

    def equal(self, number: int, random: np.random.Generator) -> np.ndarray:
        """Draws of equal weight, (number, P), in random order, by systematic resampling."""
        places = (random.random() + np.arange(number)) / number
        chosen = np.searchsorted(np.cumsum(self.weights), places)
        return self.logs[random.permutation(np.minimum(chosen, len(self.logs) - 1))]


class _ProposalDraws(NamedTuple):
    """Draws of one proposal, and the log-densities of the posterior there."""

    proposal: Proposal
    logs: np.ndarray  # (N, P)
    densities: np.ndarray  # (N,)


def largest_k(draws: int) -> float:
    """Largest k of N usable draws: 1 - 1 / log10 N, and 0.7 at most."""
    return min(1.0 - 1.0 / np.log10(draws), LARGEST_K) if draws > 1 else -np.inf


def sample(log_densities: Evaluate, first: Proposal, box: Bounds, seed: int) -> Weighted:
    """Samples a posterior by importance, until the draws are good or their number is at its limit.

    Args:
      log_densities: function to log-densities of the posterior, up to a constant; not finite where
        the density is zero.
      first: the first proposal.
      box: bounds of the logarithms, outside which the density is zero.
      seed: seed of the draws.
    """
    narrow = first
    batches: list[_ProposalDraws] = []
    for number in range(1 + ADAPTATIONS):
        random = np.random.default_rng([seed, number])
        if number:
            narrow = narrow.split().adapted(*_adaptation_draws(batches))
        batches.append(_draws(log_densities, narrow.with_tails_of(first), box, random))
        weighted = _weigh(batches[-1])
        if weighted.good:
            break
    return weighted


def _draws(
    log_densities: Evaluate, proposal: Proposal, box: Bounds, random: np.random.Generator
) -> _ProposalDraws:
    """Draws from a proposal until they are good, or will clearly not be."""
    draws = _ProposalDraws(proposal, np.zeros((0, proposal.centres.shape[1])), np.zeros(0))
    while len(draws.logs) < MOST:
        logs = _within(proposal, FIRST if not len(draws.logs) else MORE, box, random)
        if not len(logs):
            break
        draws = _ProposalDraws(
            proposal,
            np.concatenate([draws.logs, logs]),
            np.concatenate([draws.densities, log_densities(logs)]),
        )
        weighted = _weigh(draws)
        hopeless = weighted.effective * MOST < LEAST_EFFECTIVE * len(draws.logs)
        if weighted.good or not weighted.usable or hopeless:
            break
    return draws


def _within(
    proposal: Proposal, number: int, box: Bounds, random: np.random.Generator
) -> np.ndarray:
    """Draws within the bounds, (N, P); fewer than asked for if nearly all fall outside."""
    within: list[np.ndarray] = []
    for _ in range(TRIES):
        candidates = proposal.draw(number, random)
        within.extend(
            candidates[np.all((candidates >= box.lower) & (candidates <= box.upper), axis=1)]
        )
        if len(within) >= number:
            break
    return np.array(within[:number]).reshape(-1, proposal.centres.shape[1])


def _weigh(draws: _ProposalDraws) -> Weighted:
    """Draws of one proposal with their smoothed weights."""
    usable = np.isfinite(draws.densities)
    logs = draws.logs[usable]
    if len(logs) < FEWEST:
        return Weighted(logs, np.full(len(logs), 1.0 / max(len(logs), 1)), np.inf)
    ratios = draws.densities[usable] - draws.proposal.log_density(logs)
    smoothed, k = _smooth(ratios)
    return Weighted(logs, softmax(smoothed), k)


def _smooth(ratios: np.ndarray) -> tuple[np.ndarray, float]:
    """Logarithms of weights, (N,), with the tail of a Pareto distribution, and its k."""
    from arviz_stats.base import array_stats

    with np.errstate(divide="ignore", invalid="ignore"):
        # It takes log-likelihoods of readings that are left out: their weights are inverse.
        smoothed, k = array_stats.psislw(-ratios)
    # Without a tail, as for equal weights, k is not finite.
    return np.asarray(smoothed), float(k) if np.isfinite(k) else _without_tail(ratios)


def _without_tail(ratios: np.ndarray) -> float:
    """Value of k if no tail can be fitted: minus infinity for equal weights, else infinity."""
    return -np.inf if np.ptp(ratios) < 1e-9 else np.inf


def _adaptation_draws(batches: Iterable[_ProposalDraws]) -> tuple[np.ndarray, np.ndarray]:
    """All draws, (N, P), and their weights for adapting a proposal, (N,).

    The weights are tempered: raised to a power at which enough draws are effective.
    """
    batches = list(batches)
    usable = [np.isfinite(draws.densities) for draws in batches]
    logs = np.concatenate(
        [draws.logs[finite] for draws, finite in zip(batches, usable, strict=True)]
    )
    densities = np.concatenate(
        [draws.densities[finite] for draws, finite in zip(batches, usable, strict=True)]
    )
    if len(logs) < FEWEST:
        return logs, np.full(len(logs), 1.0 / max(len(logs), 1))
    proposed = [
        draws.proposal.log_density(logs) + np.log(max(len(draws.logs), 1)) for draws in batches
    ]
    ratios, power = densities - logsumexp(proposed, axis=0), 1.0
    while np.sum((weights := softmax(power * ratios)) ** 2) > 1.0 / min(WORTH, 0.5 * len(logs)):
        power *= 0.5
    return logs, weights
