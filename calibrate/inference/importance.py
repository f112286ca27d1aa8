"""Importance sampling of a posterior, judged by the Pareto tail of its weights.

Draws of a proposal q that covers the posterior p weigh p / q. Vehtari, Simpson, Gelman, Yao and
Gabry, Journal of Machine Learning Research 25(72) (2024): the largest weights follow a generalised
Pareto distribution, whose shape k tells whether averages over the draws converge; replaced by its
quantiles, the weights vary less. A proposal that is not good enough follows the draws so far, with
the density of the mixture of all proposals (Cornuet, Marin, Mira & Robert, Scandinavian Journal of
Statistics 39, 798 (2012)), and is judged by new draws alone: by those that made it, any would look
good. Twice at most: a proposal that was fitted often enough to a part of a bent posterior passes,
and lacks the rest.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, softmax

from calibrate.inference.proposal import Proposal
from calibrate.least_squares.bounds import Bounds

FIRST, MORE, MOST = 500, 250, 10_000
"""Draws of a proposal: at first, between two looks at their weights, and in all."""
ADAPTATIONS = 2
LARGEST_K = 0.7
"""Pareto's k beyond which averages over weighted draws are not to be used."""
LEAST_EFFECTIVE = 400.0
"""Independent draws that weighted ones must be worth."""
WORTH = 100.0
"""Independent draws that weighted ones must be worth for a proposal to follow them."""
FEWEST = 100
"""Draws whose weights show a tail."""
TRIES = 100
"""Times that draws beyond the bounds are drawn again."""

Evaluate = Callable[[np.ndarray], np.ndarray]
"""Logarithms of a density, (N,), at logarithms of values, (N, P)."""


class Weighted(NamedTuple):
    """Weighted draws of a posterior."""

    logs: np.ndarray
    """(N, P)."""
    weights: np.ndarray
    """(N,); their sum is one."""
    pareto_k: float
    """Shape of the tail of the weights, infinite where draws are too few."""

    @property
    def effective(self) -> float:
        """Independent draws that they are worth: (sum w)^2 / sum w^2 (Kish)."""
        return float(1.0 / np.sum(self.weights**2)) if self.weights.size else 0.0

    @property
    def usable(self) -> bool:
        """True if averages over the draws converge."""
        return self.pareto_k <= largest_k(len(self.logs))

    @property
    def good(self) -> bool:
        """True if averages over the draws are to be used."""
        return self.usable and self.effective >= LEAST_EFFECTIVE

    def equal(self, number: int, random: np.random.Generator) -> np.ndarray:
        """So many draws of equal weight, (number, P), in random order: systematic resampling."""
        places = (random.random() + np.arange(number)) / number
        chosen = np.searchsorted(np.cumsum(self.weights), places)
        return self.logs[random.permutation(np.minimum(chosen, len(self.logs) - 1))]


class _Drawn(NamedTuple):
    """Draws of one proposal, and the logarithms of the posterior there."""

    proposal: Proposal
    logs: np.ndarray  # (N, P)
    densities: np.ndarray  # (N,)


def largest_k(draws: int) -> float:
    """Largest k of so many draws that are to be used: 1 - 1 / log10 N, and 0.7 at most."""
    return min(1.0 - 1.0 / np.log10(draws), LARGEST_K) if draws > 1 else -np.inf


def sample(log_densities: Evaluate, first: Proposal, box: Bounds, seed: int) -> Weighted:
    """Weighted draws: as many as are needed, or all that are allowed.

    Args:
      log_densities: the posterior but for a constant; not finite where there is none.
      first: the proposal to begin with.
      box: bounds of the logarithms, beyond which there is no posterior.
      seed: of the draws.
    """
    narrow = first
    batches: list[_Drawn] = []
    for number in range(1 + ADAPTATIONS):
        random = np.random.default_rng([seed, number])
        if number:
            narrow = narrow.split().adapted(*_followed(batches))
        batches.append(_draws(log_densities, narrow.with_tails_of(first), box, random))
        weighted = _weighted(batches[-1])
        if weighted.good:
            break
    return weighted


def _draws(
    log_densities: Evaluate, proposal: Proposal, box: Bounds, random: np.random.Generator
) -> _Drawn:
    """Draws of a proposal until they are good, or it shows that they will not be."""
    draws = _Drawn(proposal, np.zeros((0, proposal.centres.shape[1])), np.zeros(0))
    while len(draws.logs) < MOST:
        logs = _within(proposal, FIRST if not len(draws.logs) else MORE, box, random)
        if not len(logs):
            break
        draws = _Drawn(
            proposal,
            np.concatenate([draws.logs, logs]),
            np.concatenate([draws.densities, log_densities(logs)]),
        )
        weighted = _weighted(draws)
        hopeless = weighted.effective * MOST < LEAST_EFFECTIVE * len(draws.logs)
        if weighted.good or not weighted.usable or hopeless:
            break
    return draws


def _within(
    proposal: Proposal, number: int, box: Bounds, random: np.random.Generator
) -> np.ndarray:
    """So many draws within the bounds, (N, P), or fewer where next to none are."""
    within: list[np.ndarray] = []
    for _ in range(TRIES):
        candidates = proposal.draw(number, random)
        within.extend(
            candidates[np.all((candidates >= box.lower) & (candidates <= box.upper), axis=1)]
        )
        if len(within) >= number:
            break
    return np.array(within[:number]).reshape(-1, proposal.centres.shape[1])


def _weighted(draws: _Drawn) -> Weighted:
    """Draws of one proposal with their smoothed weights."""
    usable = np.isfinite(draws.densities)
    logs = draws.logs[usable]
    if len(logs) < FEWEST:
        return Weighted(logs, np.full(len(logs), 1.0 / max(len(logs), 1)), np.inf)
    ratios = draws.densities[usable] - draws.proposal.log_density(logs)
    smoothed, k = _smoothed(ratios)
    return Weighted(logs, softmax(smoothed), k)


def _smoothed(ratios: np.ndarray) -> tuple[np.ndarray, float]:
    """Logarithms of weights, (N,), with the tail of a Pareto distribution, and its k."""
    from arviz_stats.base import array_stats

    with np.errstate(divide="ignore", invalid="ignore"):
        # Made for leaving readings out, whose weights are one over a likelihood.
        smoothed, k = array_stats.psislw(-ratios)
    # Where the largest weights are equal there is no tail, and none is given.
    return np.asarray(smoothed), float(k) if np.isfinite(k) else _without_tail(ratios)


def _without_tail(ratios: np.ndarray) -> float:
    """K of weights whose tail cannot be fitted: none where they are all alike, else infinite."""
    return -np.inf if np.ptp(ratios) < 1e-9 else np.inf


def _followed(batches: Iterable[_Drawn]) -> tuple[np.ndarray, np.ndarray]:
    """All draws, (N, P), and weights that a proposal can follow, (N,).

    Those are as even as it needs: a power of what they are.
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
