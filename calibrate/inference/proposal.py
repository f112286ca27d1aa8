"""Proposals of importance sampling: mixtures of Student's t, adapted to weighted draws.

A t distribution with few degrees of freedom has longer tails than a posterior that data or priors
bound. So no draw weighs much more than the others. Cappe, Douc, Guillin, Marin & Robert, Statistics
and Computing 18, 447 (2008) adapt such a mixture by expectation maximisation on weighted draws.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, softmax
from scipy.stats import multivariate_t

FREEDOM = 5
"""Degrees of freedom of every component."""
LEAST_SHARE = 0.05
"""Least share of a component, before the shares are divided by their sum."""
IN_TAILS, WIDER = 0.1, 3.0
"""Share of the draws that come from a wider proposal, and its width over the first."""
MOST_COMPONENTS = 8
HALVES = 0.8
"""Offset of the halves of a component, in its standard deviations."""
STEPS = 4
"""Steps of expectation maximisation on the same draws."""


class Proposal(NamedTuple):
    """A mixture of K multivariate t distributions in P logarithms."""

    shares: np.ndarray
    """Share of the draws that each component gives, (K,)."""
    centres: np.ndarray
    """Centres of the components, (K, P)."""
    scales: np.ndarray
    """Scale matrices, (K, P, P), which are proportional to covariances."""

    def draw(self, number: int, random: np.random.Generator) -> np.ndarray:
        """Draws of the mixture, (N, P)."""
        counts = random.multinomial(number, self.shares)
        drawn = [
            np.reshape(component.rvs(int(count), random), (count, self.centres.shape[1]))
            for component, count in zip(self._components(), counts, strict=True)
            if count
        ]
        return np.concatenate(drawn)

    def log_density(self, logs: np.ndarray) -> np.ndarray:
        """Log-density at points, (N, P); (N,)."""
        return logsumexp(self._joint(logs), axis=1)

    def component(self, place: int) -> "Proposal":
        """The proposal of a single component."""
        return Proposal(np.ones(1), self.centres[place, None], self.scales[place, None])

    def nearest(self, logs: np.ndarray) -> np.ndarray:
        """Index of the component to which each point, (N, P), most likely belongs; (N,)."""
        return self._joint(logs).argmax(axis=1)

    def with_tails_of(self, first: "Proposal") -> "Proposal":
        """This mixture with a share of another, widened one, which reveals uncovered regions."""
        return Proposal(
            np.concatenate([(1.0 - IN_TAILS) * self.shares, IN_TAILS * first.shares]),
            np.concatenate([self.centres, first.centres]),
            np.concatenate([self.scales, WIDER**2 * first.scales]),
        )

    def split(self) -> "Proposal":
        """The mixture with every component split along its longest axis, of the same covariance."""
        if 2 * len(self.shares) > MOST_COMPONENTS:
            return self
        centres, scales = [], []
        for centre, scale in zip(self.centres, self.scales, strict=True):
            variances, directions = np.linalg.eigh(scale)
            half = HALVES * np.sqrt(variances[-1]) * directions[:, -1]
            centres += [centre - half, centre + half]
            scales += [scale - np.outer(half, half)] * 2
        return Proposal(np.repeat(0.5 * self.shares, 2), np.array(centres), np.array(scales))

    def adapted(self, logs: np.ndarray, weights: np.ndarray) -> "Proposal":
        """The mixture fitted to weighted draws.

        A component to which too few draws belong stays as it is, with a least share.

        Args:
          logs: draws, (N, P).
          weights: weights of the draws, (N,), with the sum one.
        """
        adapted = self
        for _ in range(STEPS):
            adapted = adapted._step(logs, weights)
        return adapted

    def _step(self, logs: np.ndarray, weights: np.ndarray) -> "Proposal":
        size = logs.shape[1]
        belongs = weights[:, None] * softmax(self._joint(logs), axis=1)
        masses = belongs.sum(axis=0)
        enough = size * (size + 1) * (weights @ weights)
        centres, scales = self.centres.copy(), self.scales.copy()
        for place, membership in enumerate(belongs.T):
            # Fewer effective draws than twice the independent entries of a covariance.
            if masses[place] < enough:
                continue
            offset = logs - centres[place]
            distance = np.einsum("np,pq,nq->n", offset, np.linalg.pinv(scales[place]), offset)
            factors = membership * (FREEDOM + size) / (FREEDOM + distance)
            centres[place] = factors @ logs / factors.sum()
            offset = logs - centres[place]
            scales[place] = (offset.T * factors) @ offset / membership.sum()
        shares = np.maximum(masses, LEAST_SHARE)
        return Proposal(shares / shares.sum(), centres, scales)

    def _components(self) -> list:
        return [
            multivariate_t(centre, scale, df=FREEDOM, allow_singular=True)
            for centre, scale in zip(self.centres, self.scales, strict=True)
        ]

    def _joint(self, logs: np.ndarray) -> np.ndarray:
        """Logarithms of share times density, (N, K)."""
        log_densities = [np.atleast_1d(component.logpdf(logs)) for component in self._components()]
        return np.stack(log_densities, axis=1) + np.log(self.shares)
