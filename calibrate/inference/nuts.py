"""Samples of a posterior by chains of NUTS, in coordinates scaled by the curvature at the optimum.

The posterior often is a long ridge. Positions are therefore measured along the principal directions
of the curvature, in standard deviations, and the mass matrix is dense. Chains start at draws of the
proposal, which is wider than the posterior, about each of the optima in turn.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from calibrate.inference.chains import MOST, Piece, Sampler, arrays
from calibrate.inference.density import Density
from calibrate.inference.importance import Evaluate
from calibrate.inference.laplace import Optima
from calibrate.inference.proposal import Proposal
from mrjax.core import randomness
from mrjax.io.checkpoint import Checkpoint

CHAINS, WARM_UP, SAMPLES = 4, 300, 500
STEPS = 7
"""Approximate number of leapfrog steps of a draw, with positions in standard deviations."""
WEIGHTY = 5e-3
"""Weight of an optimum, by Laplace's approximation, above which chains must have visited it."""
TRIES = 50
"""Most draws for a first position with a finite density."""


class Drawn(NamedTuple):
    """Draws of chains after their warm-up."""

    logs: np.ndarray
    """Logarithms of the values, (C, N, P)."""
    divergences: int
    separated: bool
    """True if each chain stays at one optimum, and not all at the same, or if no chain visits an
    optimum that has some weight."""


def sample(
    density: Density,
    optima: Optima,
    log_densities: Evaluate,
    *,
    seed: int,
    samples: int,
    work: Checkpoint | None,
    progress: bool,
) -> Drawn:
    """Samples a posterior by chains of NUTS.

    Args:
      density: density of the posterior.
      optima: optima of the posterior.
      log_densities: function from logarithms, (N, P), to log-densities.
      seed: seed of the chains.
      samples: number of samples of each chain.
      work: checkpoint that stores every fifty draws; None without one.
      progress: whether to show a progress bar, on standard error.
    """
    proposal = optima.proposal
    root, best = whitening(proposal)
    log_density = density.differentiable()

    def at(position: Array) -> Array:
        return log_density(density.reflected(best + root @ position))

    def home(position: Array, gradient: Array) -> tuple[Array, Array]:
        """Moves a position into the bounds: a chain among mirror images would look too wide."""
        logs, reflection = jax.vjp(density.reflected, best + root @ position)
        (gradient_within,) = reflection(jnp.linalg.solve(root.T, gradient))
        return jnp.linalg.solve(root, logs - best), root.T @ gradient_within

    first = beginnings(proposal, log_densities, density, seed)
    positions = np.linalg.solve(root, (first - best).T).T
    with randomness.ordered():
        sampler = Sampler(at, positions, seed=seed, warm_up=WARM_UP, draws=samples, home=home)
        piece = _run_chains(sampler, work, progress)
    logs = best + piece.positions[:, WARM_UP:] @ root.T
    divergences = int(piece.divergent[:, WARM_UP:].sum())
    return Drawn(logs, divergences, _separated(optima, logs))


def whitening(proposal: Proposal) -> tuple[np.ndarray, np.ndarray]:
    """A square root of the covariance at the best optimum, (P, P), and that optimum, (P,)."""
    variance, directions = np.linalg.eigh(proposal.scales[0])
    return directions * np.sqrt(variance), proposal.centres[0]


def beginnings(
    proposal: Proposal, log_densities: Evaluate, density: Density, seed: int
) -> np.ndarray:
    """First positions of the chains, (C, P): draws about each optimum in turn."""
    random = np.random.default_rng([seed, CHAINS])
    first = []
    for chain in range(CHAINS):
        place = chain % len(proposal.shares)
        about = proposal.component(place)
        position = about.centres[0]
        for candidate in about.draw(TRIES, random):
            if density.holds(candidate) and np.isfinite(log_densities(candidate[None])[0]):
                position = candidate
                break
        first.append(position)
    return np.stack(first)


def _separated(optima: Optima, logs: np.ndarray) -> bool:
    """True if chains, (C, N, P), do not determine the weights of the optima."""
    about = [set(optima.proposal.nearest(chain)) for chain in logs]
    reached = set.union(*about)
    missing = set(np.flatnonzero(optima.weights > WEIGHTY)) - reached
    return bool(missing) or (len(reached) > 1 and all(len(visited) == 1 for visited in about))


def _run_chains(sampler: Sampler, work: Checkpoint | None, progress: bool) -> Piece:
    """All steps of the chains, stored and new."""
    stored = None if work is None else work.sequence("chains")
    earlier, last_state = ([], None) if stored is None else stored.resumed()
    pieces = [Piece(piece["positions"], piece["divergent"]) for piece in earlier]
    done = sum(piece.positions.shape[1] for piece in pieces)
    chains = sampler.begin() if last_state is None else sampler.restored(last_state)
    unstored: list[Piece] = []
    with tqdm(
        desc="posterior", total=sampler.length, initial=done, disable=not progress, leave=False
    ) as bar:
        for state, piece in sampler.pieces(chains, done):
            done += piece.positions.shape[1]
            bar.set_postfix_str("warm-up" if done < sampler.warm_up else "draws", refresh=False)
            bar.update(piece.positions.shape[1])
            unstored.append(piece)
            if stored is not None and (done % MOST == 0 or done == sampler.length):
                joined = _concatenated(unstored)
                stored.append(joined._asdict(), arrays(state))
                pieces, unstored = [*pieces, joined], []
    return _concatenated([*pieces, *unstored])


def _concatenated(pieces: list[Piece]) -> Piece:
    return Piece(*(np.concatenate(arrays, axis=1) for arrays in zip(*pieces, strict=True)))
